"""The angle between the counts of an encoder, from when it changes.

At full rate a reading that goes from n counts to n + 1 says that the angle is n + 1/2 counts there, within a tick. What it does
between two such edges is in course.py.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Edges:
    """`t` (m,) s and `y` (m,) rad of each edge, in time order; `count` rad."""

    t: Array
    y: Array
    count: float

    def since(self, start: float, way: float) -> Edges:
        """The same, angles from a start in one direction (1 or -1)."""
        return Edges(self.t, way * (self.y - start), self.count)

    def crossing(self, level: float) -> float:
        """When the angle first passes a level upwards, s; NaN where it never does."""
        above = np.flatnonzero(self.y >= level)
        if not len(above) or above[0] == 0:
            return float("nan")
        k = int(above[0])
        part = (level - self.y[k - 1]) / (self.y[k] - self.y[k - 1])
        return float(self.t[k - 1] + part * (self.t[k] - self.t[k - 1]))


def edges(t: Array, reading: Array, count: float) -> Edges:
    """Of readings (n,) rad at times `t` (n,) s. An edge came within the tick before it is seen; one that is passed by several
    counts at once is several edges."""
    steps = np.rint(np.diff(reading) / count).astype(int)
    at, half = np.flatnonzero(steps), (t[1] - t[0]) / 2
    times, angles = [], []
    for k in at:
        many, way = abs(int(steps[k])), np.sign(steps[k])
        times += [float(t[k] + (2 * j + 1) / many * half) for j in range(many)]
        angles += [float(reading[k] + way * (j + 0.5) * count) for j in range(many)]
    return Edges(np.array(times), np.round(np.array(angles) / (count / 2)) * (count / 2), count)
