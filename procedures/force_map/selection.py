"""Which terms of a linear model the data can justify: every subset, judged by leaving one operating point out.

Deterministic: nothing is drawn, and points are left out one at a time with all their rows (F_x and F_y of one point
share its errors in position and current, so half a point would help to predict its other half).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
LEVERAGE = 1e-9  # a point whose leverage is closer to one than this determines a term by itself


@dataclass(frozen=True)
class Candidate:
    """The best model of its size: `loss` is the mean square of the prediction error of points left out, per point;
    `worse` its excess over the best size's, and `u_worse` the standard error of that (paired, over the points)."""

    terms: tuple[str, ...]
    loss: float
    worse: float
    u_worse: float

    @property
    def as_good(self) -> bool:
        """Not worse than the best by more than one standard error."""
        return self.worse <= self.u_worse


@dataclass(frozen=True)
class Selection:
    """`path`: the best model of each size, smallest first; `chosen`: the smallest that is as good as the best, None
    where fewer than two points can be spared; `spared` (n,): which points were left out in turn."""

    path: tuple[Candidate, ...]
    chosen: Candidate | None
    spared: npt.NDArray[np.bool_]


def left_out_errors(design: Array, measured: Array, u: Array | None) -> Array:
    """(n, r): error of each point as predicted by a fit without it, over u; nan for points that cannot be spared.

    For linear least squares it needs no second fit: e_-k = (1 - H_kk)^-1 e_k with H_kk the (r, r) block of the
    projector (Cook and Weisberg, Residuals and Influence in Regression, 1982, 2.2.2, for a group of rows). All nan
    where the points do not determine the terms.
    """
    errors: Array = _of_subsets(design, measured, u, np.arange(design.shape[2])[None])[0]
    return errors


def _of_subsets(design: Array, measured: Array, u: Array | None, columns: npt.NDArray[np.intp]) -> Array:
    """(s, n, r): the same for each of `columns` (s, k), subsets of one size. A = Q R is decomposed once: the columns of a
    subset are Q times those of R, which are few."""
    points, rows, terms = design.shape
    weight = np.ones(measured.shape) if u is None else 1 / u
    out = np.full((len(columns), points, rows), np.nan)
    a = (design * weight[:, :, None]).reshape(-1, terms)
    if len(a) < columns.shape[1]:
        return out
    norms = np.linalg.norm(a, axis=0)
    q, r = np.linalg.qr(a / np.where(norms > 0, norms, 1))
    inner, corner = np.linalg.qr(r.T[columns].swapaxes(1, 2))
    diagonal = np.abs(np.diagonal(corner, axis1=1, axis2=2))
    clear = diagonal.min(axis=1) > LEVERAGE * diagonal.max(axis=1)
    bases = q @ inner[clear]
    y = (measured * weight).reshape(-1)
    residual = (y - (bases @ (y @ bases)[:, :, None])[:, :, 0]).reshape(-1, points, rows)
    blocks = bases.reshape(-1, points, rows, columns.shape[1])
    spare = np.eye(rows) - blocks @ blocks.swapaxes(2, 3)
    can = np.linalg.eigvalsh(spare)[:, :, 0] > LEVERAGE
    found = np.full(residual.shape, np.nan)
    found[can] = np.linalg.solve(spare[can], residual[can][:, :, None])[:, :, 0]
    out[clear] = found
    return out


def select(design: Array, measured: Array, u: Array | None, terms: Sequence[str]) -> Selection:
    """The best subset of each size by the mean squared error of points left out, and the smallest as good as the best.

    `design` (n, r, k) has a column for each of `terms`; `measured` and `u` are (n, r). The one-standard-error rule
    compares point by point (paired): a term that tells nothing is then kept in about one case in a hundred and fifty
    (|t| above 1 + sqrt(3)). A point without which the full model has no solution is in every fit and never left out.
    """
    spared: npt.NDArray[np.bool_] = np.isfinite(left_out_errors(design, measured, u)[:, 0])
    if spared.sum() < 2:
        return Selection((), None, spared)
    best: list[tuple[tuple[str, ...], Array]] = []
    for size in range(1, len(terms) + 1):
        subsets = np.array(list(combinations(range(len(terms)), size)))
        squares = (_of_subsets(design, measured, u, subsets)[:, spared] ** 2).sum(axis=2)
        losses = squares.mean(axis=1)
        if np.isfinite(losses).any():
            found = int(np.nanargmin(losses))
            best.append((tuple(terms[k] for k in subsets[found]), squares[found]))
    reference = min((squares for _, squares in best), key=lambda s: float(s.mean()))
    path = tuple(_against(names, squares, reference) for names, squares in best)
    return Selection(path, next(c for c in path if c.as_good), spared)


def _against(names: tuple[str, ...], squares: Array, reference: Array) -> Candidate:
    excess = squares - reference
    u = float(excess.std(ddof=1) / np.sqrt(len(excess)))
    return Candidate(names, float(squares.mean()), float(excess.mean()), u)
