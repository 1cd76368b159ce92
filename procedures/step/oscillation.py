"""The oscillation after a step of the set point, from means over a telemetry period. All functions are pure.

The shaft's position and tilt share two oscillations that lie close together: where the bearings were alike they would be one.
Each alone is ill determined, in the machine as in its data; their mean, each with its part in the step as it begins, is not. It
is what the response shows, and damping ratio and natural frequency are those of this mean pole.

A mean over T of e^(p t) is (1 - e^(-p T))/(p T) times its value at the end of T: parts are freed of that.

What a slow integrator takes away is a straight line while the shaft swings. A fast one, with a time constant of less than
FAST_S, is no line: it is then fitted beside the oscillations, with its time constant, over as long as it takes (`fading_s`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
FROM_S = 3.5e-3  # from where filters and current loops have died away
UNTIL_S = 0.05  # about three periods of what levitates
SCALE = 100.0  # 1/s, of the search
GREATEST = 300.0  # exponent of a swing that grows: its square is still a number
APART = (1.0, 0.2), (1.06, 0.25)  # start of the search: frequencies over the guess, damping ratios
SLOW_HZ, FAST_HZ = 15.0, 250.0  # of what levitates: slower are integrators, faster filters
HARD = 0.95  # of damping: no oscillation
OF_ITS_OWN = 0.75  # of the pole that carries most: what lies farther from it is another oscillation
FAST_S, SHORT_S = 0.2, 0.012  # time constants of an integrator that is no straight line
LASTS = 3.0  # times its time constant that it is fitted
LATEST_S = 1.0  # until which it is looked for
TOGETHER = (
    0.05  # of a pole, by which a second oscillation may move the mean; beyond, it fits noise and what filters leave
)
ALIKE = 0.3  # of a pole: what the other one of a shaft in two bearings is off by
PLAIN, TOLD = 10.0, 5e-3  # over its standard uncertainty, and at the beginning as a share of the step, at least
ROWS, STATES = 12, 4  # of where the search begins: rows of a Hankel matrix, and its states


@dataclass(frozen=True)
class Swing:
    """Position as a share of the step: level + slope t + fades e^(-t/constant) + Re sum of parts e^(poles t), t s from the
    control's answer; `misfit` rms. Where nothing fades fast `constant` is 0."""

    poles: Complex
    parts: Complex
    level: float
    slope: float
    misfit: float
    fades: float = 0.0
    constant: float = 0.0

    @property
    def pole(self) -> complex:
        """The mean of the poles that oscillate as the one that carries most does, each with its part, 1/s; nan where none does.
        What else was fitted (slower than SLOW_HZ, faster than FAST_HZ, or hardly swinging) is an integrator or a filter."""
        size = np.abs(self.poles) / (2 * np.pi)
        swings = (size > SLOW_HZ) & (size < FAST_HZ) & (-self.poles.real < HARD * np.abs(self.poles))
        if not swings.any():
            return complex(np.nan)
        carried = np.abs(self.parts) ** 2 / np.maximum(-self.poles.real, 1 / UNTIL_S)
        lead = self.poles[int(np.argmax(np.where(swings, carried, -1.0)))]
        swings &= np.abs(self.poles - lead) < OF_ITS_OWN * np.abs(lead)
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
        return replace(self, parts=self.parts * np.exp(self.poles * by))

    def at(self, t: Array) -> Array:
        """The curve itself."""
        return np.asarray(self._slow(t) + (np.exp(np.outer(t, self.poles)) @ self.parts).real)

    def _slow(self, t: Array, shrunk: float = 1.0) -> Array:
        line = self.level + self.slope * t
        return line + self.fades * shrunk * np.exp(-t / self.constant) if self.constant else line

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


def swing(steps: Sequence[One], start: Swing | None = None) -> Swing:
    """Of many steps together. Two oscillations, or one where the tilt says nothing, and what fades fast where something does;
    what is linear in the model is eliminated (variable projection). `start`: a fit to nearly the same steps.

    Raises:
        AnalysisError: no oscillation fits.
    """
    constant = fading_s(steps) if start is None else start.constant
    if not constant:
        return _fitted(steps, None if start is None else start.poles, 0.0, 2)
    if start is not None:
        return _fitted(steps, start.poles, constant, len(start.poles), start.misfit)
    poles = _poles(steps)
    one = _fitted(steps, poles, constant, 1)
    both = _fitted(steps, one.poles[[0, 0]] * [1.0, APART[1][0]], one.constant, 2, one.misfit)
    return both if abs(both.pole - one.pole) < TOGETHER * abs(one.pole) else one


@dataclass(frozen=True)
class _Data:
    """Samples of all steps in one: times (n,), weights (n,), and what was seen times its weight (n, count); the time `constant`
    s of what fades fast, 0 where nothing does; the `noise` of a sample where the second pole is taken for one like the
    first."""

    t: Array
    weight: Array
    seen: Array
    constant: float
    noise: float

    def columns(self, x: Array) -> Array:
        """Of what is linear: a level, a line or what fades, and the oscillations of `x`."""
        many = 2 * self.seen.shape[1]
        growth = np.minimum(-SCALE * np.outer(self.t, x[0:many:2]), GREATEST)  # where a search has gone astray
        e = np.exp(growth + 1j * SCALE * np.outer(self.t, x[1:many:2]))
        slow = np.exp(-SCALE * x[-1] * self.t) if self.constant else self.t
        return np.asarray(np.column_stack([np.ones_like(self.t), slow, e.real, -e.imag]) * self.weight[:, None])

    def left(self, x: Array) -> Array:
        """What the best linear terms leave; of many rows by their squares."""
        a = self.columns(x)
        if not self.constant:
            return np.asarray((self.seen - a @ np.linalg.lstsq(a, self.seen, rcond=None)[0]).ravel())
        out = np.asarray((self.seen - a @ np.linalg.lstsq(a.T @ a, a.T @ self.seen, rcond=None)[0]).ravel())
        if self.noise == 0 or self.seen.shape[1] == 1:
            return out
        return np.append(out, self.noise * (x[2:4] - x[0:2]) / (ALIKE * np.hypot(x[0], x[1])))


def _data(steps: Sequence[One], constant: float, most: int, noise: float) -> _Data:
    until = max(UNTIL_S, LASTS * constant)
    near = [(s.t > FROM_S) & (s.t < until) for s in steps]
    t = np.concatenate([s.t[m] for s, m in zip(steps, near, strict=True)])
    data = np.concatenate([s.weight * s.both[:, m] for s, m in zip(steps, near, strict=True)], axis=1).T
    weight = np.concatenate([np.full(int(m.sum()), s.weight) for s, m in zip(steps, near, strict=True)])
    count = 2 if most > 1 and np.any(data[:, 1]) else 1
    return _Data(t, weight, data[:, :count], constant, noise * float(np.sqrt(np.mean(weight**2))))


def _fitted(steps: Sequence[One], start: Complex | None, constant: float, most: int, noise: float = 0.0) -> Swing:
    """With up to `most` oscillations. The second one may hardly show; where the `noise` of a sample is given, it is taken for
    one that is like the first, give or take ALIKE of it, as far as the data do not say otherwise."""
    from scipy import optimize

    data = _data(steps, constant, most, noise)
    count = data.seen.shape[1]
    guess = _guess(steps[0]) / SCALE
    first = start[:count] / SCALE if start is not None and len(start) >= count else np.array(
        [guess * f * (-z + 1j) for f, z in APART[:count]]
    )  # fmt: skip
    x0 = np.column_stack([-first.real, first.imag]).ravel()
    if constant:
        x0 = np.append(x0, 1 / constant / SCALE)
    try:
        found = optimize.least_squares(data.left, x0, x_scale=0.1, method="lm", max_nfev=300)
        terms = np.linalg.lstsq(data.columns(found.x), data.seen[:, 0], rcond=None)[0]
    except (ValueError, np.linalg.LinAlgError) as error:
        raise AnalysisError(f"no oscillation fits the response: {error}") from error
    out = _swing_of(found.x, np.asarray(terms, np.float64), count, float(steps[0].t[1] - steps[0].t[0]), bool(constant))
    out = replace(out, misfit=float(np.sqrt(np.mean(found.fun**2) / np.mean(data.weight**2))))
    if not (np.isfinite(out.pole) and 0 < out.damping < HARD and out.pole.imag > 0 and out.constant >= 0):
        raise AnalysisError("no oscillation that dies away fits the response")
    return out


def _swing_of(x: Array, terms: Array, count: int, period: float, fading: bool) -> Swing:
    """Of what was found, freed of the means over a period."""
    poles: Complex = np.asarray(SCALE * (-x[0 : 2 * count : 2] + 1j * x[1 : 2 * count : 2]), np.complex128)
    parts = (terms[2 : 2 + count] + 1j * terms[2 + count :]) / shrinks(poles, period)
    turned = poles.imag < 0
    poles[turned], parts[turned] = poles[turned].conj(), parts[turned].conj()
    if fading:
        rate = SCALE * float(x[-1])
        fades = float(terms[1]) / float(shrinks(np.array([-rate + 0j]), period)[0].real)
        return Swing(poles, parts, float(terms[0]), 0.0, 0.0, fades, 1 / rate)
    return Swing(poles, parts, float(terms[0] + terms[1] * period / 2), float(terms[1]), 0.0)


def fading_s(steps: Sequence[One]) -> float:
    """Time constant, s, of what fades after the swing, where it is shorter than FAST_S and plain beside the noise; 0 where it
    is not, and a straight line does."""
    t, y = _mean(steps, UNTIL_S, LATEST_S)
    if len(t) < 20:
        return 0.0
    constants = np.geomspace(SHORT_S, 10 * FAST_S, 80)
    fits = [np.linalg.lstsq(np.column_stack([np.ones_like(t), np.exp(-t / c)]), y[0], rcond=None) for c in constants]
    left = np.array(
        [float(((y[0] - f[0][0] - f[0][1] * np.exp(-t / c)) ** 2).sum()) for f, c in zip(fits, constants, strict=True)]
    )
    k = int(left.argmin())
    explained = float(((y[0] - y[0].mean()) ** 2).sum()) - left[k]
    plain = explained > PLAIN**2 * left[k] / (len(t) - 3) and abs(float(fits[k][0][1])) > TOLD
    return float(constants[k]) if plain and k > 0 and constants[k] < FAST_S else 0.0


def _mean(steps: Sequence[One], since: float, until: float) -> tuple[Array, Array]:
    """Times (n,) and mean of position and tilt (2, n) by their weights, as long as every step has samples."""
    near = [np.flatnonzero((s.t > since) & (s.t < until)) for s in steps]
    many = min(map(len, near))
    weights = np.array([s.weight**2 for s in steps])
    both = np.average([s.both[:, k[:many]] for s, k in zip(steps, near, strict=True)], axis=0, weights=weights)
    return np.average([s.t[k[:many]] for s, k in zip(steps, near, strict=True)], axis=0, weights=weights), both


def _poles(steps: Sequence[One]) -> Complex | None:
    """Where the search begins beside something that fades: of the mean response's realisation (Juang and Pappa, 1985) with a
    level, what fades and one oscillation. None where that has none."""
    t, both = _mean(steps, FROM_S, UNTIL_S)
    period = float(t[1] - t[0])
    y, columns = both, both.shape[1] - ROWS
    if columns < 2 * STATES:
        return None
    hankel = np.concatenate([y[:, k : k + columns] for k in range(ROWS)])
    u, size, v = np.linalg.svd(hankel[:, :-1], full_matrices=False)
    root = np.sqrt(size[:STATES])
    values = np.linalg.eigvals((u[:, :STATES].T @ hankel[:, 1:] @ v[:STATES].T) / np.outer(root, root))
    found = np.log(np.where(values == 0, 1e-9, values).astype(complex)) / period
    parts = np.linalg.lstsq(np.exp(np.outer(t - t[0], found)), y[0].astype(complex), rcond=None)[0]
    size = np.abs(found) / (2 * np.pi)
    swings = (found.imag > 0) & (size > SLOW_HZ) & (size < FAST_HZ) & (-found.real < HARD * np.abs(found))
    if not swings.any():
        return None
    one = complex(found[np.argmax(np.where(swings, np.abs(parts), 0.0))])
    return np.array([one * f for f, _ in APART])


def _guess(step: One) -> float:
    """Angular frequency, roughly, from the first peak to the trough after it."""
    near = (step.t > FROM_S / 2) & (step.t < UNTIL_S)
    t, y = step.t[near], step.both[0, near]
    top = int(np.argmax(y))
    rest = y[top:]
    trough = int(np.argmin(rest[: max(len(rest) // 2, 2)]))
    half = (t[top + trough] - t[top]) if trough else 0.008
    return float(np.pi / max(half, 2e-3))
