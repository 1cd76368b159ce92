"""Scatter of a mass-hanging fit: what the residuals say about the means over a turn, and about single hangings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from procedures.amb_calibration.fit import Fit, Hangings

Array = npt.NDArray[np.float64]
TERMS = ("K", "K2", "Kw")
OUTPUTS = ("K_i", "K2_i", "Kw_i", "K_o", "K2_o", "Kw_o")
"""Of the servomotor, as `outputs` has them."""
FLOOR = 1e-6  # of the greatest eigenvalue of the covariance between axes: the least
SHARES = np.geomspace(1e-8, 1.0, 81)  # of the variance of the heaviest load that noise may be
FREE = 1e-9  # of the greatest singular value: what is less is taken by the fits
MOST_ALIKE = 0.999  # correlation between two axes


@dataclass(frozen=True)
class Scatter:
    """`rest` (K, A, P) N: residuals freed of what is common to a load; `level_means` (K, L) N per load, nothing first;
    `covariance` (K, K, A, P) N^2 of one hanging, between the axes; `dof` of it."""

    rest: Array
    level_means: Array
    covariance: Array
    dof: int


def outputs(keys: tuple[str, ...]) -> tuple[str, ...]:
    """Of axes by key: K, K2 and Kw of the first, then of the next."""
    return tuple(f"{name}_{key}" for key in keys for name in TERMS)


def carried(keys: tuple[str, ...]) -> tuple[str, ...]:
    """By angle only: F_0 of each axis (see `fit.carried`)."""
    return tuple(f"F0_{key}" for key in keys)


def scatter(f: Fit, h: Hangings, masses: int) -> Scatter:
    """Split residuals into a part common to each load (wrong masses, wrong model) and the rest, and model the rest.

    A load that seats differently each time scatters with its weight, noise does not; so the covariance of a hanging is
    a + g W^2, each of a and g by itself one that a covariance can be, fitted by moments: E[e e'] = sum_q T_q T'_q
    (a + g W_q^2), T the map from errors to the rest. Degrees of freedom: A (P - 4) from the fits, less the L - 3 that the load
    means take.
    """
    angles, points = h.load.shape
    levels = masses + 1
    membership = np.eye(levels)[h.load.reshape(-1) + 1]  # (A P, L)
    averaging = (membership / membership.sum(axis=0)).T  # (L, A P)
    axes = len(f.residuals)
    residuals = f.residuals.reshape(axes, -1)
    rest = residuals - residuals @ averaging.T @ membership.T
    common = np.eye(angles * points) - membership @ averaging
    maps = np.stack([common @ residual_maker(f, b) for b in range(axes)])
    most = f.forces[int(np.argmax(np.abs(f.forces).max(axis=(1, 2))))]
    weight = (most.reshape(-1) / np.abs(most).max()) ** 2  # relative load squared, about 0..1
    basis = np.stack([np.ones_like(weight), weight])  # (2, A P)
    covariance = np.einsum("bcq,qn->bcn", _amounts(maps, rest, basis), basis)
    dof = angles * (points - 4) - (levels - 3)
    shape = (axes, angles, points)
    return Scatter(rest.reshape(shape), residuals @ averaging.T, covariance.reshape(axes, *shape), dof)


def _amounts(maps: Array, rest: Array, basis: Array) -> Array:
    """Of each of the `basis` (2, A P) how much there is of it between the axes, (K, K, 2) N^2. The errors of hangings are two,
    one that all have and one that goes with the load; each has its own correlation between two axes, and an error that an
    axis does not show is correlated with nothing: bounded as a sum they could leave a heavy load without scatter."""
    axes = range(len(maps))
    out = np.zeros((len(maps), len(maps), len(basis)))
    for b in axes:
        expected, seen = (maps[b] * maps[b]) @ basis.T, rest[b] * rest[b]
        a, g = np.linalg.lstsq(expected, seen, rcond=None)[0]
        if a <= 0 < g:
            a, g = _likeliest(maps[b], rest[b], basis)
        elif g <= 0:  # a variance cannot be negative
            a, g = max(seen.sum() / expected[:, 0].sum(), 0.0), 0.0
        out[b, b] = a, g
    for b in axes:
        for c in range(b):
            bound = MOST_ALIKE * np.sqrt(out[b, b] * out[c, c])
            if (both := bound > 0).any():
                expected = (maps[b] * maps[c]) @ basis[both].T
                found = np.linalg.lstsq(expected, rest[b] * rest[c], rcond=None)[0]
                out[b, c, both] = out[c, b, both] = np.clip(found, -bound[both], bound[both])
    return _possible(out)


def _likeliest(to_rest: Array, rest: Array, basis: Array) -> tuple[float, float]:
    """How much there is of noise and of what goes with the load, N^2, by the likelihood of the rest (restricted: of what no
    fit can take). Where loads scatter by many times the noise, moments tell nothing of the noise, and a hanging without load
    would be left without any: then the load means contradict each other, however little they differ."""
    _, size, rows = np.linalg.svd(to_rest)
    rows = rows[: int((size > FREE * size[0]).sum())]
    z = rows @ np.linalg.lstsq(to_rest, rest, rcond=FREE)[0]
    found = []
    for share in SHARES:
        covariance = (rows * (share * basis[0] + basis[1])) @ rows.T
        g = float(z @ np.linalg.solve(covariance, z)) / z.size
        found.append((-z.size * np.log(g) - np.linalg.slogdet(covariance)[1], g, share))
    _, g, share = max(found)
    return share * g, g


def _possible(amounts: Array) -> Array:
    """Of more than two axes (K, K, 2), what a covariance can be: no negative variance of any sum."""
    if len(amounts) < 3:
        return amounts
    values, vectors = np.linalg.eigh(np.moveaxis(amounts, 2, 0))
    kept = np.maximum(values, FLOOR * values.max(axis=1, keepdims=True))
    return np.moveaxis(np.einsum("nij,nj,nkj->nik", vectors, kept, vectors), 0, 2)


def residual_maker(f: Fit, b: int) -> Array:
    """Block-diagonal (A P, A P) map from force errors to residuals of bearing b."""
    angles, points = f.residuals.shape[1:]
    out = np.zeros((angles * points, angles * points))
    for a in range(angles):
        block = slice(a * points, (a + 1) * points)
        out[block, block] = np.eye(points) - np.linalg.pinv(f.solvers[b, a]) @ f.solvers[b, a]
    return out


def covariance_by_angle(f: Fit, s: Scatter, own_load: Array) -> Array:
    """Type A covariance (A, 4 K, 4 K) of the terms at each angle, in the order of `outputs` and `carried`.

    `own_load` (K,) N is the force at own weight in the fit's frame (see `fit.tangents`). Hangings are
    independent of each other; the axes of one hanging are not (a load that seats badly moves both bearings).
    """
    axes = range(len(f.terms))
    maps = np.stack([_term_gradients(f.terms[b], own_load[b]) @ f.solvers[b] for b in axes])  # (K, A, 4, P)
    blocks: Array = np.einsum("bamp,canp,bcap->abmcn", maps, maps, s.covariance)
    order = [*(4 * b + term for b in axes for term in range(3)), *(4 * b + 3 for b in axes)]
    ordered: Array = blocks.reshape(-1, len(order), len(order))[np.ix_(range(len(blocks)), order, order)]
    return ordered


def covariance_over_a_turn(by_angle: Array) -> Array:
    """Type A covariance (4 K, 4 K) of the means over a turn; angles share no hanging."""
    covariance: Array = by_angle.sum(axis=0) / len(by_angle) ** 2
    return covariance


def _term_gradients(terms: Array, own: float) -> Array:
    """d(K, K2, Kw, F_0)/d(F_0, K, K2, H) at each angle, (A, 4, 4)."""
    f0, k, k2 = terms[:, 0], terms[:, 1], terms[:, 2]
    slope = np.sign(k) * np.sqrt(np.maximum(k**2 + 4 * k2 * (own - f0), 1e-9))
    out = np.zeros((len(terms), 4, 4))
    out[:, 0, 1] = 1
    out[:, 1, 2] = 1
    out[:, 2, 0] = -2 * k2 / slope
    out[:, 2, 1] = k / slope
    out[:, 2, 2] = 2 * (own - f0) / slope
    out[:, 3, 0] = 1
    return out
