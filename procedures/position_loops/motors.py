"""Motors that a position loop drives: how the phase of their currents goes with what the loop holds."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_loops import ForceCurrent
from bench.rigfile.places import Places
from bench.uncertainty import Estimate, Influence
from procedures.position_loops.injection import ability
from procedures.shared.certificates import certified


def motors(rig: RigFile, loop: str) -> dict[str, ForceCurrent]:
    """Those whose current gives force along a loop, by name."""
    return {name: one for name, one in rig.capabilities.force_currents.items() if one.loop == loop}


def around(rig: RigFile, loop: str) -> bool:
    """Whether it holds an angle."""
    motion = rig.capabilities.motion
    return motion is not None and ability(rig).loops[loop].channel == motion.angle_channel


def inertia(rig: RigFile, loop: str) -> Estimate:
    """What the loop moves: of the rig file."""
    one = ability(rig).loops[loop]
    return certified(one.inertia, Places(rig).known[one.inertia]) * one.share


def off(
    rig: RigFile, parameters: Mapping[str, float], motor: str, zeros: Mapping[str, Estimate] | None
) -> Estimate | None:
    """By how much the controller, set by `parameters`, lays the currents of a motor wrong, rad, by its `zeros` as they were
    measured; None where they were not."""
    one, found = rig.capabilities.force_currents[motor], (zeros or {}).get(f"zero@{motor}")
    if found is None or not one.zero:
        return None
    return found - parameters.get(one.zero, rig.parameters[one.zero].default)


def cosine(rig: RigFile, motor: str, off: Estimate | None = None) -> Estimate:
    """1/cos of what the encoder's zero is `off`. Where that was not measured nothing here shows it: its mean and spread over
    the tolerance, to the second order."""
    if off is not None:
        c, s = math.cos(off.value), math.sin(off.value)
        return Estimate(1 / c, "1", (off * (s / c**2)).sensitivities)
    zero = rig.capabilities.force_currents[motor].stated
    v, u = zero.value, zero.standard_uncertainty
    fourth = u**4 * (0.5 if zero.distribution == "normal" else 0.2)  # variance of the square's half
    spread = Influence(f"capabilities/force_currents/{motor}/stated", f"zero of the encoder, {motor}: its cosine",
                       math.sqrt((v * u) ** 2 + fourth), "1", "B", "normal", source=zero.source)  # fmt: skip
    return Estimate.of(1 + (v * v + u * u) / 2, spread)


def electrical_turn(rig: RigFile, motor: str) -> Estimate:
    """Of a motor of `capabilities.force_currents`: m or rad of its loop's coordinate in a turn of its current's phase."""
    place = rig.capabilities.force_currents[motor].period
    number = Places(rig).known[place]
    stated = certified(place, number)
    return stated if number.unit == "m" else 2 * math.pi / stated


def phase_rate(rig: RigFile, motor: str) -> float:
    """How fast the phase of a motor's current goes with its loop's coordinate, rad a metre or radian."""
    return 2 * math.pi / electrical_turn(rig, motor).value


def periods_of(rig: RigFile, table: str, motors: Iterable[str]) -> tuple[str, ...]:
    """Names in a table of the rig file, such as `machine`, that tell how the phases of motors go."""
    known = (rig.capabilities.force_currents[motor].period.partition("/") for motor in motors)
    return tuple(dict.fromkeys(name for of, _, name in known if of == table))
