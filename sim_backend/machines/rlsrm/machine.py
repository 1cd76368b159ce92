"""The rotary-linear motor behind the simulated controller: what is drawn for it, its plant, its sensors, who works on it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from bench.rigfile import RigFile
from bench.rigfile.toleranced import Toleranced
from sim_backend import instrument, load_cells
from sim_backend.machine import Array, Machine, Numbers, Truth
from sim_backend.machines.rlsrm import quantities as of
from sim_backend.machines.rlsrm.defects import DEFECTS, NAMES
from sim_backend.machines.rlsrm.device import CHANNELS, SETTABLE, Built, Sensed, StagePlant
from sim_backend.machines.rlsrm.operator import Attendant
from sim_backend.machines.rlsrm.params import DEG, ControlParams, Each, Map, PlantParams
from sim_backend.machines.rlsrm.plant import LOOP_TICKS, TICKS_S
from sim_backend.machines.rlsrm.served import READINGS
from sim_backend.machines.rlsrm.states import states
from sim_backend.machines.rlsrm.truth_decoupling import decoupling
from sim_backend.machines.rlsrm.truth_following import following
from sim_backend.machines.rlsrm.truth_load import loads
from sim_backend.machines.rlsrm.truth_map import of_map, of_zeros
from sim_backend.machines.rlsrm.truth_static import statics
from sim_backend.motion import Motions
from sim_backend.spoken import sensors_by_reading

EACH: Final = {"phase_gain": NAMES, "resistance_spread": NAMES, "stator_zero": ("1", "2")}
"""Numbers that the rig file states once and each phase or stator has of its own: what their draws' names end in."""
EXCHANGED: Final = ((1, 2), (4, 5))
"""Phases b and c of each stator."""
DAILY = frozenset(("site.air_density", "ambient", "rest_x", "rest_angle"))
"""The weather, and how the mover was left."""
TARGETS = {"m": "machine.mass", "J": "machine.polar_inertia", "F_c": "coulomb", "D": "viscous_x", "K": "viscous_angle",
           "lambda": "slope", "i_s": "saturation"}  # fmt: skip
COUNT: Final = (1e-6, 0.144 * DEG)
"""What the controller takes a count for."""


def stated(rig: RigFile) -> dict[str, Toleranced]:
    """Every toleranced number of a rig file that is drawn, by its name; one that holds for each phase once for each."""
    out = {f"geometry.{k}": t for k, t in rig.geometry.items()} | {f"machine.{k}": t for k, t in rig.machine.items()}
    out |= {f"masses.{k}": t for k, t in rig.masses.items()} | {"hanger": rig.hanger, "mass_density": rig.mass_density}
    out |= {"site.gravity": rig.site.gravity, "site.air_density": rig.site.air_density}
    for name, sensor in sensors_by_reading(rig).items():
        out |= {f"{name}.gain": sensor.gain, f"{name}.offset": sensor.offset}
    out |= dict(_inline(rig)) | instrument.stated(rig) | load_cells.stated(rig)
    for name, t in rig.simulation.items():
        if isinstance(t, Toleranced):
            out |= {f"{name}_{end}": t for end in EACH[name]} if name in EACH else {name: t}
    return out


def _inline(rig: RigFile) -> Iterator[tuple[str, Toleranced]]:
    """Numbers that stand where they are used."""
    found: dict[str, Any] = {f"encoders.{name}.pitch": e.pitch for name, e in rig.encoders.items()}
    for name, hook in rig.hooks.items():
        if hook.pulley is not None:
            found |= {f"hooks.{name}.pulley.friction": hook.pulley.friction}
            found |= {f"hooks.{name}.pulley.misalignment": hook.pulley.misalignment}
    if rig.shaft is not None:
        found |= {"shaft.tilt": rig.shaft.tilt}
    yield from ((name, t) for name, t in found.items() if isinstance(t, Toleranced))


def params(v: Numbers, d: Numbers) -> Built:
    """What drawn values `v` and planted defects `d` make."""
    plant = PlantParams(
        map=_map(v, d), **_moved(v, d), **_driven(v, d), **_encoded(v, d), ambient=v["ambient"],
        thermal_resistance=v["thermal_resistance"], thermal_capacity=v["thermal_capacity"],
    )  # fmt: skip
    sensed = Sensed(
        current_gain=_gains(v, d), current_offset=_each(v, "i_{}.offset"),
        voltage_gain=_each(v, "u_{}.gain"), voltage_offset=_each(v, "u_{}.offset"), current_noise=v["current_noise"],
        voltage_noise=v["voltage_noise"], told=_each(d, "told_factor_{}"), cold=d["cold_told"],
    )  # fmt: skip
    return Built(plant, ControlParams(), sensed, (v["rest_x"], v["rest_angle"]))


def _each(v: Numbers, form: str) -> Each:
    return tuple(v[form.format(name)] for name in NAMES)


def _map(v: Numbers, d: Numbers) -> Map:
    """Of the machine; both stators are off by what is planted."""
    same = {
        name: v[name]
        for name in ("slope", "unaligned", "c2", "c3", "fringe", "leakage", "saturation", "centre", "uneven_phase")
    }
    zero = tuple(v[f"stator_zero_{k}"] + d["angle_zero_off"] for k in (1, 2))
    return Map(**same, length=v["stack"], overlap=v["overlap"], gain=_each(v, "phase_gain_{}"), zero=(zero[0], zero[1]),
               uneven=v["uneven"])  # fmt: skip


def _moved(v: Numbers, d: Numbers) -> dict[str, Any]:
    """The mover, its bearing, its bumpers; the far end is drawn above the horizontal."""
    return {
        "mass": v["machine.mass"],
        "inertia": v["machine.polar_inertia"],
        "viscous": (v["viscous_x"], v["viscous_angle"]),
        "coulomb": v["coulomb"],
        "coulomb_angle": v["coulomb"] * v["geometry.bearing_radius"],
        "bearing_radius": v["geometry.bearing_radius"],
        "along_path": d["along_path"],
        "coulomb_sides": v["coulomb_sides"],
        "brake": (d["brake_x"], d["brake_angle"]),
        "lock_give": (d["lock_loose"] * abs(v["lock_give_x"]), d["lock_loose"] * abs(v["lock_give_angle"])),
        "tilt": -v["shaft.tilt"],
        "gravity": v["site.gravity"],
        "stop": v["stop"],
    }


def _driven(v: Numbers, d: Numbers) -> dict[str, Any]:
    """Windings and amplifiers."""
    return {
        "resistance": tuple(v["machine.resistance"] * (1 + share) for share in _each(v, "resistance_spread_{}")),
        "supply": v["supply_V"],
        "share": _each(d, "voltage_share_{}"),
        "current_gain": _gains(v, d),
        "current_offset": _each(v, "i_{}.offset"),
        "wired": _wired(d),
    }


def _gains(v: Numbers, d: Numbers) -> Each:
    """Of the amplifiers' own sensors, which their loops and the host read."""
    both = zip(_each(v, "i_{}.gain"), _each(d, "current_factor_{}"), strict=True)
    return tuple(gain * factor for gain, factor in both)


def _wired(d: Numbers) -> Each:
    """Which winding each amplifier drives."""
    order = list(range(len(NAMES)))
    for k, (one, other) in enumerate(EXCHANGED):
        if int(d["exchange_phases"]) >> k & 1:
            order[one], order[other] = order[other], order[one]
    if d["exchange_stators"]:
        order = order[3:] + order[:3]
    return tuple(map(float, order))


def _encoded(v: Numbers, d: Numbers) -> dict[str, Any]:
    """Encoders: a drawn pitch is a scale that is off, as the controller counts by the stated one."""
    return {
        "pitch": (COUNT[0], COUNT[1] / d["counts_share"]),
        "scale": COUNT[0] / v["encoders.x.pitch"] - 1,
        "edge": (v["edge_x"], v["edge_angle"]),
        "truncate": (d["truncate"], d["truncate"]),
        "once": v["angle_error"],
        "once_phase": v["angle_error_phase"],
    }


def quantities(p: Built, _: Numbers) -> dict[str, float]:
    """The true quantities, by kind and place."""
    return of.quantities(p.plant)


def make(p: Built, seed: int, _substeps: int) -> Any:
    """The plant itself, its mover as it was left."""
    return StagePlant(p, seed)


def operator(rig: RigFile, plant: Any, truth: Truth) -> Attendant:
    """Who works on it."""
    return Attendant(rig, plant, truth)


def places(_: Numbers, at: Mapping[str, int]) -> tuple[list[int], list[int]]:
    """Every channel is told under its own name."""
    told = [k for k, name in enumerate(CHANNELS) if name in at]
    return told, [at[CHANNELS[k]] for k in told]


def spoil(values: Array, at: Mapping[str, int], defects: Numbers) -> None:
    """Defects of sensors are planted where they read."""


def copper_W(plant: StagePlant) -> float:
    """What its windings dissipate."""
    p, core = plant.built.plant, plant.core
    ohm = [r * (1 + p.copper * (warm - 20)) for r, warm in zip(p.resistance, core.warmth, strict=True)]
    return float(sum(r * i * i for r, i in zip(ohm, core.currents, strict=True)))


RLSRM = Machine(
    name="rlsrm", stated=stated, defects=DEFECTS, params=params, quantities=quantities, targets=TARGETS, make=make,
    radial=slice(0, 0), integral_gains=frozenset(("ki_x", "ki_angle")), turns=False, channels=CHANNELS, places=places,
    spoil=spoil, supply_V=90.0, windings={}, copper_W=copper_W, operator=operator, traced=lambda _: READINGS, daily=DAILY,
    controls=SETTABLE, levitates=False, tick_s=1 / TICKS_S, period_s=LOOP_TICKS / TICKS_S, states=states,
    motions=Motions(loads=loads, inductances=of_map, stators=of_zeros, statics=statics, following=following,
    decoupling=decoupling),
)  # fmt: skip
