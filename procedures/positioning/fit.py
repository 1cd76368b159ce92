"""What an instrument's own errors make of the figures of ISO 230-2, by Monte Carlo, and by the technical report's sums.

The measurand is a figure T of the true deviations x of these very approaches. What is read is y = x + e, and T is neither
linear nor without bias: noise adds to every s, and the largest of many may be one that noise made so. There is no one answer to
that, so there are three, and the interval has all of them; where errors are small they are one. T(x) lies where

    T(y - e)                                            (JCGM 101: what noise added stays, and is added once more)
    T(y) - (T(y + e) - T(y)),  T(y) - (T(x* + e) - T(x*))     (what errors do to deviations like these, taken off)

x* is y without what noise gave it: the scatter within cells, the reversal's spread and the means' spread, each shrunk by
sqrt(1 - its noise/its variance).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from procedures.positioning.standard import DOWN, UP, figures

Array = npt.NDArray[np.float64]
DRAWS = 20_000
BATCH = 2_000
GAIN, SCALE, READINGS, WANDER = "gain", "error", "readings", "drift"
GROUPS = (GAIN, SCALE, READINGS, WANDER)


@dataclass(frozen=True)
class Errors:
    """Of an instrument, standard uncertainties: `gain` as a share, and whether it is rectangular; `scale` at any one place,
    `noise` of one reading, `wander` of its zero a second; `step`, its resolution."""

    gain: float = 0.0
    flat: bool = False
    scale: float = 0.0
    noise: float = 0.0
    wander: float = 0.0
    step: float = 0.0

    @property
    def reading(self) -> float:
        """Standard uncertainty of a reading by its noise and rounding."""
        return math.hypot(self.noise, self.step / math.sqrt(12))


@dataclass(frozen=True)
class Spread:
    """Of the twelve figures: what errors add to each, draws (DRAWS, 12) in order; by group what it alone does, standard
    deviations (12,); slopes over the gain (12,)."""

    added: Array
    alone: Mapping[str, Array]
    slope: Array


def shrunk(y: Array, errors: Errors) -> Array:
    """Deviations (2, m, n) without what noise gave their spreads."""
    n = y.shape[-1]
    mean = y.mean(axis=-1)
    both, reversal = mean.mean(axis=0), mean[UP] - mean[DOWN]
    noise = errors.reading**2
    within = _left(float(y.var(axis=-1, ddof=1).mean()), noise)
    apart = _left(float(reversal.var(ddof=1)), 2 * noise / n)
    along = _left(float(both.var(ddof=1)), errors.scale**2 + noise / (2 * n))
    middle = both.mean() + along * (both - both.mean())
    half = (reversal.mean() + apart * (reversal - reversal.mean())) / 2
    means = np.stack([middle + half, middle - half])
    return np.asarray(means[..., None] + within * (y - mean[..., None]))


def _left(variance: float, noise: float) -> float:
    return math.sqrt(max(0.0, 1 - noise / variance)) if variance > 0 else 0.0


def spread(y: Array, places: Array, times: Array, errors: Errors, seed: int = 0) -> Spread:
    """Of deviations y (2, m, n) at `places` (m,) m or rad, read at `times` (2, m, n) s."""
    starts, here = (shrunk(y, errors), y), figures(y)
    still = [figures(x) for x in starts]
    rng = np.random.default_rng([seed, 230])
    alone: dict[str, list[Array]] = {group: [] for group in GROUPS}
    added: list[list[Array]] = [[], [], []]
    for _ in range(DRAWS // BATCH):
        drawn = _drawn(errors, places, times, rng)
        whole = sum(drawn.values())
        for k, x in enumerate(starts):
            added[k].append(figures(x + whole) - still[k])
        added[2].append(here - figures(y - whole))
        for group in GROUPS:
            alone[group].append(figures(starts[0] + drawn[group]) - still[0])
    little = max(errors.gain, 1e-9) * places[None, :, None]
    slope = (figures(starts[0] + little) - figures(starts[0] - little)) / (2 * max(errors.gain, 1e-9))
    return Spread(
        _all(*(np.concatenate(some) for some in added)),
        {group: np.concatenate(some).std(axis=0) for group, some in alone.items()},
        slope,
    )


def _all(*answers: Array) -> Array:
    """Draws, in order, whose quantiles below the middle are the lowest of all answers', above it the highest."""
    each = np.sort(np.stack(answers), axis=1)
    low = np.arange(each.shape[1])[:, None] < each.shape[1] // 2
    return np.asarray(np.where(low, each.min(axis=0), each.max(axis=0)))


def _drawn(errors: Errors, places: Array, times: Array, rng: np.random.Generator) -> dict[str, Array]:
    """Errors of readings by group, each (BATCH, 2, m, n) or what broadcasts to it."""
    shape = (BATCH, *times.shape)
    flat, normal = rng.uniform(-math.sqrt(3), math.sqrt(3), (2, BATCH, 1, 1, 1)), rng.standard_normal((BATCH, 1, 1, 1))
    gain = errors.gain * (flat[0] if errors.flat else normal)
    readings = errors.noise * rng.standard_normal(shape) + errors.step * (rng.random(shape) - 0.5)
    return {
        GAIN: gain * places[None, None, :, None],
        SCALE: errors.scale * rng.standard_normal((BATCH, 1, len(places), 1)),
        READINGS: readings,
        WANDER: errors.wander * flat[1] * (times - times.mean()),
    }


def by_report(errors: Errors, travel: float, seconds: float, n: int) -> dict[str, float]:
    """U with k = 2 as ISO/TR 230-9 sums it: in squares, without bias. `device`, the instrument along the travel; `eve`, the
    environment: noise and wandering. A mean has eve/sqrt(n); R, 4 s, is given 2 eve."""
    device = 2 * math.hypot(errors.gain * travel, math.sqrt(2) * errors.scale)
    eve = 2 * math.hypot(errors.reading, errors.wander * seconds / 2)
    one, both, repeat = 2 * eve**2 / n, eve**2 / n, 2 * eve
    out = {name: math.hypot(device, math.sqrt(one)) for name in ("E", "E_up", "E_down")}
    out |= dict.fromkeys(("R", "R_up", "R_down"), repeat)
    out |= {name: math.hypot(device, math.sqrt(one), repeat) for name in ("A", "A_up", "A_down")}
    return out | {"M": math.hypot(device, math.sqrt(both)), "B": math.sqrt(one), "B_mean": math.sqrt(one)}
