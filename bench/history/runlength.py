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
from itertools import repeat

import numpy as np

from bench.figures import Array
from bench.history.charts import D2, WIDTH, ewma_settled

RANGE_VARIANCE = 2 - 4 / math.pi  # of |x_1 - x_2|
NEIGHBOURS = (4 / math.pi) * (math.sqrt(0.75) + math.asin(0.5) / 2 - 1)  # covariance of |x_1 - x_2| and |x_2 - x_3|
TAIL = 1e-10  # of the probability that no signal came yet: what follows is taken as geometric
LONGEST = 100_000  # values
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


def baseline(runs: int, centres: int = 9, sigmas: int = 24) -> tuple[Array, Array, Array]:
    """What a baseline of normal values makes of centre 0 and standard deviation 1: centres, sigmas and weights (p,).

    The mean is normal with variance 1/runs and independent of the moving range (of differences only). The mean of runs - 1
    moving ranges over d2 is taken as c chi_nu/sqrt(nu) with its exact mean and variance (Patnaik, Biometrika 37, 78 (1950)):
    neighbours share a value, so that they are correlated.

    Raises:
        ValueError: fewer than three runs.
    """
    if runs < 3:
        raise ValueError(f"found a baseline of {runs} runs; expected 3 or more")
    x, w = np.polynomial.hermite_e.hermegauss(centres)
    mean = 2 / math.sqrt(math.pi) / D2
    variance = ((runs - 1) * RANGE_VARIANCE + 2 * (runs - 2) * NEIGHBOURS) / ((runs - 1) * D2) ** 2
    nu, scale = _chi(variance / mean**2)
    nodes, legendre = np.polynomial.legendre.leggauss(sigmas)
    reach = 4.5 * math.sqrt(variance)
    low, high = max(mean - reach, 0.02), mean + 1.3 * reach
    s = (low + high) / 2 + (high - low) / 2 * nodes
    chi = s * math.sqrt(nu) * scale / mean
    density = legendre * np.exp((nu - 1) * np.log(chi) - chi * chi / 2 - (nu - 1) * math.log(math.sqrt(nu)) + nu / 2)
    grid = np.meshgrid(x / math.sqrt(runs), s, indexing="ij")
    both = np.outer(w / w.sum(), density / density.sum())
    return grid[0].ravel(), grid[1].ravel(), both.ravel()


def _chi(relative_variance: float) -> tuple[float, float]:
    """Degrees of freedom of the chi with that variance over its mean squared, and its mean over sqrt(nu)."""
    low, high = 0.5, 1e6
    for _ in range(200):
        nu = math.sqrt(low * high)
        mean = math.sqrt(2) * math.exp(math.lgamma((nu + 1) / 2) - math.lgamma(nu / 2))
        low, high = (nu, high) if nu / mean**2 - 1 > relative_variance else (low, nu)
    return nu, mean / math.sqrt(nu)


def no_signal(means: Iterable[float], weight: float, runs: int, *, width: float = WIDTH) -> list[float]:
    """Probabilities that a chart with limits from a baseline of so many runs gives no signal until value 1, 2, … after it.
    With `means` of 0 one less them are those of a false alarm."""
    centres, sigmas, weights = baseline(runs)
    return [float(weights @ s) for s in survival(means, weight, width=width, centre=centres, sigma=sigmas)]
