"""The course of the angle between the edges of its encoder, by the torque current that was measured meanwhile.

An encoder that changes its count makes the derivative kick: between two edges the angle is no parabola, and no polynomial that
is drawn through edges knows of it. A rotor that turns freely follows its torque,

    theta'' = gain i_theta - drag theta' - friction sign(theta') + load,

so that theta = a + b t + load t^2/2 + gain (integral of i_theta, twice) - drag (integral of theta) - friction (integral of the
sign, twice), of which the edges give the six numbers; what they say besides (a detent, ripple, eddy currents) is smooth, and a
spline that is as stiff as their ticks allow has it. Friction is not smooth, it turns round where the angle does: without it the
turning points of 2 degrees were read 0.005 of a count too low on every machine, both ways.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from procedures.angle_step.edges import Edges

Array = npt.NDArray[np.float64]
LEAST = 12  # edges that six numbers are read from; a line from edge to edge does where there are fewer
AWAY = 1.5  # counts off where it ends: the angle still swings
HALF_SWING = 5.0  # rise times; the last swing may leave its band after the last edge that is away
BLUR = 0.003  # of a count: where an edge is, besides its tick
PASSES = 2  # of weights, by speeds that the pass before has found
STIFF = 0.85  # of the spread that ticks give: the trembling at the end has less, and would leave it to the swings


@dataclass(frozen=True)
class Course:
    """The angle `y` (n,) rad at times `t` (n,) s, from where it began and in the step's direction; `gain`, rad/(A s^2), of the
    torque current, NaN where there are too few edges to tell."""

    t: Array
    y: Array
    gain: float

    @property
    def top(self) -> float:
        """The greatest angle, rad."""
        k = int(np.argmax(self.y))
        if not 0 < k < len(self.y) - 1:
            return float(self.y[k])
        before, at, after = (float(v) for v in self.y[k - 1 : k + 2])
        bend = before - 2 * at + after
        return at - (after - before) ** 2 / (8 * bend) if bend < 0 else at

    def crossing(self, level: float) -> float:
        """When the angle first passes a level upwards, s; NaN where it never does."""
        above = np.flatnonzero(self.y >= level)
        if not len(above) or above[0] == 0:
            return float("nan")
        k = int(above[0])
        part = (level - self.y[k - 1]) / (self.y[k] - self.y[k - 1])
        return float(self.t[k - 1] + part * (self.t[k] - self.t[k - 1]))

    def unsure(self, between: float, count: float) -> float:
        """What a turning point is off, rad, where `between` counts are what edges enough leave open. A line from edge to edge
        is up to a count short of it."""
        return between * count if np.isfinite(self.gain) else count / np.sqrt(3)

    def last_outside(self, target: float, band: float) -> float:
        """When the angle is last outside a band about a target, s; 0 where it never is."""
        size = np.abs(self.y - target)
        beyond = np.flatnonzero(size > band)
        if not len(beyond):
            return 0.0
        k = int(beyond[-1])
        if k + 1 == len(size):
            return float(self.t[k])
        part = (size[k] - band) / (size[k] - size[k + 1])
        return float(self.t[k] + part * (self.t[k + 1] - self.t[k]))


def course(found: Edges, t: Array, told: Array, torque: Array, begins: int, stiff: float = STIFF) -> Course:
    """Of edges (in the step's direction, from where it began), and at times (n,) s in that direction too: the angle that is
    `told`, rad, of which it is off half a count at most, and the torque current, A, which answers at tick `begins`.
    `stiff`: the share of the edges' spread that their times give."""
    straight = np.interp(t, found.t, found.y) if len(found.t) else np.zeros_like(t)
    least, most = told - found.count / 2, told + found.count / 2
    part = _swinging(found, float(t[begins]))
    at, y = found.t[part], found.y[part]
    if len(at) < LEAST:
        return Course(t, np.clip(straight, least, most), float("nan"))
    since = t - t[begins]
    shapes = np.array([np.ones_like(t), since, since**2 / 2, _summed(_summed(torque, t), t), _summed(straight, t)])
    blur, rubs = np.full(len(at), found.count), np.zeros_like(t)
    for _ in range(1 + PASSES):
        known = np.array([*shapes, rubs])
        here = np.array([np.interp(at, t, shape) for shape in known]).T
        numbers = np.linalg.lstsq(here / blur[:, None], y / blur, rcond=None)[0]
        model = numbers @ known
        rate = np.gradient(model, t)
        blur = np.hypot(np.interp(at, t, rate) * (t[1] - t[0]) / np.sqrt(12), BLUR * found.count)
        rubs = _summed(_summed(np.sign(rate), t), t)
    within = (t >= at[0]) & (t <= at[-1])
    angle = np.where(within, model + _stiff(at, y - here @ numbers, blur, t, stiff), straight)
    return Course(t, np.clip(angle, least, most), float(numbers[3]))


def _stiff(at: Array, left: Array, blur: Array, t: Array, stiff: float) -> Array:
    """The stiffest spline that goes by what is left at the edges within their blur, at times `t`."""
    from scipy import interpolate

    spline = interpolate.UnivariateSpline(at, left, w=1 / blur, k=3, s=stiff * len(at))
    out: Array = spline(np.clip(t, at[0], at[-1]))
    return out


def _swinging(found: Edges, begins: float) -> slice:
    """The edges from the answer until half a swing after the angle was last away from where it ends: later it only trembles at
    an edge, and would outweigh the swings."""
    if not len(found.t):
        return slice(0)
    away = np.flatnonzero(np.abs(found.y - found.y[-1]) > AWAY * found.count)
    rise = found.crossing(0.9 * found.y[-1]) - found.crossing(0.1 * found.y[-1])
    last = float(found.t[away[-1]]) if len(away) else begins
    end = last + (HALF_SWING * rise if np.isfinite(rise) else 0.0)
    return slice(int(np.searchsorted(found.t, begins - 1e-3)), int(np.searchsorted(found.t, end)))


def _summed(x: Array, t: Array) -> Array:
    """The integral of x from the first time on."""
    return np.concatenate([[0.0], np.cumsum((x[1:] + x[:-1]) / 2 * np.diff(t))])
