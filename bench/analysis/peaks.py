"""The maximum of abs of a noisy complex curve: interpolated between its lines, without the bias of picking the greatest.

The greatest of many noisy values is too great. Two things help. The curve is smooth: around each line a local rational model
z = (a + b u + c u^2)/(1 + d u) is fitted to the lines around it (McKelvey and Guerin, IFAC Proc. 45-16, 424 (2012)), which a
resonance passes unharmed and noise does not. As many lines are taken as the noise lets the model explain. And what bias is
left is measured: noise of the known covariance is drawn onto the smooth curve, the same estimator applied, and its mean
excess and its quantiles are taken off (basic parametric bootstrap, Davison and Hinkley, Bootstrap Methods, 5.2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.analysis.sampling import Array, Complex
from bench.analysis.vectors import complexes
from bench.errors import AnalysisError

WINDOWS = (9, 13, 19, 27, 39)  # lines of a local model of four complex terms
WINDOW = WINDOWS[0]
FINE = 4  # points between two lines
DRAWS = 300
NARROW = 0.02  # of a window, for its second derivative
NEAR_POLE = 0.5  # a denominator that falls so low between lines is noise


@dataclass(frozen=True)
class Peak:
    """Greatest abs of a curve: `value`, freed of bias; 95 % interval [`low`, `high`]; `u` the estimator's scatter; `at`, where,
    in the unit of the abscissa, with `u_at`; `raw`, the greatest of the measured lines; `bias` that was taken off."""

    value: float
    low: float
    high: float
    u: float
    at: float
    u_at: float
    raw: float
    bias: float


@dataclass(frozen=True)
class _Windows:
    """Which lines each local model takes (m, w), their places u (m, w), the places between lines (m, f), in its own scale."""

    lines: npt.NDArray[np.intp]
    u: Array
    between: Array
    scale: Array


def peak(x: npt.ArrayLike, values: npt.ArrayLike, covariance: Array, *, seed: int = 0, draws: int = DRAWS) -> Peak:
    """Of a curve `values` (m,) complex at `x` (m,) ascending, with covariances (m, 2, 2) of lines independent of each other.

    Lines should stand no farther apart than half of the narrowest resonance's half-power width. Of a curve that is flat within
    its noise over many lines some bias is left, and the interval is too narrow: average longer there.

    Raises:
        AnalysisError: fewer than nine lines, or shapes that do not match.
    """
    place, z = np.asarray(x, np.float64), np.asarray(values, np.complex128)
    if place.shape != z.shape or covariance.shape != (z.size, 2, 2) or z.size < WINDOW:
        raise AnalysisError(
            f"peak: found {z.size} lines, covariance {covariance.shape}; expected {WINDOW} or more of each"
        )
    pooled = pooled_covariance(covariance)
    chosen = _near_top(z, pooled)
    weight = 1 / np.maximum(np.trace(pooled, axis1=1, axis2=2), 1e-300)
    width = _width(place, z, weight, int(np.argmax(np.abs(z))))
    at = _windows(place, chosen, width)
    found, where = _top(z, at, weight, place[chosen])
    smooth = _models(z, _windows(place, np.arange(z.size), width), weight)[..., 0]
    base, _ = _top(smooth, at, weight, place[chosen])
    drawn, places = _top(smooth + noise(pooled, seed, draws), at, weight, place[chosen])
    bias = float(drawn.mean() - base)
    low, high = np.quantile(drawn, [0.975, 0.025])
    return Peak(
        float(found - bias),
        float(found - (low - base)),
        float(found - (high - base)),
        float(drawn.std()),
        float(where),
        max(float(places.std()), _apart(place, float(where)) / math.sqrt(12)),
        float(np.abs(z).max()),
        bias,
    )


@dataclass(frozen=True)
class Smoother:
    """Local models about every line of a curve; `x` ascending, where they are evaluated: at the lines and between them."""

    x: Array
    _windows: _Windows
    _weight: Array
    _order: npt.NDArray[np.intp]

    def at_lines(self, values: Complex) -> Complex:
        """Curves (..., m) smoothed, at their lines."""
        return _models(values, self._windows, self._weight)[..., 0]

    def everywhere(self, values: Complex) -> Complex:
        """Curves (..., m) smoothed, at `x`."""
        fine = _models(values, self._windows, self._weight)
        return fine.reshape(*values.shape[:-1], -1)[..., self._order]

    def excess(self, values: Complex, drawn: Complex) -> Array:
        """By how much a curve (m,) scatters about its local models more than curves (d, m) that were drawn with the noise it
        is said to have: ratio (m,) of the mean squares, each over the widest window about its line."""
        found, usual = (self._scatter(each) for each in (values, drawn))
        return np.asarray(found / usual.mean(axis=0))

    def _scatter(self, values: Complex) -> Array:
        from scipy.ndimage import uniform_filter1d

        around = min(WINDOWS[-1], values.shape[-1])
        return np.asarray(uniform_filter1d(_misfit(values, self._windows, self._weight), around, mode="nearest"))

    def curvature(self, values: Complex) -> Complex:
        """Second derivatives (..., m) of curves (..., m) by the abscissa, at their lines."""
        places = np.tile([-NARROW, 0.0, NARROW], (self._windows.u.shape[0], 1))
        low, at, high = np.moveaxis(_evaluated(values, self._windows, self._weight, places), -1, 0)
        return np.asarray((low - 2 * at + high) / (NARROW * self._windows.scale) ** 2)


def smoother(
    x: Array, values: Complex, covariance: Array, lines: int | None = None, *, about: Sequence[float] = ()
) -> Smoother:
    """For curves at `x` (m,) ascending that scatter by `covariance` (m, 2, 2) about something like `values` (m,). A model takes
    `lines` lines, or else as many as the noise lets it explain about the greatest of `values` and `about` other places: a
    broad summit allows for more lines than a narrow one of nearly its height."""
    weight = 1 / np.maximum(np.trace(covariance, axis1=1, axis2=2), 1e-300)
    looked = {int(np.argmax(np.abs(values))), *(int(np.argmin(np.abs(x - one))) for one in about)}
    windows = _windows(x, np.arange(x.size), lines or min(_width(x, values, weight, k) for k in looked))
    places = (x[:, None] + windows.between * windows.scale[:, None]).ravel()
    order = np.argsort(places, kind="stable")
    return Smoother(places[order], windows, weight, order)


def _width(x: Array, z: Complex, weight: Array, line: int) -> int:
    """The most lines with which the local models about a line misfit by no more than the noise explains."""
    width = WINDOW
    for w in WINDOWS[1:]:
        if w > z.size:
            break
        near = np.arange(max(0, line - w // 2), min(z.size, line + w // 2 + 1))
        at = _windows(x, near, w)
        if _misfit(z, at, weight).mean() > 1 + 2 / np.sqrt(w - 4):
            break
        width = w
    return width


def _misfit(z: Complex, at: _Windows, weight: Array) -> Array:
    """Weighted mean square residual (..., k) of the local models, a little above 1 where noise is all there is."""
    off = (weight[at.lines] * np.abs(z[..., at.lines] - _evaluated(z, at, weight, at.u)) ** 2).sum(axis=-1)
    return np.asarray(off / (at.u.shape[1] - 4))


def pooled_covariance(covariance: Array) -> Array:
    """Covariances (m, 2, 2) averaged over the lines of a window: noise hardly changes from line to line."""
    half = WINDOW // 2
    sums = np.cumsum(np.concatenate([np.zeros((1, 2, 2)), covariance]), axis=0)
    m = len(covariance)
    low, high = np.clip(np.arange(m) - half, 0, m), np.clip(np.arange(m) + half + 1, 0, m)
    out: Array = (sums[high] - sums[low]) / (high - low)[:, None, None]
    return out


def noise(covariance: Array, seed: int, draws: int) -> Complex:
    """Normal complex noise (draws, m) of covariances (m, 2, 2)."""
    scale = np.maximum(np.trace(covariance, axis1=1, axis2=2), 1e-300)[:, None, None]
    root = np.linalg.cholesky(covariance / scale + 1e-12 * np.eye(2)) * np.sqrt(scale)
    normal = np.random.default_rng(seed).standard_normal((draws, len(covariance), 2))
    return complexes(np.einsum("mij,dmj->dmi", root, normal))[..., 0]


def _near_top(z: Complex, covariance: Array) -> npt.NDArray[np.intp]:
    """Lines that may be the greatest, within five standard deviations, and their neighbours."""
    size, u = np.abs(z), np.sqrt(np.trace(covariance, axis1=1, axis2=2))
    can = size + 5 * u >= (size - 5 * u).max()
    can[1:] |= can[:-1].copy()
    can[:-1] |= can[1:].copy()
    return np.flatnonzero(can)


def _windows(x: Array, chosen: npt.NDArray[np.intp], width: int) -> _Windows:
    start = np.clip(chosen - width // 2, 0, x.size - width)
    lines = start[:, None] + np.arange(width)
    scale = (x[lines[:, -1]] - x[lines[:, 0]]) / 2
    u = (x[lines] - x[chosen, None]) / scale[:, None]
    left = np.where(chosen > 0, x[chosen] - x[np.maximum(chosen - 1, 0)], 0.0) / 2
    right = np.where(chosen < x.size - 1, x[np.minimum(chosen + 1, x.size - 1)] - x[chosen], 0.0) / 2
    steps = np.linspace(0, 1, FINE // 2 + 1)[1:]
    between = np.concatenate([np.zeros((chosen.size, 1)), -left[:, None] * steps, right[:, None] * steps], axis=1)
    return _Windows(lines, u, between / scale[:, None], scale)


def _models(z: Complex, at: _Windows, weight: Array) -> Complex:
    """Values (..., k, f) of the local models at their line and between it and its neighbours."""
    return _evaluated(z, at, weight, at.between)


def _evaluated(z: Complex, at: _Windows, weight: Array, v: Array) -> Complex:
    """Values (..., k, f) of the local models at places v (k, f) of their own scale.

    (1 + d u) z = a + b u + c u^2 in least squares: what is not a parabola in z and in u z gives d; a, b, c follow.
    """
    root = np.sqrt(weight[at.lines])
    powers = np.stack([np.ones_like(at.u), at.u, at.u**2], axis=-1)
    basis, upper = np.linalg.qr(powers * root[..., None])  # (k, w, 3), the same for every curve
    shape = np.linalg.solve(np.swapaxes(upper, -1, -2), np.stack([np.ones_like(v), v, v**2], axis=-2))
    curves = np.ascontiguousarray(z.reshape(-1, z.shape[-1]).T)  # (m, n): all of a line's values together
    near = curves[at.lines] * root[..., None]
    turned = near * at.u[..., None]
    p, q = (_applied(np.swapaxes(basis, -1, -2), x) for x in (near, turned))
    cross = (turned.conj() * near).sum(axis=1) - (q.conj() * p).sum(axis=1)
    square = (np.abs(turned) ** 2).sum(axis=1)
    own = square - (np.abs(q) ** 2).sum(axis=1)
    d = (-cross / np.maximum(own, 1e-12 * square + 1e-300))[:, None]
    to_places = np.swapaxes(shape, -1, -2)
    below = 1 + d * v[..., None]
    above = _applied(to_places, p) + d * _applied(to_places, q)
    if v is at.between:
        found = np.where(np.abs(below) > NEAR_POLE, above / np.where(below == 0, 1, below), above[:, :1])
    else:
        found = above / np.where(np.abs(below) > 1e-6, below, 1e-6)
    out: Complex = np.moveaxis(found, -1, 0).reshape(*z.shape[:-1], *v.shape)
    return out


def _applied(matrices: Array, columns: Complex) -> Complex:
    """Real matrices (k, i, j) on complex columns (k, j, n)."""
    return np.asarray(np.matmul(matrices, columns.view(np.float64))).view(np.complex128)


def _apart(x: Array, where: float) -> float:
    """How far the places about `where` are apart at which the models are looked at."""
    k = int(np.argmin(np.abs(x - where)))
    return float(np.diff(x[max(k - 1, 0) : k + 2]).max()) / FINE


def _top(z: Complex, at: _Windows, weight: Array, x: Array) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Greatest abs (...,) of the local models, and where."""
    size = np.abs(_models(z, at, weight))
    places = x[:, None] + at.between * at.scale[:, None]
    flat = size.reshape(*size.shape[:-2], -1)
    k = flat.argmax(axis=-1)
    return np.take_along_axis(flat, k[..., None], -1)[..., 0], places.reshape(-1)[k]
