"""The oscillation after a step of the set point, as a model. All functions are pure.

The shaft's position and tilt share two oscillations that lie close together: where the bearings were alike they would be one.
Each alone is ill determined, in the machine as in its data; their mean, each with its part in the step as it begins, is not. It
is what the response shows, and damping ratio and natural frequency are those of this mean pole. Where they lie far apart, as
on a shaft whose centre of mass is beyond a bearing, they are two and not one: the mean is then that of the one that carries
most, by the integral of its square, |c|²/(-2 Re p), with those that are less than three quarters of it away.

A mean over T of e^(p t) is (1 - e^(-p T))/(p T) times its value at the end of T: parts are freed of that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
FROM_S = 3.5e-3  # from where filters and current loops have died away
UNTIL_S = 0.05  # about three periods of what levitates
SLOW_HZ, FAST_HZ = 15.0, 250.0  # of what levitates: slower are integrators, faster filters
HARD = 0.95  # of damping: no oscillation
OF_ITS_OWN = 0.75  # of the pole that carries most: what lies farther from it is another oscillation


@dataclass(frozen=True)
class Swing:
    """Position as a share of the step: level + slope t + (fades + apart (t/constant)²) e^(-t/constant) + Re sum of parts
    e^(poles t), t s from the control's answer; `misfit` rms. Where nothing fades fast `constant` is 0; `unlike`: two things
    fade with constants that are not alike, hence `apart`. `found`: where a search for nearly the same begins; `doubts`: what it
    would be, were what was taken for granted of a second oscillation off by its standard uncertainty, one thing after the other
    (`coupled`); None where that cannot be told."""

    poles: Complex
    parts: Complex
    level: float
    slope: float
    misfit: float
    fades: float = 0.0
    constant: float = 0.0
    apart: float = 0.0
    unlike: bool = False
    found: tuple[float, ...] = ()
    doubts: tuple[Swing, ...] | None = ()

    @property
    def pole(self) -> complex:
        """The mean of the poles that oscillate as the one that carries most does, each with its part, 1/s; nan where none does.
        What else was fitted (slower than SLOW_HZ, faster than FAST_HZ, or hardly swinging) is an integrator or a filter."""
        swings = self._swings
        if not swings.any():
            return complex(np.nan)
        lead = self._lead(swings)
        swings &= np.abs(self.poles - lead) < OF_ITS_OWN * np.abs(lead)
        whole = self.parts[swings].sum()
        return complex((self.parts * self.poles)[swings].sum() / whole) if whole else complex(np.nan)

    @property
    def lasting(self) -> float:
        """Greatest time constant of what oscillates, s; 0 where nothing does, or does not die away."""
        fading = -self.poles.real[self._swings]
        return float(1 / fading.min()) if len(fading) and fading.min() > 0 else 0.0

    @property
    def _swings(self) -> npt.NDArray[np.bool_]:
        size = np.abs(self.poles) / (2 * np.pi)
        return (size > SLOW_HZ) & (size < FAST_HZ) & (-self.poles.real < HARD * np.abs(self.poles))

    def _lead(self, of: npt.NDArray[np.bool_]) -> complex:
        """The pole among them that carries most."""
        carried = np.abs(self.parts) ** 2 / np.maximum(-self.poles.real, 1 / UNTIL_S)
        return complex(self.poles[int(np.argmax(np.where(of, carried, -1.0)))])

    @property
    def torn(self) -> float:
        """By how much of itself the pole that carries most is moved by a mean with those nearer than OF_ITS_OWN of the greater,
        be they hardly swinging."""
        lead = self._lead(np.ones(len(self.poles), bool))
        near = np.abs(self.poles - lead) < OF_ITS_OWN * np.maximum(np.abs(self.poles), abs(lead))
        mean = (self.parts * self.poles)[near].sum() / self.parts[near].sum()
        return float(abs(mean - lead) / abs(lead))

    @property
    def damping(self) -> float:
        """Damping ratio of the mean pole."""
        return -self.pole.real / abs(self.pole)

    @property
    def frequency(self) -> float:
        """Natural frequency of the mean pole, Hz."""
        return float(abs(self.pole) / (2 * np.pi))

    @property
    def dies_away(self) -> bool:
        """Whether there is an oscillation, and it does."""
        return bool(np.isfinite(self.pole) and 0 < self.damping < HARD and self.pole.imag > 0 and self.constant >= 0)

    def later(self, by: float) -> Swing:
        """The same with its parts as of `by` s later."""
        return replace(self, parts=self.parts * np.exp(self.poles * by))

    def at(self, t: Array) -> Array:
        """The curve itself."""
        return np.asarray(self._slow(t) + (np.exp(np.outer(t, self.poles)) @ self.parts).real)

    def _slow(self, t: Array, shrunk: float = 1.0) -> Array:
        line = self.level + self.slope * t
        if not self.constant:
            return line
        late = t / self.constant
        return np.asarray(line + (self.fades + self.apart * late**2) * shrunk * np.exp(-late))

    def means(self, t: Array, period: float) -> Array:
        """Means over the period before t; beyond what was fitted (where one of the two may even grow) with the mean pole."""
        parts = self.parts * shrinks(self.poles, period)
        swung = np.exp(np.outer(np.minimum(t, UNTIL_S), self.poles)) @ parts
        swung *= np.exp(self.pole * np.maximum(t - UNTIL_S, 0.0))
        if self.constant:
            shrunk = float(shrinks(np.array([-1 / self.constant + 0j]), period)[0].real)
            return np.asarray(self._slow(t, shrunk) + swung.real)
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


def guess(step: One) -> float:
    """Angular frequency, roughly, from the first peak to the trough after it."""
    near = (step.t > FROM_S / 2) & (step.t < UNTIL_S)
    t, y = step.t[near], step.both[0, near]
    top = int(np.argmax(y))
    rest = y[top:]
    trough = int(np.argmin(rest[: max(len(rest) // 2, 2)]))
    half = (t[top + trough] - t[top]) if trough else 0.008
    return float(np.pi / max(half, 2e-3))
