"""The bare model: steps in a sampled current, the time between two levels, the response of the small signal, what limits.

A step is found by where the current passes the half of it. Its levels are means: before the step, and before the next one. The
step back goes to the same reference that the current stood at before, and so to that level, which was there for longer than a
capture may last after the step back.
Crossings lie between samples, on the cubic through two on either side.

The frequency response is that of the step's derivative: with differences d_k of the samples of a response from 0 to 1,

    H(f) = sum_k d_k exp(-2 pi i f k T) / (sin(pi f T)/(pi f T)),

since a difference over T is the derivative's mean over T. It wants no instant of the step.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError

Array = npt.NDArray[np.float64]
LEVEL_S = 1.5e-3  # what a level is a mean over
GUARD_S = 1e-4  # between a level's samples and a step
LOW, HIGH = 0.1, 0.9
MINUS_3_DB = 2**-0.5
FALL = 10.0  # of a top's parabola to its window's edge: more than noise by itself has at its own greatest


@dataclass(frozen=True)
class Edge:
    """One step of a record: index `at` of the first sample beyond its half, levels `before` and `after` that it goes between,
    A, the mean `end` before the next one or the record's end, and how far the mean of the second half of that is from the
    first, `drift` A."""

    at: int
    before: float
    after: float
    end: float
    drift: float

    @property
    def size(self) -> float:
        """With its sign, A."""
        return self.after - self.before


def edges(y: Array, size: float, tick_s: float) -> tuple[Edge, Edge] | None:
    """The step by `size` A and the one back in a current (n,) A; None: they did not come, or stand at the record's ends."""
    level, guard = round(LEVEL_S / tick_s), round(GUARD_S / tick_s)
    if len(y) < 4 * (level + guard):
        return None
    half = np.median(y[:level]) + size / 2
    above = (y >= half) if size > 0 else (y <= half)
    if above[0] or not above.any():
        return None
    up = int(np.argmax(above))
    far = min(up + level // 2, len(y) - 1)  # noise may pass the half more than once
    if above[far:].all() or not above[far]:
        return None
    back = far + int(np.argmin(above[far:]))
    ends = (up - guard, back - guard, len(y))
    starts = (ends[0] - level, ends[1] - level, ends[2] - level)
    if starts[0] < 0 or starts[1] < up + guard or starts[2] < back + guard:
        return None
    levels = [y[a:b] for a, b in zip(starts, ends, strict=True)]
    means = [float(part.mean()) for part in levels]
    drifts = [float(part[level // 2 :].mean() - part[: level // 2].mean()) for part in levels]
    return Edge(up, means[0], means[1], means[1], drifts[1]), Edge(back, means[1], means[0], means[2], drifts[2])


def cut(y: Array, edge: Edge, before: int, after: int) -> Array:
    """Samples (before + after,) about an edge.

    Raises:
        AnalysisError: the record has not so many.
    """
    if edge.at < before or edge.at + after > len(y):
        raise AnalysisError(f"a step at sample {edge.at} of {len(y)}: expected {before} before it and {after} after it")
    return y[edge.at - before : edge.at + after]


def unit(y: Array, edge: Edge, before: int, after: int) -> Array:
    """A step's response (before + after,), from 0 to 1."""
    return (cut(y, edge, before, after) - edge.before) / edge.size


def crossing(h: Array, level: float, k: int) -> float:
    """Where a response (n,) passes a level between the samples k - 1 and k, by the cubic through two on either side; index.

    Raises:
        AnalysisError: there are not so many samples.
    """
    if not 2 <= k < len(h) - 1:
        raise AnalysisError(f"a step passes {level:.0%} of its size at the end of what was captured of it")
    a, b, c, d = (float(x) - level for x in h[k - 2 : k + 2])
    low, high = 0.0, 1.0
    for _ in range(40):
        t = 0.5 * (low + high)
        y = b + t * (
            (c - b) - (1 - t) / 2 * ((c - 2 * b + a) + (1 + t) / 3 * (d - 3 * c + 3 * b - a))
        )  # Newton's form: differences of b, c; then a; then d
        low, high = (t, high) if y < 0 else (low, t)
    return k - 1 + low


def passed(h: Array) -> tuple[int, int]:
    """The first samples of a response (n,) beyond 10 % and beyond 90 %: before that of 90 % the one after the last
    below 10 %, since noise about 10 % does not begin a rise.

    Raises:
        AnalysisError: it does not pass them.
    """
    end = int(np.argmax(h >= HIGH))
    under = np.flatnonzero(h[:end] < LOW)
    if h[end] < HIGH or not len(under):
        raise AnalysisError("a step does not go from 10 to 90 % of its size")
    return int(under[-1]) + 1, end


def rise(h: Array) -> float:
    """Samples from 10 to 90 % of a response (n,)."""
    low, high = passed(h)
    return crossing(h, HIGH, high) - crossing(h, LOW, low)


def straight(h: Array) -> float:
    """The same on straight lines between samples: what both differ by is more than what a cubic leaves."""
    low, high = passed(h)

    def at(k: int, level: float) -> float:
        return k - 1 + float((level - h[k - 1]) / (h[k] - h[k - 1]))

    return at(high, HIGH) - at(low, LOW)


def gains(h: Array, hz: Array, tick_s: float) -> npt.NDArray[np.complex128]:
    """Frequency response (m,) of a step's response (n,) at frequencies (m,) Hz."""
    turned = np.exp(-2j * np.pi * hz[:, None] * tick_s * np.arange(len(h) - 1))
    return np.asarray(turned @ np.diff(h) / np.sinc(hz * tick_s))


def bandwidth(h: Array, tick_s: float) -> float:
    """The lowest frequency, Hz, from which on a step's response (n,) has less than 1/sqrt(2).

    Raises:
        AnalysisError: it has less from the first line on, or not up to half of the sampling rate.
    """
    coarse = np.geomspace(2 / (len(h) * tick_s), 0.45 / tick_s, 120)
    for _ in range(3):
        below = np.abs(gains(h, coarse, tick_s)) < MINUS_3_DB
        k = int(np.argmax(below))
        if not below.any() or k == 0:
            raise AnalysisError("the response has no frequency of -3 dB in its band")
        low, high = float(coarse[k - 1]), float(coarse[k])
        coarse = np.linspace(low, high, 12)
    size = np.abs(gains(h, np.array([low, high]), tick_s))
    return float(low + (high - low) * (size[0] - MINUS_3_DB) / (size[0] - size[1]))


@dataclass(frozen=True)
class Top:
    """The greatest value of the mean of repeats: its standard uncertainty by their scatter, and how much greater than `value`
    it may be at most, `above`, since noise says where it is."""

    value: float
    u: float
    above: float


def farthest(each: Array, longest: int, either_way: bool = False) -> Top:
    """The greatest value of the mean of repeats (r, n), or, `either_way`, the greatest distance from 0. The greatest of what
    has noise is too great; so half of the repeats say where it is (and to which side), and the other half how great it is
    there: on a parabola through up to `longest` samples on either side.

    With E[.] the mean over all noise, E[value] is at most the top, since the response is nowhere higher than there, and the top
    of the mean of all repeats is in the mean at least that (Jensen: the greatest is convex); they differ by `above`."""
    found, spread = [], []
    for ours, others in ((each[0::2], each[1::2]), (each[1::2], each[0::2])):
        first, weights = _placed(others, longest, either_way)
        values = ours[:, first : first + len(weights)] @ weights
        found.append(float(values.mean()))
        spread.append(float(values.var(ddof=1)) / len(ours))
    value = 0.5 * sum(found)
    first, weights = _placed(each, longest, either_way)
    highest = float(each.mean(axis=0)[first : first + len(weights)] @ weights)
    return Top(value, 0.5 * float(np.sqrt(sum(spread))), max(highest - value, 0.0))


@cache
def _parabola(m: int) -> Array:
    """Weights (3, 2 m + 1) of samples that give level, slope and bend of the parabola through them, in the middle."""
    return np.asarray(np.linalg.pinv(np.vander(np.arange(-m, m + 1.0), 3, increasing=True)))


def _placed(each: Array, longest: int, either_way: bool) -> tuple[int, Array]:
    """Where the mean of repeats (r, n) has its top: a window's first sample, and the weights (2 m + 1,) of its samples that
    give a parabola's value there, with the side's sign.

    Of windows of m samples on either side the first whose parabola falls to its edge by `FALL` times s/sqrt(m), s being the
    noise of the mean. The place is then known to s_b/c, of slope s_b^2 = 3 s^2/(2 m^3) and curvature c = 2 fall/m^2, and what
    lies beside the top is c/2 (s_b/c)^2 = 3 s/(8 FALL sqrt(m)) lower: 0.035 of the value's 1.06 s/sqrt(m)."""
    mean = each.mean(axis=0)
    noise = float(np.sqrt(each.var(axis=0, ddof=1).mean() / len(each)))
    for m in range(1, min(longest, (len(mean) - 1) // 2) + 1):
        fits = _parabola(m)
        levels = np.lib.stride_tricks.sliding_window_view(mean, 2 * m + 1) @ fits[0]
        first = int(np.argmax(np.abs(levels) if either_way else levels))
        side = -1.0 if either_way and levels[first] < 0 else 1.0
        slope, bend = side * (fits[1:] @ mean[first : first + 2 * m + 1])
        if -bend * m**2 >= FALL * noise / np.sqrt(m):
            break
    at = float(np.clip(-slope / (2 * bend), -0.5, 0.5)) if bend < 0 else 0.0
    return first, side * (fits[0] + at * fits[1] + at**2 * fits[2])


def amplitude(parts: Array) -> Array:
    """Length of the space vector (n,) of a symmetric winding's currents (m, n), whatever its angle: of m phases of equal
    amplitude I the squares sum up to m I^2/2."""
    return np.asarray(np.sqrt(2 / len(parts) * (parts**2).sum(axis=0)))


def given(voltages: Array, currents: Array, inductance: float, tick_s: float) -> Array:
    """What half-bridges give, V (m, n - 1): voltages (m, n) V behind their filters, as the mean over a tick, and what the
    filter's inductance takes of it. The carrier's ripple alternates from sample to sample and is not in the mean."""
    return 0.5 * (voltages[:, 1:] + voltages[:, :-1]) + inductance / tick_s * np.diff(currents, axis=1)
