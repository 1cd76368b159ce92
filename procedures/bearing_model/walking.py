"""From place to place: in one jump where there is room to swing, else in several.

A loop answers a jump of its set points by going past where it is sent: by the jump itself where a mode has no damping, and by
more where two modes meet (a shaft that overhangs its bearings: 1.2 jumps). So a jump is at most what the place it leads to
leaves of the room, over SWING.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from bench.procedure.rig import Rig
from bench.rigfile import RigFile
from procedures.amb_rotor import lift
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.stations import COORDINATES
from procedures.bearing_model.grid import MARGIN, find_room
from procedures.bearing_model.inputs import as_printed
from procedures.bearing_model.plan import Plan

SWING = 1.5  # jumps, past where one leads
Place = Mapping[str, float]


def way(rig: RigFile, before: Place, after: Place) -> Iterator[dict[str, float]]:
    """The places, by the coordinates of `after` (m, rad), from `before` to it, which is the last one. The stand of the thesis,
    whose loops are well damped, jumps."""
    count = 1 if as_printed(rig) else _parts(rig, before, after)
    for k in range(1, count + 1):
        yield {c: before[c] + (after[c] - before[c]) * k / count for c in after}


def go(rig: Rig, plan: Plan, before: Place, after: Place) -> Place:
    """Write them, the last one without a wait after it; `after`."""
    machine = conventions(rig.file)
    for k, place in enumerate(way(rig.file, before, after)):
        if k:
            rig.clock.sleep(plan.settle_s / 2)
        lift.write(rig, machine.points(place))
    return after


def _parts(rig: RigFile, before: Place, after: Place) -> int:
    reads = conventions(rig).stations.reads
    jump, there = (np.abs(reads @ [at.get(c, 0.0) for c in COORDINATES])
                   for at in ({c: after[c] - before[c] for c in after}, after))  # fmt: skip
    left = np.maximum(find_room(rig) + MARGIN - there, MARGIN)
    return max(1, math.ceil(float(np.max(SWING * jump / left)) - 1e-9))
