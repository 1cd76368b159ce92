"""Does the reference run at the frequency that was told? Whether the rotor's phase stays where it is, judged by its scatter.

The phase of the reference counts from its start. One that runs at f (1 + e) is ahead of what is taken for it by e (t - t_0) in
time, so that the delay of each revolution, in y and z alike, falls by e t. Sensor noise moves the delay of an axis by what goes
with one over its amplitude times its frequency; with these weights one line of slope -e, with an offset of its own for each
axis, is fitted to the delays of both. Its slope over its standard uncertainty is Student's t with 2 m - 3 degrees of freedom
for m revolutions where the frequency is right.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from procedures.amb_rotor.geometry import Facts
from procedures.shared.leastsquares import linear
from procedures.tracking.ellipse import Path, followed

Array = npt.NDArray[np.float64]
FALSE_ALARM = 1e-4  # of a sound orbit, two-sided


@dataclass(frozen=True)
class Drift:
    """The frequency's relative error `off` with its standard uncertainty `u` of `dof`, and what it has made of the reference's
    time since its start until the orbit's end, s."""

    off: float
    u: float
    dof: int
    ahead_s: float

    @property
    def plain(self) -> bool:
        """Whether scatter explains it less often than FALSE_ALARM."""
        from scipy.special import stdtrit

        return abs(self.off) > float(stdtrit(self.dof, 1 - FALSE_ALARM / 2)) * self.u


def drift(path: Path, facts: Facts) -> Drift | None:
    """Of an orbit, with what was recorded before it; nothing where it has too few revolutions."""
    try:
        at, follows = followed(path, facts)
    except AnalysisError:
        return None
    hz, size, _ = np.array(path.wave.axes).T
    delays = -np.angle(follows / follows.mean(axis=0)) / (2 * math.pi * hz)
    return line(at - facts.t_0, delays, size * hz, float(path.t[-1]) - facts.t_0)


def line(t: Array, delays: Array, weights: Array, until: float) -> Drift:
    """Of `delays` (m, k) s at `t` (m,) s since the start, with `weights` (k,) of the axes."""
    m, k = delays.shape
    columns = np.zeros((m, k, k + 1))
    for axis, weight in enumerate(weights / weights.max()):
        columns[:, axis, axis] = weight
        columns[:, axis, k] = -weight * (t - t.mean())
    fit = linear(columns.reshape(m * k, k + 1), (delays * weights / weights.max()).ravel())
    off = float(fit.terms[k])
    return Drift(off, math.sqrt(float(fit.covariance[k, k])), m * k - k - 1, off * until)
