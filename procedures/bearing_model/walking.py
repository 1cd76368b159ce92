"""From place to place: in one jump where there is room to swing, else in several.

A loop answers a jump of its set points by going past where it is sent. The magnets' negative stiffness K_x makes a jump of r
one of L = r K_i k_p / (K_i k_p - K_x) at first, which the integrator takes back slowly; a swing without damping goes to 2 L;
where two modes meet (a shaft that overhangs its bearings) it goes farther. Gains are not always told, so each jump is watched:
one is at most what the place it leads to leaves of the room, over SWING, or over the farthest that one has gone past so far.
The jumps on the way to a far place tell it, since the first of them have more room than they take.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from bench.procedure.rig import Rig
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from procedures.amb_rotor import lift
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.stations import COORDINATES
from procedures.bearing_model.grid import MARGIN, find_room
from procedures.bearing_model.inputs import as_printed
from procedures.bearing_model.plan import Plan
from procedures.shared import first_look

Array = npt.NDArray[np.float64]
SWING = 1.5  # jumps, past where one leads, of a loop that has not gone farther
FARTHER = 1.15  # times what was seen: farther out the magnets pull more steeply, and a jump adds to the swing before it
FARTHEST = 4.0  # jumps: a probe that seems to go farther does not follow its set points, which is looked at later
MOVED = 0.5  # of the farthest jump of a probe: what is less says little of how far a loop goes past
Place = Mapping[str, float]


def way(rig: RigFile, before: Place, after: Place, swing: float = SWING) -> Iterator[dict[str, float]]:
    """The places, by the coordinates of `after` (m, rad), from `before` to it, which is the last one. The stand of the thesis,
    whose loops are well damped, jumps."""
    count = 1 if as_printed(rig) else _parts(rig, before, after, swing)
    for k in range(1, count + 1):
        yield {c: before[c] + (after[c] - before[c]) * k / count for c in after}


@dataclass
class Walk:
    """Goes from place to place of a run, and knows how far the loop goes past one: `swing`, in jumps."""

    rig: Rig
    plan: Plan
    record: Recorder
    swing: float = field(default=SWING, init=False)

    def go(self, before: Place, after: Place, wait_s: float) -> Place:
        """There, with `wait_s` after the last jump; `after`."""
        at, places = before, list(way(self.rig.file, before, after, self.swing))
        while places:
            place = places.pop(0)
            lift.write(self.rig, conventions(self.rig.file).points(place))
            self._watch(at, place, self.plan.settle_s / 2 if places else wait_s)
            at = place
            smaller = list(way(self.rig.file, at, after, self.swing))
            places = smaller if places and len(smaller) > len(places) else places
        return after

    def _watch(self, before: Place, after: Place, seconds: float) -> None:
        """Wait, and see how far the probes go past."""
        seen = first_look.samples(self.rig, self.record, conventions(self.rig.file).stations.channels, seconds)
        jump, there = _seen(self.rig.file, before, after)
        moved = np.abs(jump) > MOVED * np.abs(jump).max()
        past = [float((np.sign(j) * (x - t)).max()) for j, t, x in zip(jump, there, seen.values(), strict=True)]
        if moved.any():
            farthest = FARTHER * float((np.array(past)[moved] / np.abs(jump[moved])).max())
            self.swing = max(self.swing, min(farthest, FARTHEST))


def _seen(rig: RigFile, before: Place, after: Place) -> tuple[Array, Array]:
    """What the probes see of a jump, and where it leads, m."""
    reads = conventions(rig).stations.reads
    jump, there = (
        reads @ [at.get(c, 0.0) for c in COORDINATES] for at in ({c: after[c] - before[c] for c in after}, after)
    )
    return jump, there


def _parts(rig: RigFile, before: Place, after: Place, swing: float) -> int:
    jump, there = map(np.abs, _seen(rig, before, after))
    left = np.maximum(find_room(rig) + MARGIN - there, MARGIN)
    return max(1, math.ceil(float(np.max(swing * jump / left)) - 1e-9))
