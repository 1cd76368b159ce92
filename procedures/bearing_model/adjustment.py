"""One adjustment of everything that the positions depend on: force constants, offsets, and the certificates' numbers.

The positions overdetermine the force constants and offsets: they also say something of the gap, the spring and the sensors,
and what they say fits the certificates or does not. So all are adjusted together, each certified number t as an observation of
itself, with its own standard uncertainty u:

    sum over axes and positions of (F_model(beta, offset, t) - F_carries(t))^2 / s^2  +  sum over t of ((t - t_cert) / u)^2

is made least. s is the noise of a position's mean force with what the model is not trusted with, or what the adjustment
leaves if that is more.

What is noisy is read: currents and positions. Beta and the gap bring it into the force, so that s is a share of what the
coils pull, and goes with beta, offset and t as that does. Over an s that stays, a smaller beta makes the noise smaller, and the
certificates of an axis that carries little are bent for it. Weights that are taken anew at each step mend it by half: the
slope over beta holds the same noise as the residual. Of what was read, whose noise depends on no unknown, this is the
greatest likelihood, with no term in log s.

The trust is in the weights alone: the scatter that a result is said to have is that of the noise, or of
what the adjustment leaves. Near the solution the result is linear in what was certified: with the normal matrix H,
d(result)/d(t_cert) = (H^-1)_t / u^2, so that each certificate is an influence by identity, and a wrong one acts as little
as the positions let it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.uncertainty import Estimate
from procedures.amb_rotor import magnetics
from procedures.amb_rotor.keys import gap_key
from procedures.amb_rotor.magnetics import Positions
from procedures.shared.leastsquares import Fit
from procedures.shared.type_a import scatter

Array = npt.NDArray[np.float64]
BETA_UNIT, OFFSET_UNIT = 1e-7, 1e-5  # of the terms within the adjustment
ROUNDS, SMALL = 30, 1e-3  # steps at most; the last one, in standard deviations of what is observed
TOLD = 0.05  # u of an adjustment over the certificate's, below which the positions say nothing of that number
HOLD = 1e-6  # in BETA_UNIT: an unknown that is held stays within so much
STEP = 0.3  # of the numerical slopes, in standard uncertainties


@dataclass(frozen=True)
class Adjusted:
    """`estimates` of beta_*, offset_* and the gap; `values` of all inputs as adjusted.

    By input, `moved` is the adjustment over the certificate's u, `pulls` over its own, standard normal where the
    certificates hold. `terms` (4, 2) beta and offset; `residuals` (4, N) N, model less force.
    """

    estimates: dict[str, Estimate]
    values: dict[str, float]
    pulls: dict[str, float]
    moved: dict[str, float]
    terms: Array
    residuals: Array


@dataclass(frozen=True)
class _Problem:
    means: Positions
    values: dict[str, float]
    names: tuple[str, ...]  # inputs that are not exact
    u: Array
    gaps: tuple[str, ...]  # by axis, which input
    starts: Array  # eight terms, of the start
    held: tuple[int, ...] = ()  # unknowns that nothing tells and that stay where they are

    @property
    def prior(self) -> Array:
        """Rows of what is known without the positions: inputs by their certificates, and what is held."""
        whole = np.eye(8 + len(self.names))
        return np.vstack([whole[8:], whole[list(self.held)] / HOLD]) if self.held else whole[8:]

    def inputs(self, t: Array) -> dict[str, float]:
        shifts = t * self.u
        return self.values | {n: self.values[n] + float(d) for n, d in zip(self.names, shifts, strict=True)}

    def forces(self, x: Array) -> tuple[Array, Array]:
        """Model less force (4, N), and what both coils pull in the mean (4, 1), N, of the unknowns `x`: eight terms, then the
        inputs' shifts over their u."""
        p = self.inputs(x[8:])
        s, gaps = magnetics.statics(self.means, p), np.array([[p[gap]] for gap in self.gaps])
        beta, offset = (x[:8].reshape(4, 2) * [BETA_UNIT, OFFSET_UNIT]).T[:, :, None]
        positive, negative = (beta * c**2 / (gaps - side * (offset + s.r)) ** 2 for c, side in ((s.p, 1), (s.n, -1)))
        return positive - negative - s.force, (positive + negative).mean(axis=1, keepdims=True)

    @cached_property
    def pulled(self) -> Array:
        """What both coils pull at the start (4, 1), N: the noise is told there."""
        return self.forces(np.concatenate([self.starts, np.zeros(len(self.names))]))[1]

    def left(self, x: Array) -> Array:
        """Model less force (4 N,), N, as it would be if the coils pulled what they do at the start: its noise stays."""
        left, pull = self.forces(x)
        return (left * self.pulled / pull).ravel()

    def slopes(self, x: Array) -> Array:
        """(4 N, unknowns), by central differences."""
        out = []
        for k in range(len(x)):
            step = np.zeros(len(x))
            step[k] = STEP if k >= 8 else 1e-3
            out.append((self.left(x + step) - self.left(x - step)) / (2 * step[k]))
        return np.array(out).T


def adjust(
    means: Positions,
    inputs: Mapping[str, Estimate],
    noise_N: Array,
    weighed_N: Array,
    starts: Array,
    unloaded: tuple[int, ...] = (),
) -> Adjusted:
    """`inputs` as `magnetics.statics` wants them, and the gap; `noise_N` (4,) of a position's mean, `weighed_N` (4,) the same
    with what the model is not trusted with; `starts` (4, 2) terms. Of `unloaded` axes, which carry nothing, any force constant
    would do: that of the start is held, and none is told.

    Raises:
        AnalysisError: no solution.
    """
    names = tuple(n for n, e in inputs.items() if e.u > 0)
    gaps = tuple(gap_key(means.machine, a) for a in means.machine.axes)
    terms = (starts / [BETA_UNIT, OFFSET_UNIT]).ravel()
    problem = _Problem(
        means,
        {n: e.value for n, e in inputs.items()},
        names,
        np.array([inputs[n].u for n in names]),
        gaps,
        terms,
        tuple(2 * k for k in unloaded),
    )
    count = means.read.shape[1]
    x = np.concatenate([terms, np.zeros(len(names))])
    x = _least(problem, x, weighed_N)
    left = problem.left(x).reshape(4, count)
    spread = np.sqrt((left**2).sum(axis=1) / (count - 2))
    weighed = np.maximum(weighed_N, spread)
    if (spread > weighed_N).any():
        x = _least(problem, x, weighed)
    return _adjusted(problem, inputs, x, weighed, np.maximum(noise_N, spread))


def _least(problem: _Problem, x: Array, noise: Array) -> Array:
    """By Gauss and Newton's steps, of the stacked problem: its normal matrix would lose half of the digits."""
    prior = problem.prior
    kept = np.zeros(len(problem.held))
    per = np.repeat(1 / noise, problem.means.read.shape[1])
    for _ in range(ROUNDS):
        design = np.vstack([problem.slopes(x) * per[:, None], prior])
        scale = np.sqrt((design**2).sum(axis=0))
        wanted = -np.concatenate([problem.left(x) * per, x[8:], kept])
        if not (np.isfinite(design).all() and np.isfinite(wanted).all() and scale.all()):
            break  # it went where the model has no numbers, or where an unknown moves nothing
        step = np.linalg.lstsq(design / scale, wanted, rcond=None)[0] / scale
        if not np.isfinite(step).all():
            break
        x = x + step
        if float(np.abs(design @ step).max()) < SMALL:
            return x
    raise AnalysisError(
        "the positions and the certificates have no solution together: suspect directions, places, gap or mass of the rig "
        "file, or exchanged channels"
    )


def _inverse(design: Array) -> Array:
    """(design' design)^-1, by an orthogonal decomposition.

    Raises:
        AnalysisError: columns that depend on each other.
    """
    from scipy import linalg

    scale = np.sqrt((design**2).sum(axis=0))
    r = np.linalg.qr(design / scale, mode="r")
    if np.abs(np.diag(r)).min() < 1e-9:
        raise AnalysisError("the positions do not determine the force constants and offsets")
    upper = linalg.solve_triangular(r, np.eye(len(r)))
    out: Array = upper @ upper.T / np.outer(scale, scale)
    return out


def _adjusted(problem: _Problem, inputs: Mapping[str, Estimate], x: Array, weighed: Array, noise: Array) -> Adjusted:
    count, axes = problem.means.read.shape[1], problem.means.machine.axes
    slopes, left = problem.slopes(x), problem.left(x).reshape(4, count)
    weighted = slopes * np.repeat(1 / weighed, count)[:, None]
    inverse = _inverse(np.vstack([weighted, problem.prior]))
    units = np.concatenate([np.tile([BETA_UNIT, OFFSET_UNIT], 4), problem.u])
    values = problem.inputs(x[8:])
    rows = {f"{what}_{a}": 2 * k + j for k, a in enumerate(axes) for j, what in enumerate(("beta", "offset"))}
    rows = {name: row for name, row in rows.items() if row not in problem.held}
    rows |= {key: 8 + problem.names.index(key) for key in dict.fromkeys(problem.gaps) if key in problem.names}
    estimates = {key: inputs[key] for key in problem.gaps if key not in problem.names}
    for name, row in rows.items():
        value = float(x[row] * units[row]) if row < 8 else values[name]
        shares = inverse[row, 8:] * units[row] / problem.u
        estimates[name] = Estimate.exact(value) + _certified(problem, inputs, shares)
    terms = (x[:8] * units[:8]).reshape(4, 2)
    random = weighted * np.repeat(noise / weighed, count)[:, None]
    by_noise = inverse @ (random.T @ random) @ inverse * np.outer(units, units)
    for k, a in enumerate(axes):
        of = slice(2 * k, 2 * k + 2)
        rows_of_k = slopes[k * count : (k + 1) * count, of] / units[of]
        fit = Fit(terms[k], by_noise[of, of], -left[k], float(left[k] @ left[k]), count - 2, rows_of_k)
        gradients = {f"beta_{a}": [1, 0], f"offset_{a}": [0, 1]}
        noisy = scatter(fit, gradients, f"bearing-model/{a}", f"scatter of the positions, {a}")
        estimates |= {name: estimates[name] + e for name, e in noisy.items() if name in estimates}
    known = np.sqrt(np.maximum(1 - np.diag(inverse)[8:], 0.0))  # u of an adjustment, over the certificate's
    moved = {n: float(v) for n, v in zip(problem.names, x[8:], strict=True)}
    pulls = {n: moved[n] / float(k) for n, k in zip(problem.names, known, strict=True) if k > TOLD}
    return Adjusted(estimates, values, pulls, moved, terms, problem.forces(x)[0])


def _certified(problem: _Problem, inputs: Mapping[str, Estimate], shares: Array) -> Estimate:
    """What the certificates' errors do to a result that moves by `shares` of them."""
    total = Estimate.exact(0.0)
    for name, share in zip(problem.names, shares, strict=True):
        total = total + (inputs[name] - inputs[name].value) * float(share)
    return total
