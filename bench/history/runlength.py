"""How many values a control chart takes until its first signal: the law of its run length. Pure.

For an EWMA chart, and with weight 1 for an individuals chart. Values are normal, independent, in units of their standard
deviation, about means that may shift or drift. Known parameters: Crowder, Technometrics 29, 401 (1987), his integral equation
for the run length's distribution, by Gauss-Legendre nodes; with exact limits as Knoth has it (Sequential Analysis 22 (2003)).
Estimated ones: the same, averaged over centre and standard deviation as the baseline gives them: Jones, Champ and Rigdon,
Technometrics 43, 156 (2001).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import lru_cache
from itertools import repeat

import numpy as np

from bench.figures import Array
from bench.history.charts import D2, WIDTH, ewma_settled

RANGE_VARIANCE = 2 - 4 / math.pi  # of |x_1 - x_2|
NEIGHBOURS = (4 / math.pi) * (math.sqrt(0.75) + math.asin(0.5) / 2 - 1)  # covariance of |x_1 - x_2| and |x_2 - x_3|
TAIL = 1e-10  # of the probability that no signal came yet: what follows is taken as geometric
LONGEST = 100_000  # values
GRID = 6.0  # standard deviations of a value: to where its normal density is taken
MOST_WAVES, NOTHING = 2000, 1e-6  # of the characteristic function: how many at most, and what counts as zero
SETTLED = 1e-7  # of the variance of z_i, short of the settled one: no more than the settled one is asked from then on


def survival(
    means: Iterable[float], weight: float, *, width: float = WIDTH, exact: bool = True, centre: Array | float = 0.0,
    sigma: Array | float = 1.0,
) -> Iterable[Array]:  # fmt: skip
    """Probabilities that no signal came until value 1, 2, …, for each pair of chart's `centre` and `sigma` (p,), in the true
    standard deviations; `means` are those of the values. `exact`: limits by the variance of each z_i, else of the settled one.

    With y = (z - centre)/sigma, |y_i| < c_i and y_i = (1 - weight) y_i-1 + weight (x_i - centre)/sigma the density of what has
    not signalled is f_i(y) = integral over |u| < c_i-1 of f_i-1(u) k(y - (1 - weight) u) du.
    """
    at, sd = np.atleast_1d(np.float64(centre)), np.atleast_1d(np.float64(sigma))
    at, sd = (a[:, None, None] for a in np.broadcast_arrays(at, sd))
    settled = width * ewma_settled(weight)
    points, weights = np.polynomial.legendre.leggauss(24 + math.ceil(6 * settled / weight))
    before, density = np.zeros(1), np.ones((at.shape[0], 1))  # at first all of it at y = 0
    measure = np.ones(1)
    spread = weight / sd
    kernel, held = np.empty(0), (math.nan, math.nan, math.nan)
    for i, mean in enumerate(means, start=1):
        gone = (1 - weight) ** (2 * i) if exact else 0.0
        reach = settled * math.sqrt(1 - gone) if gone > SETTLED else settled
        nodes = reach * points
        if held != (held := (float(before[0]), reach, mean)):
            off = (nodes[None, :, None] - (1 - weight) * before[None, None, :] - weight * (mean - at) / sd) / spread
            kernel = np.exp(-off * off / 2) / (math.sqrt(2 * math.pi) * spread)
        density = np.einsum("pij,pj->pi", kernel, density * measure)
        before, measure = nodes, reach * weights
        yield density @ measure


def average_run_length(
    weight: float, *, shift: float = 0.0, slope: float = 0.0, width: float = WIDTH, exact: bool = False
) -> float:
    """ARL with known parameters, of values about `shift` that moves by `slope` with each of them, the first included."""
    means: Iterable[float] = repeat(shift) if slope == 0 else (shift + slope * i for i in range(1, LONGEST))
    total, last, ratio = 1.0, 1.0, 0.0
    for n, found in enumerate(survival(means, weight, width=width, exact=exact), start=1):
        left = float(found[0])
        if left < TAIL or n == LONGEST:
            break
        settled = slope == 0 and n > 20 and abs(left / last - ratio) < 1e-12
        ratio, last = left / last, left
        total += left
        if settled:
            return total + left * ratio / (1 - ratio)
    return total


def baseline(runs: int, centres: int = 7, sigmas: int = 16) -> tuple[Array, Array, Array]:
    """What a baseline of normal values makes of centre 0 and standard deviation 1: centres, sigmas and weights (p,).

    The mean is normal with variance 1/runs and independent of the moving range, which is one of differences only.

    Raises:
        ValueError: fewer than three runs.
    """
    if runs < 3:
        raise ValueError(f"found a baseline of {runs} runs; expected 3 or more")
    x, w = np.polynomial.hermite_e.hermegauss(centres)
    found, density = _moving_range(runs, sigmas)
    grid = np.meshgrid(x / math.sqrt(runs), found / D2, indexing="ij")
    return grid[0].ravel(), grid[1].ravel(), np.outer(w / w.sum(), density).ravel()


@lru_cache(maxsize=8)
def _moving_range(runs: int, count: int) -> tuple[Array, Array]:
    """Nodes and weights (count,) of the law of the mean of |x_i - x_i-1| of so many independent normal values.

    Neighbours share a value. The characteristic function of the sum is E exp(i w sum |x_i - x_i-1|): the kernel
    exp(i w |x - y|) applied runs - 1 times to the normal density, on a grid; its inversion gives the density.
    """
    x = np.linspace(-GRID, GRID, 97)
    normal = np.exp(-x * x / 2)
    normal /= normal.sum()
    apart = np.abs(x[:, None] - x[None, :])
    mean, variance = (runs - 1) * 2 / math.sqrt(math.pi), (runs - 1) * RANGE_VARIANCE + 2 * (runs - 2) * NEIGHBOURS
    longest = mean + 8 * math.sqrt(variance)
    low = max(mean - 5 * math.sqrt(variance), 0.01 * mean)
    nodes, weights = np.polynomial.legendre.leggauss(count)
    sums = (low + mean + 6.5 * math.sqrt(variance)) / 2 + (mean + 6.5 * math.sqrt(variance) - low) / 2 * nodes
    density = np.full(count, 0.5)
    for k in range(1, MOST_WAVES):
        wave = k * math.pi / longest
        kernel = np.exp(1j * wave * apart) * normal
        found = np.ones(x.size, np.complex128)
        for _ in range(runs - 1):
            found = np.einsum("ij,j->i", kernel, found)  # BLAS would start threads that wait
        characteristic = complex(normal @ found)
        if abs(characteristic) < NOTHING:
            break
        density += np.real(characteristic * np.exp(-1j * wave * sums))
    density = weights * np.maximum(density, 0.0)
    return sums / (runs - 1), density / density.sum()


def no_signal(means: Iterable[float], weight: float, runs: int, *, width: float = WIDTH) -> list[float]:
    """Probabilities that a chart with limits from a baseline of so many runs gives no signal until value 1, 2, … after it.
    With `means` of 0 one less them are those of a false alarm."""
    centres, sigmas, weights = baseline(runs)
    return [float(weights @ s) for s in survival(means, weight, width=width, centre=centres, sigma=sigmas)]
