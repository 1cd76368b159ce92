"""The linear-rotary actuator behind its controller: what is drawn for it, its plant and firmware, who works on it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from bench.errors import ConfigError
from bench.rigfile import RigFile
from bench.rigfile.toleranced import Toleranced
from sim_backend.machine import Array, Machine, Numbers, Truth
from sim_backend.machines.lira import quantities as of
from sim_backend.machines.lira.controller import LineController, SpokenController
from sim_backend.machines.lira.defects import DEFECTS, ELECTRICAL, FACTORS, OPEN_OHM, REVERSED
from sim_backend.machines.lira.operator import Attendant
from sim_backend.machines.lira.params import COILS, ControlParams, Each, PlantParams
from sim_backend.machines.lira.plant import DQ, TICKS_S, Plant
from sim_backend.machines.lira.settings import BY_NAME, HELD, INJECTED, LONGEST_HOLD_S, STEPPED
from sim_backend.machines.lira.truth_cogging import cogging
from sim_backend.machines.lira.truth_constants import constants
from sim_backend.machines.lira.truth_current_step import currents
from sim_backend.machines.lira.truth_gate import gates
from sim_backend.machines.lira.truth_loops import loops
from sim_backend.machines.lira.truth_mission import mission
from sim_backend.machines.lira.truth_pull import pulls
from sim_backend.machines.lira.truth_runout import runout
from sim_backend.motion import Motions
from sim_backend.spoken import sensors_by_reading

HALVES: Final = range(1, COILS + 1)
"""Coils and half-bridges by their numbers: coil k is driven by half-bridge k."""
PERIOD_S: Final = 2e-3
RADIAL: Final = ("x1", "x2", "y1", "y2")
CHANNELS: Final = (*RADIAL, "z", "gamma", *(f"i_{name}" for name in DQ), "u_dc", "limited", "speed")
EACH: Final = {
    "coil_resistance_spread": "{}", "coil_inductance_spread": "{}", "filter_inductance": "{}", "damper_resistance": "{}",
    "capacitor_derating": "filter_{} damper_{}",
}  # fmt: skip
"""Numbers that the rig file states once and each coil or half-bridge has of its own: what their draws' names end in."""
EXCHANGED: Final = ((1, 5), (2, 4))
"""Places among six half-bridges of phases b and c of both systems."""
SENT: Final = frozenset(f"ref_{name}" for name in (*RADIAL, "z", "gamma")) | frozenset(
    f"{what}_{name}" for what in ("rate", "accel") for name in ("z", "gamma")
)
"""Set points and what a move goes by, which the command line hears with verbs of their own."""
DAILY = frozenset(("site.air_density", "rest_angle"))
"""The weather, and how the mover was left."""
TARGETS = {
    "K_L@LA": "force_constant", "F_c": "cogging_force", "T_c": "cogging_torque", "m": "machine.mass",
    "J": "machine.polar_inertia", "J_t": "machine.transverse_inertia", "z_mid": "middle",
    **{f"{kind}@RA{k}": f"{name}_{k}" for k in (1, 2) for kind, name in (
        ("K_R", "torque_constant"), ("K_B", "bearing_constant"), ("K_pull", "machine.pull"))},
}  # fmt: skip


@dataclass(frozen=True)
class Built:
    """A linear-rotary actuator: its plant, the firmware's parameters, whether it runs as the reduced model, the angle at
    which it was left, rad; what of its parameters the firmware works with, and whether it tells currents without what it feeds
    forward, as `Plant` has them."""

    plant: PlantParams
    control: ControlParams
    reduced: bool = False
    rest_angle: float = 0.0
    factors: Mapping[str, float] = field(default_factory=dict)
    unfed: bool = False


def stated(rig: RigFile) -> dict[str, Toleranced]:
    """Every toleranced number of a rig file that is drawn, by its name; one that holds for each coil once for each."""
    out = {f"geometry.{k}": t for k, t in rig.geometry.items()} | {
        f"machine.{k}": t for k, t in rig.machine.items() if k not in EACH
    }
    out |= {
        "site.gravity": rig.site.gravity,
        "site.air_density": rig.site.air_density,
        "mass_density": rig.mass_density,
    }
    out |= {f"masses.{k}": t for k, t in rig.masses.items()}
    for name, sensor in sensors_by_reading(rig).items():
        out |= {f"{name}.gain": sensor.gain, f"{name}.offset": sensor.offset}
    for name, t in rig.simulation.items():
        if isinstance(t, Toleranced):
            out |= dict.fromkeys(_names(name), t)
    return out


def _names(stated_as: str) -> Iterator[str]:
    """Names of the draws of a number of the simulation table."""
    if stated_as not in EACH:
        yield stated_as
        return
    for form in EACH[stated_as].split():
        yield from (f"{stated_as}_{form.format(k)}" for k in HALVES)


def params(v: Numbers, d: Numbers) -> Built:
    """What drawn values `v` and planted defects `d` make.

    Raises:
        ConfigError: a defect is planted that the reduced model, which is asked for, does not have.
    """
    if v["reduced"] and (unseen := [name for name in ELECTRICAL if d[name] != DEFECTS[name]]):
        raise ConfigError(f"simulation.reduced: found 1 with {', '.join(unseen)}; expected 0: the reduced model has no "
                          "half-bridges")  # fmt: skip
    plant = PlantParams(
        **_moved(v), **_aligned(v, d), **_wound(v, d), **_sensed(v, d), **_wired(d),
        filter_r=v["filter_resistance"], supply=v["supply"],
        discharge_s=v["discharge"] * d["discharge_factor"], clearance=v["geometry.clearance"],
        ring_friction=v["ring_friction"],
    )  # fmt: skip
    control = ControlParams(
        observer_pull=0.0 if d["no_pull"] else 1.0, one_zero=d["one_zero"],
        hold_planes=1.0 if d["hold_one_plane"] else 3.0, hold_most_s=0.0 if d["hold_deaf"] else LONGEST_HOLD_S,
        gate_channels=d["gate_channels"], gate_lag_s=d["gate_lag_s"],
    )  # fmt: skip
    factors = {name: d[f"factor_{name}"] for name in FACTORS if d[f"factor_{name}"] != 1}
    return Built(plant, control, v["reduced"] != 0, v["rest_angle"], factors, d["current_unfed"] != 0)


def _moved(v: Numbers) -> dict[str, Any]:
    """The mover and the forces on it."""
    return {
        "force_constant": v["force_constant"],
        "torque_constant": (v["torque_constant_1"], v["torque_constant_2"]),
        "bearing_constant": (v["bearing_constant_1"], v["bearing_constant_2"]),
        "pull": (v["machine.pull_1"], v["machine.pull_2"]),
        "mass": v["machine.mass"],
        "polar_inertia": v["machine.polar_inertia"],
        "transverse_inertia": v["machine.transverse_inertia"],
        "bearing_plane": v["geometry.bearing_plane"],
        "sensor_plane": v["geometry.sensor_plane"],
        "middle": v["middle"],
        "pair_pitch": v["pair_pitch"],
        "cogging_force": v["cogging_force"],
        "cogging_force_2": v["cogging_force_2"],
        "cogging_torque": v["cogging_torque"],
        "gravity": v["site.gravity"],
    }


def _aligned(v: Numbers, d: Numbers) -> dict[str, Any]:
    """What is not where it should be, and what turns with the mover; amplitudes are drawn with their signs."""
    return {
        "zero_ra": (v["zero_ra1"] + d["zero_off_ra"], v["zero_ra2"] + d["zero_off_ra"]),
        "zero_la": v["zero_la"] + d["zero_off_la"],
        "centre": tuple(v[f"magnet_centre_{name}"] for name in RADIAL),
        "uneven": (abs(v["magnet_runout_1"]), abs(v["magnet_runout_2"])),
        "uneven_phase": (v["magnet_phase_1"], v["magnet_phase_2"]),
        "runout": abs(v["target_runout"]),
        "runout_phase": v["target_phase"],
        "runout_per_m": v["runout_per_m"],
        "eccentric": (v["eccentric_x"], v["eccentric_y"]),
    }


def _each(v: Mapping[str, float], name: str) -> Each:
    return tuple(v[f"{name}_{k}"] for k in HALVES)


def _coils(v: Numbers, name: str, spread: str) -> Each:
    """Twelve coils of the rotary actuators and three of the linear one, each with its own share on top."""
    kinds = 12 * (v[f"{name}_rot"],) + 3 * (v[f"{name}_lin"],)
    return tuple(kind * (1 + share) for kind, share in zip(kinds, _each(v, spread), strict=True))


def _wound(v: Numbers, d: Numbers) -> dict[str, Any]:
    """Coils, and filters of the half-bridges."""
    farad = v["filter_capacitance"] * d["capacitance_factor"]
    ohm = _coils(v, "coil_resistance", "coil_resistance_spread")
    return {
        "coil_r": tuple(OPEN_OHM if k == int(d["coil_dead"]) else r for k, r in zip(HALVES, ohm, strict=True)),
        "coil_l": _coils(v, "machine.inductance", "coil_inductance_spread"),
        "filter_l": _each(v, "filter_inductance"),
        "filter_c": tuple(farad * share for share in _each(v, "capacitor_derating_filter")),
        "damper_c": tuple(farad * share for share in _each(v, "capacitor_derating_damper")),
        "damper_r": _each(v, "damper_resistance"),
    }


def _sensed(v: Numbers, d: Numbers) -> dict[str, Any]:
    """Sensors; the angle's has no error but its zero."""
    signs = (d["position_sign_x1"], 1.0, d["position_sign_y1"], 1.0, 1.0)
    along = (*RADIAL, "z")
    return {
        "position_gain": (*(sign * v[f"{name}.gain"] for sign, name in zip(signs, along, strict=True)), 1.0),
        "position_offset": (*(v[f"{name}.offset"] for name in along), 0.0),
        "position_noise": (*4 * (v["position_noise"],), v["z_noise"], v["angle_noise"]),
        "filter_lag": v["filter_delay"],
        "late": v["adc_late"] + d["adc_late_s"],
        "bridge_gain": tuple(v[f"i_f{k}.gain"] for k in HALVES),
        "bridge_offset": tuple(v[f"i_f{k}.offset"] for k in HALVES),
        "bridge_noise": v["bridge_noise"],
        "coil_gain": tuple(v[f"i_s{k}.gain"] for k in HALVES),
        "coil_offset": tuple(v[f"i_s{k}.offset"] for k in HALVES),
        "coil_noise": v["coil_noise"],
        "voltage_gain": tuple(v[f"u_s{k}.gain"] for k in HALVES),
        "voltage_noise": v["voltage_noise"],
    }


def _wired(d: Numbers) -> dict[str, Any]:
    """Which coil each half-bridge drives, and which way round."""
    order = list(range(COILS))
    for k, first in enumerate((0, 6)):
        if int(d["exchange_phases"]) >> k & 1:
            for one, other in EXCHANGED:
                order[first + one], order[first + other] = order[first + other], order[first + one]
    if d["exchange_actuators"]:
        order[:12] = order[6:12] + order[:6]
    if d["cables_exchanged"]:
        one, other = (k - 1 for k in divmod(int(d["cables_exchanged"]), 100))
        order[one], order[other] = order[other], order[one]
    coils = [k + 1 for k in order]
    reversed_ = {int(d["coil_reversed"]), *REVERSED[int(d["actuator_reversed"])]}
    return {
        "terminal": tuple(map(float, order)),
        "turned": tuple(float(k in reversed_) for k in coils),
        "strength": tuple(d["weak_coil_gives"] if k == int(d["weak_coil"]) else 1.0 for k in coils),
    }


def quantities(p: Built, _: Numbers) -> dict[str, float]:
    """The true quantities, by kind and place."""
    return of.quantities(p.plant)


def make(p: Built, seed: int, _substeps: int) -> Any:
    """The plant itself, its mover as it was left: in the rings, at its angle."""
    plant = Plant(p.plant, seed, control=p.control, reduced=p.reduced, factors=p.factors, unfed=p.unfed)
    plant.put(angle=p.rest_angle)
    return plant


def operator(rig: RigFile, plant: Any, truth: Truth) -> Attendant:
    """Who works on it."""
    return Attendant(rig, plant, truth)


def places(_: Numbers, at: Mapping[str, int]) -> tuple[list[int], list[int]]:
    """Every channel is told under its own name."""
    told = [k for k, name in enumerate(CHANNELS) if name in at]
    return told, [at[CHANNELS[k]] for k in told]


def spoil(values: Array, at: Mapping[str, int], defects: Numbers) -> None:
    """No defect is planted in the telemetry."""


def copper_W(plant: Plant) -> float:
    """What its windings dissipate."""
    return float(sum(r * i * i for r, i in zip(plant.params.coil_r, plant.electric[3], strict=True)))


LIRA = Machine(
    name="lira",
    stated=stated,
    defects=DEFECTS,
    params=params,
    quantities=quantities,
    targets=TARGETS,
    make=make,
    radial=slice(0, 4),
    integral_gains=frozenset(("ki.b", "ki.r", "ki.z")),
    turns=False,
    channels=CHANNELS,
    places=places,
    spoil=spoil,
    supply_V=400.0,
    windings={},
    copper_W=copper_W,
    operator=operator,
    daily=DAILY,
    controls=frozenset((*BY_NAME, *INJECTED, *HELD, STEPPED)) | SENT | {f"step_{name}" for name in DQ},
    tick_s=1 / TICKS_S,
    period_s=PERIOD_S,
    motions=Motions(
        mission=mission,
        currents=currents,
        loops=loops,
        constants=constants,
        gates=gates,
        pulls=pulls,
        cogging=cogging,
        runout=runout,
    ),
    controller=SpokenController,
    served=LineController,
)
