"""The one-axis machine behind the simulated controller: what is drawn for it, its plant, its wiring, who works on it."""

from __future__ import annotations

from collections.abc import Mapping

from scipy import optimize

from bench.rigfile import RigFile
from bench.rigfile.toleranced import Toleranced
from sim_backend.machine import Array, Machine, Numbers, Truth
from sim_backend.machines.oneaxis.params import PlantParams
from sim_backend.machines.oneaxis.plant import CHANNELS, Plant

COILS = ("i_y_p", "i_y_n")
COIL_OHM = 0.6
DEFECTS = {"drop_fraction": 0.0, "dead_after_s": 0.0, "fault_after_s": 0.0, "integrator_factor": 1.0,
           "position_sign": 1.0}  # fmt: skip
"""Planted defects and their harmless values; all but the last are the controller's and the link's, which every machine has."""


def stated(rig: RigFile) -> dict[str, Toleranced]:
    """Every toleranced number of a rig file that is drawn, by its name."""
    out = {"gravity": rig.site.gravity, "mass": rig.machine["mass"], "gap": rig.geometry["amb_gap"],
           "clearance": rig.geometry["clearance"], "beta": rig.simulation["beta"]}  # fmt: skip
    for name, sensor in rig.sensors.items():
        out |= {f"{name}.gain": sensor.gain, f"{name}.offset": sensor.offset}
    return out


def params(v: Numbers, d: Numbers) -> PlantParams:
    """The plant that drawn values `v` and planted defects `d` make."""
    return PlantParams(
        mass=v["mass"],
        gravity=v["gravity"],
        beta=v["beta"],
        gap=v["gap"],
        clearance=v["clearance"],
        lost_height=0.92 * v["clearance"],
        position_gain=d["position_sign"] * v["pos_y.gain"],
        position_offset=v["pos_y.offset"],
        current_gain=(v["i_y_p.gain"], v["i_y_n.gain"]),
        current_offset=(v["i_y_p.offset"], v["i_y_n.offset"]),
    )


def quantities(p: PlantParams, settings: Numbers) -> dict[str, float]:
    """The true static control current, held where the position sensor reads zero."""
    bias, y = settings["bias"], -p.position_offset / p.position_gain

    def lacking(i: float) -> float:
        pull = ((bias + i) / (p.gap - y)) ** 2 - ((bias - i) / (p.gap + y)) ** 2
        return float(p.beta * pull - p.mass * p.gravity)

    return {"i_static": float(optimize.brentq(lacking, -bias, bias, xtol=1e-12))}


def make(p: PlantParams, seed: int, substeps: int) -> Plant:
    """The plant itself."""
    return Plant(p, seed, substeps=substeps)


def places(_: Numbers, at: Mapping[str, int]) -> tuple[slice, list[int]]:
    """Every channel of the core is told under its own name."""
    return slice(None), [at[name] for name in CHANNELS]


def spoil(values: Array, at: Mapping[str, int], defects: Numbers) -> None:
    """No defect is planted in the telemetry."""


def copper_W(plant: Plant) -> float:
    """What its windings dissipate."""
    return COIL_OHM * sum(i * i for i in plant.currents)


class Bystander:
    """Nobody works on it; questions are answered with yes."""

    def request(self, line: str) -> str:
        """One line: `ask TEXT`."""
        return "yes" if line.split()[:1] == ["ask"] else f"error cannot {line.strip()!r}"


def operator(_rig: RigFile, _plant: Plant, _truth: Truth) -> Bystander:
    """Who works on it."""
    return Bystander()


ONEAXIS = Machine(
    name="oneaxis", stated=stated, defects=DEFECTS, params=params, quantities=quantities, targets={}, make=make,
    radial=slice(0, 1), integral_gains=frozenset(("ki",)), turns=False, channels=CHANNELS, places=places, spoil=spoil,
    supply_V=48.0, windings={}, copper_W=copper_W, operator=operator,
)  # fmt: skip
