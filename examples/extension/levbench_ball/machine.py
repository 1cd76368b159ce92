"""The ball as a machine of Levbench's simulator: what is drawn for it, what is true of it, how it is told."""

from __future__ import annotations

from collections.abc import Mapping

from bench.rigfile import RigFile
from bench.rigfile.toleranced import Toleranced
from levbench_ball.plant import CHANNELS, Params, Plant
from sim_backend.machine import Array, Machine, Numbers, Truth

COIL_OHM = 4.0
DEFECTS = {"drop_fraction": 0.0, "dead_after_s": 0.0, "fault_after_s": 0.0, "integrator_factor": 1.0,
           "position_sign": 1.0}  # fmt: skip
"""Planted defects and their harmless values. All but the last are the controller's, which every machine has."""


def stated(rig: RigFile) -> dict[str, Toleranced]:
    """Every toleranced number of a rig file that is drawn, by its name."""
    simulated = {name: rig.simulation[name] for name in ("constant", "zero")}
    drawn = {"gravity": rig.site.gravity, "clearance": rig.geometry["clearance"]}
    drawn |= {"mass": rig.machine["mass"], "saturation": rig.machine["own_saturation"]}
    for name, sensor in rig.sensors.items():
        drawn |= {f"{name}.gain": sensor.gain, f"{name}.offset": sensor.offset}
    return drawn | simulated


def params(v: Numbers, d: Numbers) -> Params:
    """The plant that drawn values `v` and planted defects `d` make."""
    return Params(
        constant=v["constant"],
        mass=v["mass"],
        gravity=v["gravity"],
        zero=v["zero"],
        clearance=v["clearance"],
        position_gain=d["position_sign"] * v["pos_y.gain"],
        position_offset=v["pos_y.offset"],
        current_gain=v["i.gain"],
        current_offset=v["i.offset"],
        saturation=v["saturation"],
    )


def quantities(p: Params, _settings: Numbers) -> dict[str, float]:
    """The truth that procedures are held against."""
    return {"C": p.constant}


def make(p: Params, seed: int, _substeps: int) -> Plant:
    """The plant itself."""
    return Plant(p, seed)


def places(_: Numbers, at: Mapping[str, int]) -> tuple[slice, list[int]]:
    """Every column of the plant's rows is told under its own name."""
    return slice(None), [at[name] for name in CHANNELS]


def spoil(values: Array, at: Mapping[str, int], defects: Numbers) -> None:
    """No defect is planted in the telemetry."""


def copper_W(plant: Plant) -> float:
    """What its winding dissipates."""
    return COIL_OHM * plant.current**2


class Bystander:
    """Nobody works on it; questions are answered with yes."""

    def request(self, line: str) -> str:
        """One line: `ask TEXT`."""
        return "yes" if line.split()[:1] == ["ask"] else f"error cannot {line.strip()!r}"


def operator(_rig: RigFile, _plant: Plant, _truth: Truth) -> Bystander:
    """Who works on it."""
    return Bystander()


BALL = Machine(
    name="ball", stated=stated, defects=DEFECTS, params=params, quantities=quantities, targets={"C": "constant"}, make=make,
    radial=slice(0, 1), integral_gains=frozenset(("ki",)), turns=False, channels=CHANNELS, places=places, spoil=spoil,
    supply_V=24.0, windings={}, copper_W=copper_W, operator=operator,
)  # fmt: skip
