"""When a position settles, from a curve fitted to all steps of a setting, an axis and a speed. All functions are pure.

A settling time jumps by half a swing where an extreme of the swing just touches the band, and by much more where what is left
to an integrator runs along the band's edge. Which times are possible follows from the curve and its covariance; samples
themselves would leave the band again and again by their noise alone.

The curve is y(t) = level + sum over fixed time constants of a e^(-t/tau) + Re sum over the swing's poles of c e^(p t), and of
d t e^(p t) for what the poles are off. It is linear in its terms, and each term is linear in the signed size of the step and in
the set point where it began (bearings are not linear).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from procedures.step.oscillation import shrinks
from procedures.step.regressors import BOTH, FIRST, beside, left_out, order_of, regressors, spread_of
from procedures.step.steps import Case, Done

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
FROM_S = 8e-3  # filters, current loops and second harmonics of the swing are then below a hundredth of the band
# Time constants of what fades without swinging: the shortest, the ratio of the next to it, how many. 2.5 apart they miss what a
# PID leaves by 0.015 % of the step, 4 ms of its settling time.
FADES_S, APART, FADES = 0.1, 1.6, 12
HARD_S = tuple(0.01 * APART**k for k in range(5))  # such constants too where nothing swings
BAND_NOISE = 5.0  # of settling, at least, over the noise of the averaged position
NEAR = 3.0  # standard uncertainties from the band's edge within which an extreme is not told from one that touches it
DRAWS, FEW, PARTS = 1000, 20, 20  # PARTS: of the draws, of which one is in memory at a time
PER_SWING, DEAD = 100.0, 1e-4  # times looked at in a period, until the swing is that small
# Times looked at in the shortest time constant from then on: between them a decay is taken for straight, which makes it cross
# an edge late by its time constant over 8 PER_FADE² at most, 2 µs of 60 ms (5 ms apart it was 50 µs).
PER_FADE = 60.0
LATER_S = 1e-5  # by which a start is moved to see what it does
END_S = 0.02  # before the record's end, within which nothing can be said to have settled


@dataclass(frozen=True)
class Curve:
    """Fitted to steps (shares of each): `poles` 1/s, their `middle`, `fades` s, `terms` (SECOND, n) over the `regressors` of a
    step, its sizes over `largest` m. `covariances` of one of the largest steps, of what fades and what swings, with `dof`;
    `spreads` (SECOND, SECOND) what a case's mean has of them. It says nothing after `until` s, the end of the shortest step.
    `square`: of the sizes, over the largest's, in the mean of the steps, where the curve has nothing that goes with it;
    `jitter` s of a largest step's start, by noise."""

    poles: Complex
    middle: complex
    fades: tuple[float, ...]
    terms: Array
    covariances: tuple[Array, Array]
    spreads: tuple[Array, Array]
    dof: int
    largest: float
    until: float
    square: float | None = None
    jitter: float = 0.0


@dataclass(frozen=True)
class Settling:
    """Into the band `within`: expected `time` s (JCGM 101, 7.6), infinite where it is not within the record, or cannot be told
    to be (`open`); all times that are possible, at equal steps of probability (n,)."""

    time: float
    within: float
    times: Array
    open: bool = False


def columns(t: Array, poles: Complex, middle: complex, fades: Sequence[float], window: float) -> Array:
    """Means over `window` s before t (m,) of what the curve is made of, (m, n); `middle`: of the poles, each with its part."""

    def means(p: Complex) -> Complex:
        return np.asarray(np.exp(np.outer(t, p)) * shrinks(p, window))

    slow = [means(np.array([-1 / tau + 0j]))[:, 0].real for tau in fades]
    out = [np.ones_like(t), *slow]
    if len(poles):
        near = np.array([middle])
        later = (means(near + 1) - means(near - 1))[:, 0] / 2 * abs(middle)  # its derivative
        both = [*means(poles).T, later]
        out += [part for z in both for part in (z.real, z.imag)]
    return np.array(out).T


def lasting(poles: Complex) -> Complex:
    """Poles as they can be over a whole record. The part of an oscillation that position hardly has is noise, and so is its
    pole: over the first swings it may grow, over the record nothing did. It is then one that does not die away."""
    return np.asarray(np.minimum(poles.real, 0.0) + 1j * poles.imag)


def fading(poles: Complex) -> Complex:
    """Those that die away, and are not dead before a curve begins."""
    return poles[(poles.real < 0) & (-poles.real * FROM_S < math.log(1 / DEAD))]


def fit(
    steps: Sequence[Done], poles: Complex, middle: complex | None = None, constant: float = 0.0, unlike: bool = False
) -> Curve:
    """Of steps of one setting, axis and speed; `poles` of their swing, none where nothing swings, and the `middle` of these,
    each with its part in the swing (their mean where none is given); the time `constant` of what fades fast, 0 where nothing
    does; `unlike`: it is that of two things together, of which one is faster.

    Each step is fitted alone, then its terms over size and beginning. Noise that swings is taken from what the fits leave,
    over all times, and from how well each start is known; what fades from the scatter of its terms, which has both, since a
    level's noise is slower than a record.

    Raises:
        AnalysisError: too few steps to tell their scatter, or too few samples of one.
    """
    last = min(float(d.t[-1]) for d in steps)
    fades = tuple(float(f) for f in FADES_S * APART ** np.arange(FADES) if f <= last)
    fades = (*_faster(constant / APART**2 if unlike else constant, poles), *fades)
    fades = fades if len(poles) else (*HARD_S, *fades)
    poles = lasting(poles)
    middle = middle if middle is not None else complex(poles.mean()) if len(poles) else 0j
    count, period = min(int((d.t > FROM_S).sum()) for d in steps), float(steps[0].t[1] - steps[0].t[0])
    terms, left, made = [], [], np.zeros((0, 0))
    largest = max(d.case.size for d in steps)
    weight = np.array([d.case.size / largest for d in steps])
    for d in steps:
        after = np.flatnonzero(d.t > FROM_S)[:count]
        made = columns(d.t[after], poles, middle, fades, period)
        if len(after) < 2 * made.shape[1]:
            raise AnalysisError(
                f"{d.case.where}: found {len(after)} samples after the step; expected {2 * made.shape[1]}"
            )
        y = d.y[after] / d.case.size
        terms.append(np.linalg.lstsq(made, y, rcond=None)[0])
        left.append(y - made @ terms[-1])
    scaled, fading = np.array(terms) * weight[:, None], 1 + len(fades)
    full = np.array([regressors(d.case, d.begin, largest) for d in steps]) * weight[:, None]
    first = full[:, :FIRST]
    fade = full[:, : order_of(full, scaled[:, :fading] @ made[:, :fading].T)]
    square = float(np.average(full[:, 0] ** 2, weights=full[:, 0] ** 2)) if fade.shape[1] == FIRST else None
    dof = len(steps) - int(np.linalg.matrix_rank(fade))
    if dof < 2:
        raise AnalysisError(f"{steps[0].case.group}: found {len(steps)} steps; expected at least {FIRST + 2}")
    found = np.zeros((full.shape[1], made.shape[1]))
    found[: fade.shape[1], :fading] = np.linalg.lstsq(fade, scaled[:, :fading], rcond=None)[0]
    found[:FIRST, fading:] = np.linalg.lstsq(first, scaled[:, fading:], rcond=None)[0]
    apart = scaled[:, :fading] - fade @ found[: fade.shape[1], :fading]
    noise = _propagated(np.array(left) * weight[:, None], made)[fading:, fading:]
    jitter = math.sqrt(float(np.mean([(w * d.start_noise) ** 2 for w, d in zip(weight, steps, strict=True)])))
    return Curve(
        poles,
        middle,
        fades,
        found,
        (apart.T @ apart / dof, noise),
        (spread_of(fade), spread_of(first)),
        dof,
        largest,
        last,
        square,
        jitter,
    )


def _faster(constant: float, poles: Complex) -> tuple[float, ...]:
    """Time constants before the usual ones: from the one that was found on, others by about the same ratio until these; rising.
    One that is hardly slower than the usual ones may be that of two. Where none is found and the swing is over by then, from
    half of the first on: slow integrators leave what lasts 70 ms, and their settling was told .9 ms early."""
    if FADES_S <= constant < FADES_S * APART**2:
        constant /= APART**2
    elif not constant and len(poles) and math.exp(float(poles.real.max()) * FADES_S / 2) < DEAD:
        constant = FADES_S / 2
    many = math.ceil(math.log(FADES_S / constant) / math.log(APART) - 0.3) if 0 < constant < FADES_S else 0
    return tuple(float(c) for c in np.geomspace(constant, FADES_S, many + 1)[:-1]) if many > 0 else ()


def _propagated(left: Array, made: Array) -> Array:
    """Covariance (n, n) of terms fitted with `made` (m, n) to samples with the stationary noise of `left` (k, m)."""
    from scipy import linalg

    k, m = left.shape
    power = (np.abs(np.fft.rfft(left, 2 * m, axis=1)) ** 2).sum(axis=0)
    correlation = np.fft.irfft(power)[:m] / (k * (m - made.shape[1]))
    inverse = np.linalg.pinv(made)
    return np.asarray(inverse @ linalg.matmul_toeplitz(correlation, inverse.T))


def settling(curve: Curve, case: Case, steps: Sequence[Done], band: float, seed: int = 0) -> Settling:
    """Of the mean of a case's steps, averaged as its noise is, into the band; five times that noise at least."""
    from scipy import linalg

    window = float(np.mean([d.samples for d in steps])) * float(steps[0].t[1] - steps[0].t[0])
    noise = math.sqrt(float(np.mean([d.noise**2 for d in steps]))) / case.size / math.sqrt(len(steps))
    within = max(band, BAND_NOISE * noise)
    t = _looked_at(curve, curve.until)
    made = columns(t, curve.poles, curve.middle, curve.fades, window)
    of = np.array(regressors(case, -case.way * case.size / 2, curve.largest))
    off = made @ (of @ curve.terms) - 1
    parts = (c * float(of @ s @ of) for c, s in zip(curve.covariances, curve.spreads, strict=True))
    values, vectors = np.linalg.eigh(linalg.block_diag(*parts))
    shapes = np.column_stack(
        [made @ (vectors * np.sqrt(np.maximum(values, 0.0))), *_known_otherwise(curve, case, t, window, made)]
    )
    beyond, reach = np.abs(off) - within, NEAR * np.sqrt((shapes**2).sum(axis=1))
    touching = _touching(beyond, reach)
    best = float(crossings(t, off[None, :], within)[0])
    if not math.isfinite(best) or (len(touching) and t[touching[-1][-1]] > t[-1] - END_S):
        return Settling(math.inf, within, np.zeros(0), bool(beyond[-1] < reach[-1]))
    if not len(touching):
        return Settling(FROM_S / 2, within, np.linspace(0, FROM_S, DRAWS))
    rng = np.random.default_rng(seed)
    drawn = rng.standard_normal((DRAWS, shapes.shape[1]))
    drawn[:, : len(values)] *= np.sqrt(curve.dof / rng.chisquare(curve.dof, (DRAWS, 1)))
    ended = np.concatenate([crossings(t, off + few @ shapes.T, within) for few in np.array_split(drawn, PARTS)])
    times = _possible(t, off, ended, touching)
    return Settling(float(times.mean()), within, times)


def _known_otherwise(curve: Curve, case: Case, t: Array, window: float, made: Array) -> Iterator[Array]:
    """What else the curve of a case's mean may be off by, at `t` (n,): where each step's swing begins (what fades scatters with
    it), and the square of the size."""
    from scipy import linalg

    of, fading = regressors(case, -case.way * case.size / 2, curve.largest), 1 + len(curve.fades)
    later, sooner = (columns(t + by, curve.poles, curve.middle, curve.fades, window) for by in (LATER_S, -LATER_S))
    rate = (later - sooner)[:, fading:] @ (np.array(of) @ curve.terms)[fading:] / (2 * LATER_S)
    yield rate * curve.jitter * math.sqrt(float(np.array(of) @ curve.spreads[1] @ np.array(of)))
    if curve.square is not None:
        told = linalg.block_diag(*(c * s[BOTH, BOTH] for c, s in zip(curve.covariances, curve.spreads, strict=True)))
        more = left_out(made @ curve.terms[BOTH], np.einsum("ij,jk,ik->i", made, told, made))
        yield more * beside(case, curve.largest, curve.square)


def _looked_at(curve: Curve, last: float) -> Array:
    if not len(curve.poles):
        return np.arange(FROM_S, last, 1e-4)
    slowest = min(-float(p.real) for p in curve.poles)
    dead = min(math.log(1 / DEAD) / max(slowest, 1.0), last)
    swinging = np.arange(FROM_S, dead, 2 * math.pi / PER_SWING / float(np.abs(curve.poles).max()))
    return np.concatenate([swinging, np.arange(dead, last, curve.fades[0] / PER_FADE), [last]])


def crossings(t: Array, off: Array, within: float) -> Array:
    """When each of `off` (n, m) at `t` (m,) is within the band for good: 0 where it always is, infinite where it is not at the
    end."""
    outside = np.abs(off) > within
    row, last = np.arange(len(off)), off.shape[1] - 1 - np.argmax(outside[:, ::-1], axis=1)
    k = np.minimum(last, off.shape[1] - 2)
    before, after = np.abs(off[row, k]) - within, np.abs(off[row, k + 1]) - within
    with np.errstate(divide="ignore", invalid="ignore"):
        at = t[k] + (t[k + 1] - t[k]) * before / (before - after)
    at = np.where(last == off.shape[1] - 1, np.inf, at)
    return np.where(outside.any(axis=1), at, 0.0)


def _touching(beyond: Array, reach: Array) -> list[npt.NDArray[np.intp]]:
    """Stretches of times at which the band may be entered for good: its edge is within reach, and from the last time on that is
    beyond it for certain."""
    certain = np.flatnonzero(beyond > reach)
    first = int(certain[-1]) if len(certain) else -1
    near = np.flatnonzero(beyond > -reach)
    near = near[near > first]
    if first >= 0:
        near = np.unique(np.concatenate([[first, min(first + 1, len(beyond) - 1)], near]))
    return [s for s in np.split(near, np.flatnonzero(np.diff(near) > 1) + 1) if len(s)]


def _possible(t: Array, off: Array, drawn: Array, touching: Sequence[npt.NDArray[np.intp]]) -> Array:
    """Times at equal steps of probability. Each stretch counts alike: whether an extreme that near the band touches it is not
    told by data, and half a swing is more than any noise. Within a stretch the drawn curves decide; where too few of them end
    there, any time from the extreme until it is left."""
    edges = [(t[a[-1]] + t[b[0]]) / 2 for a, b in pairwise(touching)]
    which = np.searchsorted(edges, drawn)
    times, shares = [], []
    for k, stretch in enumerate(touching):
        of = drawn[(which == k) & np.isfinite(drawn)]
        if len(of) < FEW:
            top = stretch[int(np.argmax(np.abs(off[stretch])))]
            of = np.linspace(t[top], t[stretch[-1]], FEW)
        times.append(of)
        shares.append(np.full(len(of), 1 / len(of)))
    every, share = np.concatenate(times), np.concatenate(shares)
    order = np.argsort(every)
    total = np.cumsum(share[order])
    quantiles: Array = np.interp((np.arange(DRAWS) + 0.5) / DRAWS, (total - share[order] / 2) / total[-1], every[order])
    return quantiles
