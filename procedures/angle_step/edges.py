"""The angle between the counts of an encoder, from when it changes.

At full rate a reading that goes from n counts to n + 1 says that the angle is n + 1/2 counts there, within a tick. Between two
such edges the angle is interpolated; about a turning point, where the same edge is passed twice, by a polynomial.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
TOP = 6  # edges on either side of a turning point that make its polynomial


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

    def turning(self) -> list[tuple[float, float]]:
        """Time and height of each turning point, in time order."""
        same = np.flatnonzero(np.diff(self.y) == 0)
        return [self._top(int(k)) for k in same]

    def _top(self, k: int) -> tuple[float, float]:
        """Between edges k and k + 1, which are at one angle: by a polynomial of the fifth degree about six edges before and six
        after. A swing that is damped leans, and where a step has few counts a cubic is 0.02 of one too low."""
        around = slice(max(k - TOP + 1, 0), k + 1 + TOP)
        middle, half = float(self.t[k] + self.t[k + 1]) / 2, float(self.t[k + 1] - self.t[k]) / 2
        t, y = (self.t[around] - middle) / half, self.y[around] - self.y[k]
        near = np.abs(y) <= (TOP - 0.5) * self.count
        way = 1.0 if k == 0 or self.y[k] >= self.y[k - 1] else -1.0
        if near.sum() < 3 or np.ptp(y[near]) == 0:
            return middle, float(self.y[k])
        fit = np.polynomial.Polynomial.fit(t[near], y[near], min(5, int(near.sum()) - 1))
        beyond = float((way * fit(np.linspace(-1.0, 1.0, 101))).max())
        return middle, float(self.y[k] + way * np.clip(beyond, 0.0, self.count))

    def last_outside(self, target: float, band: float) -> float:
        """When the angle is last outside a band about a target, s; 0 where it never is."""
        size = np.abs(self.y - target)
        last = max((self._back(int(k), target, band) for k in np.flatnonzero(np.diff(self.y) == 0)), default=0.0)
        beyond = np.flatnonzero(size > band)
        if not len(beyond):
            return last
        k = int(beyond[-1])
        if k + 1 < len(self.t):
            part = (size[k] - band) / (size[k] - size[k + 1])
            return max(last, float(self.t[k] + part * (self.t[k + 1] - self.t[k])))
        return max(last, float(self.t[k]))

    def _back(self, k: int, target: float, band: float) -> float:
        """When the swing that turns between edges k and k + 1 comes back into the band, where it leaves it only between them; a
        parabola about its end."""
        (at, top), edge = self._top(k), abs(float(self.y[k]) - target)
        height = abs(top - target)
        if not height > band >= edge:
            return 0.0
        return at + float(self.t[k + 1] - at) * float(np.sqrt((height - band) / (height - edge)))


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
