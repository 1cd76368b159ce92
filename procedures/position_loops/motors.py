"""Motors that a position loop drives: how the phase of their currents goes with what the loop holds."""

from __future__ import annotations

import math
from collections.abc import Iterable

from bench.rigfile import RigFile
from bench.rigfile.places import Places
from bench.uncertainty import Estimate
from procedures.shared.certificates import certified


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
