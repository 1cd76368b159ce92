"""Values under `[simulation]` that no machine can have: of each key of a twin its unit (docs/reference/twin.md) and how small
it may be. Without this a negative mass runs like any other, and what divides by a zero ends in a traceback."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

from bench.errors import Problem
from bench.rigfile import RigFile
from bench.rigfile.check_machine import POSITIVE
from bench.rigfile.toleranced import Toleranced
from sim_backend.machines.twin.rules import ORDERS

MORE: Final = "more than 0"
LEAST: Final = "0 or more"
SWITCH: Final = "0 or 1"
UPRIGHT: Final = f"{-math.pi / 2:.4g} to {math.pi / 2:.4g}"
ANY: Final = "a number"
KEYS: Mapping[str, tuple[str, str]] = {
    **dict.fromkeys(("mass",), (MORE, "kg")),
    **dict.fromkeys(("transverse_inertia", "polar_inertia"), (MORE, "kg m^2")),
    **dict.fromkeys(("current_limit", "bias", "trip_current"), (MORE, "A")),
    **dict.fromkeys(("bandwidth", "derivative_hz", "amplifier_hz", "mode_1", "mode_2"), (MORE, "Hz")),
    **dict.fromkeys(("lift_time", "lift_time_s", "watchdog_s"), (MORE, "s")),
    **dict.fromkeys(("stop", "position_range", "ring_radius"), (MORE, "m")),
    **dict.fromkeys(("trip_speed", "landing_speed"), (MORE, "rad/s")),
    "notch_q": (MORE, "1"), "beta": (MORE, "N m^2/A^2"), "inductance": (MORE, "H"), "resistance": (MORE, "Ohm"),
    "supply_V": (MORE, "V"),
    **dict.fromkeys(("position_noise", "position_lsb", *(f"runout_{n}" for n in ORDERS)), (LEAST, "m")),
    **dict.fromkeys(("current_noise", "current_lsb"), (LEAST, "A")),
    "slew": (LEAST, "m/s"), "slew_tilt": (LEAST, "rad/s"), "unbalance": (LEAST, "kg m"), "mode_damping": (LEAST, "1"),
    "ring_stiffness": (LEAST, "N/m"), "ring_damping": (LEAST, "N s/m"), "ring_friction": (LEAST, "1"),
    "viscous": (LEAST, "N m s/rad"), "coulomb": (LEAST, "N m"), "drive_gain": (LEAST, "N m s/rad"),
    "drive_limit": (LEAST, "N m"), "drive_ramp": (LEAST, "rad/s^2"),
    "kp": (LEAST, "A/m"), "ki": (LEAST, "A/(m s)"), "kd": (LEAST, "A s/m"),
    **dict.fromkeys(("mode_1_on", "mode_2_on"), (SWITCH, "1")), "tilt": (UPRIGHT, "rad"),
    **dict.fromkeys(("magnetic_offset", "coupling_offset_z"), (ANY, "m")),
    **dict.fromkeys(("unbalance_phase", "runout_phase", *(f"runout_phase_{n}" for n in ORDERS)), (ANY, "rad")),
    **dict.fromkeys(("pulse_angle", "start_angle", "hand_angle"), (ANY, "rad")), "speed_ref": (ANY, "rad/s"),
}  # fmt: skip
"""Of every key that a twin or its controller knows, but tables of names."""


def impossible(rig: RigFile) -> Iterator[Problem]:
    """Each value that cannot be, by its key, and what is no number where one belongs."""
    for key, said in rig.simulation.items():
        if (kind := kind_of(key)) is None:
            continue
        entries = said.items() if isinstance(said, Mapping) else (("", said),)
        for part, value in entries:
            place = f"simulation.{key}.{part}" if part else f"simulation.{key}"
            if told := wrong(value, *kind):
                yield Problem(rig.path, place, *told)


def without(rig: RigFile, problems: tuple[Problem, ...]) -> RigFile:
    """The same rig with what is wrong left to the rules, so that the rest of it can be looked at."""
    if not problems:
        return rig
    keys = {p.key.split(".", 1)[1] for p in problems}
    sound: dict[str, Any] = {}
    for key, said in rig.simulation.items():
        if isinstance(said, Mapping):
            sound[key] = {part: value for part, value in said.items() if f"{key}.{part}" not in keys}
        elif key not in keys:
            sound[key] = said
        elif key == "mass":  # which no rule gives
            sound[key] = 1.0
    return rig.model_copy(update={"simulation": sound})


def cannot_be(name: str, value: float) -> tuple[str, str] | None:
    """The same of a number of one machine, by its name."""
    return None if (kind := kind_of(name)) is None else wrong(value, *kind)


def kind_of(key: str) -> tuple[str, str] | None:
    """What a key's value may be, and its unit ("": any); None of a key that is a table of names, or none. A part's own key
    (`beta_u1`, `beta.u1`) is as the plain one; so is a number of the rig file by its identity (`shaft.mass`)."""
    if key in KEYS:
        return KEYS[key]
    table, dot, _ = key.partition(".")
    if not dot:
        bases = [base for base in KEYS if key.startswith(f"{base}_")]
        return KEYS[max(bases, key=len)] if bases else None
    last = key.rpartition(".")[2]
    if table in KEYS and last not in ("gain", "offset"):  # which are those of a channel that is called so
        return KEYS[table]
    return (MORE if table == "geometry" or last in POSITIVE else ANY), ""


def wrong(value: object, may_be: str, unit: str) -> tuple[str, str] | None:
    """What is found and expected where a value cannot be."""
    unit_told = f" {unit}" if unit not in ("", "1") else ""
    expected = {ANY: ANY, LEAST: f"0{unit_told} or more"}.get(may_be, f"{may_be}{unit_told}")
    if isinstance(value, bool) or not isinstance(value, int | float | Toleranced):
        return str(value).lower() if isinstance(value, bool) else repr(value), f"a number: {expected}"
    number = value.value if isinstance(value, Toleranced) else float(value)
    if isinstance(value, Toleranced) and unit and value.unit != unit:
        return value.unit, f"a unit of the kind of {unit}"
    if not math.isfinite(number):
        return f"{number:g}", "a finite number" if may_be == ANY else f"a finite number, {expected}"
    fits = {MORE: number > 0, LEAST: number >= 0, SWITCH: number in (0, 1), UPRIGHT: abs(number) <= math.pi / 2 + 1e-9}
    if not fits.get(may_be, True):
        return f"{number:g}{unit_told}", expected
    if isinstance(value, Toleranced) and may_be == MORE and (width := _width(value)) >= number:
        return f"{number:g} ± {width:g}{unit_told}", "a tolerance that leaves it positive: look at the units of both"
    return None


def _width(number: Toleranced) -> float:
    return number.half_width or number.standard_uncertainty
