"""The swing of many steps, fitted to means over a telemetry period: two oscillations beside a straight line, or beside what a
fast integrator leaves (`coupled`). All functions are pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bench.errors import AnalysisError
from procedures.step import coupled
from procedures.step.coupled import ANY, Tilting
from procedures.step.fading import fading_s
from procedures.step.oscillation import FROM_S, UNTIL_S, Array, Complex, One, Swing, guess, shrinks

SCALE = 100.0  # 1/s, of the search
GREATEST = 300.0  # exponent of a swing that grows: its square is still a number
APART = (1.0, 0.2), (1.06, 0.25)  # start of the search: frequencies over the guess, damping ratios


def swing(steps: Sequence[One], start: Swing | None = None, tilting: Tilting = ANY) -> Swing:
    """`shape` of steps that swing.

    Raises:
        AnalysisError: no oscillation fits, or it does not die away.
    """
    out = shape(steps, start, tilting)
    if not out.dies_away:
        raise AnalysisError("no oscillation that dies away fits the response")
    return out


def shape(steps: Sequence[One], start: Swing | None = None, tilting: Tilting = ANY) -> Swing:
    """Of many steps together. Two oscillations, or one where the tilt says nothing, and what fades fast where something does;
    what is linear in the model is eliminated (variable projection). `start`: a fit to nearly the same steps; `tilting`: what is
    known of the shaft's. Where nothing swings it is what fits best, whatever that is.

    Raises:
        AnalysisError: the search goes astray.
    """
    constant = fading_s(steps) if start is None else start.constant
    return coupled.fitted(steps, constant, start, tilting) if constant else _fitted(steps, start)


@dataclass(frozen=True)
class _Data:
    """Samples of all steps in one: times (n,), weights (n,), and what was seen times its weight (n, count)."""

    t: Array
    weight: Array
    seen: Array

    def columns(self, x: Array) -> Array:
        """Of what is linear: a level, a line, and the oscillations of `x`."""
        many = 2 * self.seen.shape[1]
        growth = np.minimum(-SCALE * np.outer(self.t, x[0:many:2]), GREATEST)  # where a search has gone astray
        e = np.exp(growth + 1j * SCALE * np.outer(self.t, x[1:many:2]))
        return np.asarray(np.column_stack([np.ones_like(self.t), self.t, e.real, -e.imag]) * self.weight[:, None])

    def left(self, x: Array) -> Array:
        """What the best linear terms leave."""
        a = self.columns(x)
        return np.asarray((self.seen - a @ np.linalg.lstsq(a, self.seen, rcond=None)[0]).ravel())


def _data(steps: Sequence[One]) -> _Data:
    near = [(s.t > FROM_S) & (s.t < UNTIL_S) for s in steps]
    t = np.concatenate([s.t[m] for s, m in zip(steps, near, strict=True)])
    data = np.concatenate([s.weight * s.both[:, m] for s, m in zip(steps, near, strict=True)], axis=1).T
    weight = np.concatenate([np.full(int(m.sum()), s.weight) for s, m in zip(steps, near, strict=True)])
    return _Data(t, weight, data[:, : 2 if np.any(data[:, 1]) else 1])


def _fitted(steps: Sequence[One], start: Swing | None) -> Swing:
    """With a straight line."""
    from scipy import optimize

    data = _data(steps)
    count = data.seen.shape[1]
    about = guess(steps[0]) / SCALE
    first = start.poles[:count] / SCALE if start is not None and len(start.poles) >= count else np.array(
        [about * f * (-z + 1j) for f, z in APART[:count]]
    )  # fmt: skip
    x0 = np.column_stack([-first.real, first.imag]).ravel()
    try:
        found = optimize.least_squares(data.left, x0, x_scale=0.1, method="lm", max_nfev=300)
        terms = np.linalg.lstsq(data.columns(found.x), data.seen[:, 0], rcond=None)[0]
    except (ValueError, np.linalg.LinAlgError) as error:
        raise AnalysisError(f"no oscillation fits the response: {error}") from error
    out = _swing_of(found.x, np.asarray(terms, np.float64), count, float(steps[0].t[1] - steps[0].t[0]))
    return replace(out, misfit=float(np.sqrt(np.mean(found.fun**2) / np.mean(data.weight**2))))


def _swing_of(x: Array, terms: Array, count: int, period: float) -> Swing:
    """Of what was found, freed of the means over a period."""
    poles: Complex = np.asarray(SCALE * (-x[0 : 2 * count : 2] + 1j * x[1 : 2 * count : 2]), np.complex128)
    parts = (terms[2 : 2 + count] + 1j * terms[2 + count :]) / shrinks(poles, period)
    turned = poles.imag < 0
    poles[turned], parts[turned] = poles[turned].conj(), parts[turned].conj()
    return Swing(poles, parts, float(terms[0] + terms[1] * period / 2), float(terms[1]), 0.0)
