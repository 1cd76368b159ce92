"""The figures of ISO 230-2, by its symbols, of deviations x_ij of approaches j to targets i, from below (up) and from above.

mean_i = 1/n sum x_ij,  s_i = sqrt(1/(n-1) sum (x_ij - mean_i)^2),  R_i = 4 s_i          each way
B_i = mean_i(up) - mean_i(down),     both_i = (mean_i(up) + mean_i(down))/2
R_i = max(2 s_i(up) + 2 s_i(down) + |B_i|, R_i(up), R_i(down))
B = max |B_i|,  B_mean = mean of B_i,  R = max R_i,  M = max both_i - min both_i
E = max mean_i - min mean_i,  A = max(mean_i + 2 s_i) - min(mean_i - 2 s_i)              each way, and over both ways
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
UP, DOWN = 0, 1
FIGURES = ("A", "A_up", "A_down", "R", "R_up", "R_down", "E", "E_up", "E_down", "M", "B", "B_mean")


@dataclass(frozen=True)
class ByTarget:
    """Of each target: `mean` and `s` each way (..., 2, m), up and down; `reversal` B_i, `repeatability` R_i (..., m)."""

    mean: Array
    s: Array
    reversal: Array
    repeatability: Array


def by_target(x: Array) -> ByTarget:
    """Of deviations (..., 2, m, n): ways, targets, approaches."""
    mean, s = x.mean(axis=-1), x.std(axis=-1, ddof=1)
    reversal = mean[..., UP, :] - mean[..., DOWN, :]
    both = 2 * s.sum(axis=-2) + np.abs(reversal)
    return ByTarget(mean, s, reversal, np.maximum(both, 4 * s.max(axis=-2)))


def figures(x: Array) -> Array:
    """FIGURES of deviations (..., 2, m, n), as (..., 12). What all deviations share cancels."""
    t = by_target(x)
    high, low = t.mean + 2 * t.s, t.mean - 2 * t.s
    both = t.mean.mean(axis=-2)
    out = [
        high.max(axis=(-2, -1)) - low.min(axis=(-2, -1)),
        *(high[..., k, :].max(axis=-1) - low[..., k, :].min(axis=-1) for k in (UP, DOWN)),
        t.repeatability.max(axis=-1),
        *(4 * t.s[..., k, :].max(axis=-1) for k in (UP, DOWN)),
        t.mean.max(axis=(-2, -1)) - t.mean.min(axis=(-2, -1)),
        *(np.ptp(t.mean[..., k, :], axis=-1) for k in (UP, DOWN)),
        np.ptp(both, axis=-1),
        np.abs(t.reversal).max(axis=-1),
        t.reversal.mean(axis=-1),
    ]
    return np.stack(out, axis=-1)
