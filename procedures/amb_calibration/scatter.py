"""Scatter of a mass-hanging fit: what the residuals say about the means over a turn, and about single hangings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from procedures.amb_calibration.fit import Fit, Hangings

Array = npt.NDArray[np.float64]
OUTPUTS = ("K_i", "K2_i", "Kw_i", "K_o", "K2_o", "Kw_o")
CARRIED = ("F0_i", "F0_o")
"""By angle only: F_0 of each bearing (see `fit.carried`)."""
ORDER = (0, 1, 2, 4, 5, 6, 3, 7)  # from K, K2, Kw, F_0 of one bearing and of the other to OUTPUTS and CARRIED


@dataclass(frozen=True)
class Scatter:
    """`rest` (2, A, P) N: residuals freed of what is common to a load; `level_means` (2, L) N per load, nothing first;
    `covariance` (2, 2, A, P) N^2 of one hanging, between the bearings; `dof` of it."""

    rest: Array
    level_means: Array
    covariance: Array
    dof: int


def scatter(f: Fit, h: Hangings, masses: int) -> Scatter:
    """Split residuals into a part common to each load (wrong masses, wrong model) and the rest, and model the rest.

    A load that seats differently each time scatters with its weight, noise does not; so the covariance of a hanging is
    a + g W^2, fitted by moments: E[e e'] = sum_q T_q T'_q (a + g W_q^2), T the map from errors to the rest. Degrees
    of freedom: A (P - 4) from the fits, less the L - 3 that the load means take.
    """
    angles, points = h.load.shape
    levels = masses + 1
    membership = np.eye(levels)[h.load.reshape(-1) + 1]  # (A P, L)
    averaging = (membership / membership.sum(axis=0)).T  # (L, A P)
    residuals = f.residuals.reshape(2, -1)
    rest = residuals - residuals @ averaging.T @ membership.T
    common = np.eye(angles * points) - membership @ averaging
    maps = np.stack([common @ residual_maker(f, b) for b in (0, 1)])
    weight = (f.forces[1].reshape(-1) / np.abs(f.forces[1]).max()) ** 2  # relative load squared, about 0..1
    basis = np.stack([np.ones_like(weight), weight])  # (2, A P)
    covariance = np.zeros((2, 2, angles * points))
    for b in (0, 1):
        for c in (0, b):
            expected = (maps[b] * maps[c]) @ basis.T
            seen = rest[b] * rest[c]
            a, g = np.linalg.lstsq(expected, seen, rcond=None)[0]
            if b == c and min(a, g) <= 0:  # a variance cannot be negative: keep the term that explains more
                a, g = max((seen.sum() / expected[:, 0].sum(), 0.0), (0.0, seen.sum() / expected[:, 1].sum()),
                           key=lambda ag: -float(((seen - expected @ np.array(ag)) ** 2).sum()))  # fmt: skip
            covariance[b, c] = covariance[c, b] = np.array([a, g]) @ basis
    bound = 0.999 * np.sqrt(covariance[0, 0] * covariance[1, 1])
    covariance[0, 1] = covariance[1, 0] = np.clip(covariance[0, 1], -bound, bound)
    dof = angles * (points - 4) - (levels - 3)
    shape = (2, angles, points)
    return Scatter(rest.reshape(shape), residuals @ averaging.T, covariance.reshape(2, *shape), dof)


def residual_maker(f: Fit, b: int) -> Array:
    """Block-diagonal (A P, A P) map from force errors to residuals of bearing b."""
    angles, points = f.residuals.shape[1:]
    out = np.zeros((angles * points, angles * points))
    for a in range(angles):
        block = slice(a * points, (a + 1) * points)
        out[block, block] = np.eye(points) - np.linalg.pinv(f.solvers[b, a]) @ f.solvers[b, a]
    return out


def covariance_by_angle(f: Fit, s: Scatter, own_load: Array) -> Array:
    """Type A covariance (A, 8, 8) of the terms at each angle, in the order of OUTPUTS and CARRIED.

    `own_load` (2,) N is the force at own weight in the fit's frame (see `fit.tangents`). Hangings are
    independent of each other; the two bearings of one hanging are not (a load that seats badly moves both).
    """
    maps = np.stack([_term_gradients(f.terms[b], own_load[b]) @ f.solvers[b] for b in (0, 1)])  # (2, A, 4, P)
    blocks: Array = np.einsum("bamp,canp,bcap->abmcn", maps, maps, s.covariance)
    ordered: Array = blocks.reshape(-1, 8, 8)[np.ix_(range(len(blocks)), ORDER, ORDER)]
    return ordered


def covariance_over_a_turn(by_angle: Array) -> Array:
    """Type A covariance (8, 8) of the means over a turn; angles share no hanging."""
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
