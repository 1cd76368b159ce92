"""The oscillation after a step of the set point, from means over a telemetry period. All functions are pure.

The shaft's position and tilt share two oscillations that lie close together: where the bearings were alike they would be one.
Each alone is ill determined, in the machine as in its data; their mean, each with its part in the step as it begins, is not. It
is what the response shows, and damping ratio and natural frequency are those of this mean pole.

A mean over T of e^(p t) is (1 - e^(-p T))/(p T) times its value at the end of T: parts are freed of that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
FROM_S, UNTIL_S = (
    3.5e-3,
    0.05,
)  # from where filters and current loops have died away; about three periods of what levitates
SCALE = 100.0  # 1/s, of the search
APART = (1.0, 0.2), (1.06, 0.25)  # start of the search: frequencies over the guess, damping ratios
SLOW_HZ, FAST_HZ = 15.0, 250.0  # of what levitates: slower are integrators, faster filters
HARD = 0.95  # of damping: no oscillation


@dataclass(frozen=True)
class Swing:
    """Position as a share of the step: level + slope t + Re sum of parts e^(poles t), t s from the control's answer; `misfit`
    rms."""

    poles: Complex
    parts: Complex
    level: float
    slope: float
    misfit: float

    @property
    def pole(self) -> complex:
        """The mean of the poles that oscillate, each with its part, 1/s; nan where none does. What else was fitted (slower than
        SLOW_HZ, faster than FAST_HZ, or hardly swinging) is an integrator or a filter."""
        size = np.abs(self.poles) / (2 * np.pi)
        swings = (size > SLOW_HZ) & (size < FAST_HZ) & (-self.poles.real < HARD * np.abs(self.poles))
        whole = self.parts[swings].sum()
        return complex((self.parts * self.poles)[swings].sum() / whole) if whole else complex(np.nan)

    @property
    def damping(self) -> float:
        """Damping ratio of the mean pole."""
        return -self.pole.real / abs(self.pole)

    @property
    def frequency(self) -> float:
        """Natural frequency of the mean pole, Hz."""
        return float(abs(self.pole) / (2 * np.pi))

    def later(self, by: float) -> Swing:
        """The same with its parts as of `by` s later."""
        return Swing(self.poles, self.parts * np.exp(self.poles * by), self.level, self.slope, self.misfit)

    def at(self, t: Array) -> Array:
        """The curve itself."""
        return np.asarray(self.level + self.slope * t + (np.exp(np.outer(t, self.poles)) @ self.parts).real)

    def means(self, t: Array, period: float) -> Array:
        """Means over the period before t; beyond what was fitted (where one of the two may even grow) with the mean pole."""
        parts = self.parts * shrinks(self.poles, period)
        swung = np.exp(np.outer(np.minimum(t, UNTIL_S), self.poles)) @ parts
        swung *= np.exp(self.pole * np.maximum(t - UNTIL_S, 0.0))
        return np.asarray(self.level + self.slope * (t - period / 2) + swung.real)

    @property
    def peak(self) -> float:
        """Greatest value after FROM_S."""
        return float(self.at(np.arange(FROM_S, UNTIL_S, 2e-5)).max())


@dataclass(frozen=True)
class One:
    """One step: `t` s from the control's answer (n,), position and tilt (2, n) as shares of it, how much it weighs, and from
    which set point it began, m."""

    t: Array
    both: Array
    weight: float = 1.0
    begin: float = 0.0


def shrinks(poles: Complex, period: float) -> Complex:
    """What a mean over a period makes of e^(p t), over its value at the end."""
    return np.asarray((1 - np.exp(-poles * period)) / (poles * period))


def swing(steps: Sequence[One], start: Complex | None = None) -> Swing:
    """Of many steps together. Two oscillations, or one where the tilt says nothing; what is linear in the model is eliminated
    (variable projection).

    Raises:
        AnalysisError: no oscillation fits.
    """
    from scipy import optimize

    near = [(s.t > FROM_S) & (s.t < UNTIL_S) for s in steps]
    t = np.concatenate([s.t[m] for s, m in zip(steps, near, strict=True)])
    data = np.concatenate([s.weight * s.both[:, m] for s, m in zip(steps, near, strict=True)], axis=1).T
    weight = np.concatenate([np.full(int(m.sum()), s.weight) for s, m in zip(steps, near, strict=True)])
    count = 2 if np.any(data[:, 1]) else 1
    data = data[:, :count]

    def columns(x: Array) -> Array:
        e = np.exp(SCALE * np.outer(t, -x[0::2] + 1j * x[1::2]))
        return np.asarray(np.column_stack([np.ones_like(t), t, e.real, -e.imag]) * weight[:, None])

    def left(x: Array) -> Array:
        a = columns(x)
        return np.asarray((data - a @ np.linalg.lstsq(a, data, rcond=None)[0]).ravel())

    guess = _guess(steps[0]) / SCALE
    first = start[:count] / SCALE if start is not None and len(start) >= count else np.array(
        [guess * f * (-z + 1j) for f, z in APART[:count]]
    )  # fmt: skip
    x0 = np.column_stack([-first.real, first.imag]).ravel()
    try:
        found = optimize.least_squares(left, x0, x_scale=0.1, method="lm", max_nfev=300)
        terms = np.linalg.lstsq(columns(found.x), data[:, 0], rcond=None)[0]
    except (ValueError, np.linalg.LinAlgError) as error:
        raise AnalysisError(f"no oscillation fits the response: {error}") from error
    poles = SCALE * (-found.x[0::2] + 1j * found.x[1::2])
    period = float(steps[0].t[1] - steps[0].t[0])
    parts = (terms[2 : 2 + count] + 1j * terms[2 + count :]) / shrinks(poles, period)
    turned = poles.imag < 0
    poles[turned], parts[turned] = poles[turned].conj(), parts[turned].conj()
    out = Swing(poles, parts, float(terms[0] + terms[1] * period / 2), float(terms[1]),
                float(np.sqrt(np.mean(found.fun**2) / np.mean(weight**2))))  # fmt: skip
    if not (np.isfinite(out.pole) and 0 < out.damping < HARD and out.pole.imag > 0):
        raise AnalysisError("no oscillation that dies away fits the response")
    return out


def _guess(step: One) -> float:
    """Angular frequency, roughly, from the first peak to the trough after it."""
    near = (step.t > FROM_S / 2) & (step.t < UNTIL_S)
    t, y = step.t[near], step.both[0, near]
    top = int(np.argmax(y))
    rest = y[top:]
    trough = int(np.argmin(rest[: max(len(rest) // 2, 2)]))
    half = (t[top + trough] - t[top]) if trough else 0.008
    return float(np.pi / max(half, 2e-3))
