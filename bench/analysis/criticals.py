"""Critical speeds and amplification factors from synchronous vectors against speed, by half power (API 617, Bode plot).

A critical is a greatest amplitude of the response, at N_c; N_1 and N_2 are where it has fallen to 0.707 of it on either side.
The amplification factor is N_c/(N_2 - N_1). The vectors are smoothed by local rational models first (see `peaks`), and noise
of their covariance drawn onto the smooth curve says how far each number scatters and what bias it has.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.analysis.peaks import WINDOW, noise, pooled_covariance, smoother
from bench.analysis.sampling import Array, Complex
from bench.errors import AnalysisError

HALF_POWER = math.sqrt(0.5)
PROMINENCE = 0.1  # of the greatest amplitude: what a critical must stand out by
DRAWS = 200
FLAT = 0.97  # of the greatest amplitude: what says where it is
LEAST, DISTINCT = 9, 5  # points that a cubic needs
SEEN = 0.9  # of the drawn curves must show what is told
CERTAIN = 4.5
"""Of 150 curves of 112 blocks that were noise of 3, 10 and 30 % about a slow change, one in fifty of the last, and none of the
others, had a greatest amplitude that stood out by so many of the standard deviations that its noise gives it."""
NEAR = 0.03  # of the record: where a drawn curve's critical is looked for


@dataclass(frozen=True)
class Critical:
    """One critical: `speed` rad/s at the greatest amplitude, `amplitude` m 0-pk, `low` and `high` speeds at half power,
    amplification factor `factor` and `damping` = 1/(2 factor); their covariance (4, 4) in the order speed, amplitude, factor,
    damping. A half-power point outside the record, or lost in the
    noise, leaves low, high, factor and damping NaN. `clear`: by how many standard deviations, of its noise, it stands out."""

    speed: float
    amplitude: float
    low: float
    high: float
    factor: float
    damping: float
    covariance: Array
    clear: float = math.inf

    @property
    def certain(self) -> bool:
        """It is no bump that noise has made."""
        return self.clear > CERTAIN

    @property
    def critically_damped(self) -> bool:
        """API: an amplification factor under 2.5 is no critical speed."""
        return self.factor < 2.5


def criticals(
    speed: npt.ArrayLike,
    values: npt.ArrayLike,
    covariance: Array,
    *,
    seed: int = 0,
    draws: int = DRAWS,
    scatter: Complex | None = None,
) -> list[Critical]:
    """All criticals of a curve `values` (b,) at `speed` (b,) rad/s in any order, covariances (b, 2, 2), by rising speed.

    `scatter` (draws, b) is noise that was drawn already, as of vectors that depend on each other; otherwise it is drawn here,
    independent from block to block.

    Raises:
        AnalysisError: fewer than nine blocks, or two at one speed.
    """
    order = np.argsort(np.asarray(speed, np.float64))
    w, z = np.asarray(speed, np.float64)[order], np.asarray(values, np.complex128)[order]
    if z.size < WINDOW or not (np.diff(w) > 0).all():
        raise AnalysisError(f"criticals: found {z.size} vectors; expected {WINDOW} or more, at speeds of their own")
    pooled = pooled_covariance(covariance[order])
    smooth = smoother(w, z, pooled, WINDOW)
    fine = np.abs(smooth.everywhere(z))
    tops = _tops(fine)
    if not tops:
        return []
    lines = smooth.at_lines(z)
    off = noise(pooled, seed, draws) if scatter is None else scatter[:, order]
    again = np.abs(smooth.everywhere(lines))
    drawn = np.abs(smooth.everywhere(lines + off))
    found = (_critical(smooth.x, fine, again, drawn, k) for k in tops)
    return [c for c in found if c is not None]


def moved(
    speed: Array, values: npt.ArrayLike, others: npt.ArrayLike, covariance: Array, near: Critical
) -> tuple[Array, Array]:
    """Speed, amplitude and factor (3,) of the critical next to `near` on the curve `values` (b,) at ascending `speed` (b,), and
    by how much they differ on each of the curves `others` (m, b): (m, 3). NaN is what lies outside the record. No bias is
    taken off."""
    base = np.asarray(values, np.complex128)
    smooth = smoother(speed, base, pooled_covariance(covariance), WINDOW)
    sizes = np.abs(smooth.everywhere(np.vstack([base[None], np.asarray(others, np.complex128)])))
    k = int(np.argmin(np.abs(smooth.x - near.speed)))
    found = np.array([_numbers(smooth.x, size, k)[[0, 1, 4]] for size in sizes])
    return found[0], found[1:] - found[0]


def _tops(size: Array) -> list[int]:
    """Local greatest values inside the record that stand out."""
    inner = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])) + 1
    return [int(k) for k in inner if _prominence(size, int(k)) > PROMINENCE * size.max()]


def _prominence(size: Array, k: int) -> float:
    return float(size[k] - size[_saddle(size, k)])


def _saddle(size: Array, k: int) -> int:
    """The higher of the lowest points to either side of k, as far as what is higher than k."""
    lowest = []
    for side in (np.arange(k)[::-1], np.arange(k + 1, size.size)):
        higher = np.flatnonzero(size[side] > size[k])
        near = side[: higher[0] if higher.size else side.size]
        lowest.append(int(near[np.argmin(size[near])]))
    return max(lowest, key=lambda j: float(size[j]))


def _critical(w: Array, size: Array, again: Array, drawn: Array, k: int) -> Critical | None:
    """None where the greatest amplitude itself is lost in the noise; where half power is, factor and damping are NaN."""
    found, base = _numbers(w, size, k), _numbers(w, again, k)
    scatter = np.array([_numbers(w, d, k) for d in drawn])
    there, whole = (np.isfinite(scatter[:, part]).all(axis=1) for part in (slice(0, 2), slice(None)))
    if there.mean() < SEEN or not np.isfinite(found[:2] + base[:2]).all():
        return None
    saddle = _saddle(size, k)
    clear = float((size[k] - size[saddle]) / max((drawn[:, k] - drawn[:, saddle]).std(), 1e-300))
    better = found - (scatter[whole].mean(axis=0) - base) if whole.mean() >= SEEN else np.full(5, np.nan)
    if not (np.isfinite(better).all() and better[3] > better[2]):
        covariance = np.full((4, 4), np.nan)
        covariance[:2, :2] = np.cov(scatter[there, :2].T)
        speed, amplitude = found[:2] - (scatter[there, :2].mean(axis=0) - base[:2])
        return Critical(float(speed), float(amplitude), math.nan, math.nan, math.nan, math.nan, covariance, clear)
    s = scatter[whole]
    columns = np.column_stack([s[:, 0], s[:, 1], s[:, 4], 1 / (2 * s[:, 4])])
    speed, amplitude, low, high, factor = (float(v) for v in better)
    return Critical(speed, amplitude, low, high, factor, 1 / (2 * factor), np.cov(columns.T), clear)


def _numbers(w: Array, size: Array, near: int) -> Array:
    """Speed, amplitude, the half-power speeds and the factor of the greatest amplitude next to index `near`, (5,)."""
    reach = max(NEAR * w.size, 2)
    first = max(int(near - reach), 0)
    k = first + int(np.argmax(size[first : int(near + reach) + 1]))
    if not 0 < k < size.size - 1:
        return np.full(5, np.nan)
    speed, top = _vertex(w, size, k)
    below = size < HALF_POWER * top
    left, right = np.flatnonzero(below[:k]), np.flatnonzero(below[k:])
    if not (left.size and right.size):
        return np.array([speed, top, np.nan, np.nan, np.nan])
    low = _crossing(w, size, left[-1], HALF_POWER * top)
    high = _crossing(w, size, k + right[0] - 1, HALF_POWER * top)
    if not high > low:  # noise alone makes a width of nothing
        return np.array([speed, top, np.nan, np.nan, np.nan])
    return np.array([speed, top, low, high, speed / (high - low)])


def _vertex(w: Array, size: Array, k: int) -> tuple[float, float]:
    """Where a curve is greatest about its greatest point k, and how great, by a cubic through what is nearly as great: the
    points between lines are too far apart, and each local model's own."""
    below = size < FLAT * size[k]
    left, right = np.flatnonzero(below[:k]), np.flatnonzero(below[k:])
    first, end = int(left[-1]) + 1 if left.size else 0, k + int(right[0]) if right.size else size.size
    if end - first < LEAST:
        first, end = max(k - LEAST // 2, 0), min(k + LEAST // 2 + 1, size.size)
    x = (w[first:end] - w[k]) / (w[end - 1] - w[first])
    if np.unique(x).size < DISTINCT:
        return float(w[k]), float(size[k])
    a = np.polynomial.polynomial.polyfit(x, size[first:end], 3)
    slope = np.polynomial.polynomial.polyder(a)
    roots = np.polynomial.polynomial.polyroots(slope)
    real = [r.real for r in roots if abs(r.imag) < 1e-9 and x[0] <= r.real <= x[-1]]
    if not real:
        return float(w[k]), float(size[k])
    best = max(real, key=lambda r: float(np.polynomial.polynomial.polyval(r, a)))
    return float(w[k] + best * (w[end - 1] - w[first])), float(np.polynomial.polynomial.polyval(best, a))


def _crossing(w: Array, size: Array, k: int, level: float) -> float:
    share = (level - size[k]) / (size[k + 1] - size[k])
    return float(w[k] + share * (w[k + 1] - w[k]))
