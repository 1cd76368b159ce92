"""What else the balance of torques may hold: one more column in its fit, and how far it is from nothing."""

from __future__ import annotations

import math

import numpy as np

from procedures.torque_constant.fit import Array, Balance, Extra, Steps


def extra(b: Balance, column: Array) -> Extra:
    """Value of one more linear term with `column` (n,) A per unit, all other terms fitted along (a score test)."""
    jacobian, residuals, white = b.fit.jacobian / b.u[:, None], b.fit.residuals / b.u, column / b.u
    apart = white - jacobian @ np.linalg.lstsq(jacobian, white, rcond=None)[0]
    size = float(apart @ apart)
    if size <= 1e-12 * float(white @ white):
        return Extra(0.0, math.inf)
    value = float(apart @ residuals) / size
    rest = float(((residuals - value * apart) ** 2).sum()) / max(b.dof - 1, 1)
    return Extra(value, math.sqrt(rest / size))


def loaded(b: Balance) -> Array:
    """Part of the fitted current that carries the loads, (n,) A."""
    out: Array = b.current - b.fit.residuals - b.base
    return out


def ratio_of_sides(b: Balance, s: Steps) -> Extra:
    """Relative excess of the torque on the left over that on the right that the data see beside the certificates."""
    found = extra(b, loaded(b) * s.side)
    return Extra(2 * found.value, 2 * found.u)


def of_load(b: Balance, s: Steps, load: int) -> Extra:
    """Relative excess of one load that would make it agree with the others."""
    return extra(b, loaded(b) * (s.load == load))


def shape_over_gamma(b: Balance, s: Steps) -> tuple[float, float]:
    """Whether the torque follows the cosine: probability of the misfit by chance (F test), and the largest relative deviation
    of a torque per current that the data show at a phase angle.

    Tried are the relative deviations over gamma that neither alpha_tau (the same at each) nor gamma_0 (tan(M (gamma -
    gamma_0)), to first order) nor a drift of the scale (the time of each) can make. What the arms and each mass are off by
    is fitted along: it is no matter of gamma.
    """
    from scipy import special

    angles, index = np.unique(s.gamma, return_inverse=True)
    when = np.array([s.time[index == k].mean() for k in range(len(angles))])
    taken = np.column_stack([np.ones_like(angles), np.tan(b.pole_pairs * (angles - b.gamma_0)), when - when.mean()])
    shapes = np.linalg.svd(taken)[0][:, 3:]  # (angles, angles - 3), orthonormal, at right angles to these
    if not shapes.shape[1]:
        return 1.0, 0.0
    carried = loaded(b) / b.u
    beside = [carried * s.side, *(carried * (s.load == k) for k in range(1, s.load.max() + 1))]
    known = np.column_stack([b.fit.jacobian / b.u[:, None], *beside])
    tried, residuals = carried[:, None] * shapes[index], b.fit.residuals / b.u
    design = np.column_stack([known, tried])
    dof = len(residuals) - np.linalg.matrix_rank(design)
    terms = np.linalg.lstsq(design, residuals, rcond=None)[0]
    rest = float(((residuals - design @ terms) ** 2).sum())
    without = residuals - known @ np.linalg.lstsq(known, residuals, rcond=None)[0]
    if dof < 1 or rest <= 0:
        return 1.0, 0.0
    more = shapes.shape[1]
    excess = max(float((without**2).sum()) - rest, 0.0) / more / (rest / dof)
    return float(special.fdtrc(more, dof, excess)), float(np.abs(shapes @ terms[-more:]).max())
