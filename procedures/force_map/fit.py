"""The static force-torque model of a self-bearing servomotor, linear in its parameters (thesis (5.25), with beta_4).

With P poles, rotor angle theta, displacements x, y of the rotor and currents i_x, i_y, i_theta (i_t below),

    F_x = [a1 - a2 cos(P theta)] i_x - a3 sin(P theta) i_y - a4 y i_t + a5 x + a6 i_y i_t - a7 sin(P theta) i_x i_t
          + a8 x [2 pi i_t^2 + (pi + 2) i_y^2 + (pi - 2) i_x^2] + a9 y sin(P theta) (i_x^2 - i_y^2)           (5.25a)
    F_y = [a1 - a2 cos(P theta)] i_y + a3 sin(P theta) i_x + a4 x i_t + a5 y - a6 i_x i_t - a7 sin(P theta) i_y i_t
          + a8 y [2 pi i_t^2 + (pi + 2) i_x^2 + (pi - 2) i_y^2] + a9 x sin(P theta) (i_x^2 - i_y^2)           (5.25b)
    tau = b1 i_t + b2 (x i_y - y i_x) + b3 (x i_x + y i_y) sin(P theta) + b4 cos(3 P theta) i_t               (5.25c)

the last term being the one that the thesis adds for concentrated windings. One operating point gives two force rows,
which share their nine parameters, and one torque row.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from procedures.shared.leastsquares import linear

CROSS = "cross"

Array = npt.NDArray[np.float64]

UNITS = {
    "alpha_1": "N/A", "alpha_2": "N/A", "alpha_3": "N/A", "alpha_4": "N/(A m)", "alpha_5": "N/m", "alpha_6": "N/A^2",
    "alpha_7": "N/A^2", "alpha_8": "N/(A^2 m)", "alpha_9": "N/(A^2 m)",
    "beta_1": "N m/A", "beta_2": "N/A", "beta_3": "N/A", "beta_4": "N m/A",
}  # fmt: skip
FORCE_TERMS = tuple(name for name in UNITS if name.startswith("alpha"))
TORQUE_TERMS = tuple(name for name in UNITS if name.startswith("beta"))
ABOUT = {
    "alpha_1": "direct force, mean over an electrical period",
    "alpha_2": "direct force ripple",
    "alpha_3": "orthogonal force ripple",
    "alpha_4": "displacement across the force, with torque current",
    "alpha_5": "pull of the magnets off centre (negative stiffness)",
    "alpha_6": "side pull by torque current, centred",
    "alpha_7": "ripple of the side pull",
    "alpha_8": "pull of the windings off centre",
    "alpha_9": "ripple of the windings' pull off centre",
    "beta_1": "torque, mean over an electrical period",
    "beta_2": "torque of bearing currents off centre",
    "beta_3": "ripple of that torque",
    "beta_4": "torque ripple of concentrated windings",
}
DEGENERATE = 1e-9  # singular value of the column-scaled design, against the largest, that counts as zero
PART = 1e-6  # share of a term in the null space that counts as none


@dataclass(frozen=True)
class Points:
    """Operating points, each array (n,): currents A, displacements m, angle rad."""

    i_x: Array
    i_y: Array
    i_theta: Array
    x: Array
    y: Array
    theta: Array

    def __len__(self) -> int:
        return len(self.i_x)


def force_design(p: Points, poles: int) -> Array:
    """(n, 2, 9): what multiplies alpha_1 .. alpha_9 in F_x and in F_y of each point (5.25a, b)."""
    s, c, q = _exact(np.sin(poles * p.theta)), _exact(np.cos(poles * p.theta)), p.i_x**2 - p.i_y**2
    wound_x = p.x * (2 * np.pi * p.i_theta**2 + (np.pi + 2) * p.i_y**2 + (np.pi - 2) * p.i_x**2)
    wound_y = p.y * (2 * np.pi * p.i_theta**2 + (np.pi + 2) * p.i_x**2 + (np.pi - 2) * p.i_y**2)
    f_x = [p.i_x, -c * p.i_x, -s * p.i_y, -p.y * p.i_theta, p.x, p.i_y * p.i_theta, -s * p.i_x * p.i_theta,
           wound_x, p.y * s * q]  # fmt: skip
    f_y = [p.i_y, -c * p.i_y, s * p.i_x, p.x * p.i_theta, p.y, -p.i_x * p.i_theta, -s * p.i_y * p.i_theta,
           wound_y, p.x * s * q]  # fmt: skip
    return np.stack([np.stack(f_x, axis=-1), np.stack(f_y, axis=-1)], axis=1)


def torque_design(p: Points, poles: int) -> Array:
    """(n, 1, 4): what multiplies beta_1 .. beta_4 in the torque of each point (5.25c and the fourth term)."""
    columns = [
        p.i_theta,
        p.x * p.i_y - p.y * p.i_x,
        (p.x * p.i_x + p.y * p.i_y) * _exact(np.sin(poles * p.theta)),
        _exact(np.cos(3 * poles * p.theta)) * p.i_theta,
    ]
    return np.stack(columns, axis=-1)[:, None, :]


def _exact(wave: Array) -> Array:
    """sin(pi) in floating point is 1e-16; it must not look like an excitation. No angle is known to 1e-9 of a period."""
    return np.where(np.abs(wave) < 1e-9, 0.0, wave)


def why_unseen(name: str, p: Points, poles: int) -> str:
    """Which factor of a term is zero at every point, in words."""
    factors = {
        "i_x and i_y": ("alpha_1 alpha_2 alpha_3 alpha_9 beta_2 beta_3", (p.i_x, p.i_y)),
        "i_theta": ("alpha_4 alpha_6 alpha_7 beta_1 beta_4", (p.i_theta,)),
        "x and y": ("alpha_4 alpha_5 alpha_8 alpha_9 beta_2 beta_3", (p.x, p.y)),
        "sin(P theta)": ("alpha_3 alpha_7 alpha_9 beta_3", (_exact(np.sin(poles * p.theta)),)),
        "cos(P theta)": ("alpha_2", (_exact(np.cos(poles * p.theta)),)),
        "cos(3 P theta)": ("beta_4", (_exact(np.cos(3 * poles * p.theta)),)),
    }
    zero = [f"{what} = 0" for what, (terms, values) in factors.items()
            if name in terms.split() and not any(v.any() for v in values)]  # fmt: skip
    return f"{' and '.join(zero)} at every point" if zero else "a factor of it is zero at every point"


@dataclass(frozen=True)
class Identifiability:
    """What a design can and cannot tell.

    `unseen`: terms that no point excites. `entangled`: groups of terms of which only combinations are seen.
    `lone`: terms that one point alone tells apart, with its index: without that point they would be entangled or unseen.
    `condition`: ratio of the extreme singular values of the column-scaled design of what can be identified.
    """

    unseen: tuple[str, ...]
    entangled: tuple[tuple[str, ...], ...]
    lone: tuple[tuple[tuple[str, ...], int], ...]
    condition: float

    @property
    def unidentifiable(self) -> tuple[str, ...]:
        """Every term that has no value of its own, in the model's order."""
        names = {*self.unseen, *(name for group in self.entangled for name in group)}
        return tuple(name for name in UNITS if name in names)


def identifiability(design: Array, terms: Sequence[str]) -> Identifiability:
    """From the singular values and the null space of the design (n, r, k), columns scaled to one."""
    flat = design.reshape(-1, len(terms))
    norms = np.linalg.norm(flat, axis=0)
    unseen = tuple(name for name, norm in zip(terms, norms, strict=True) if norm == 0)
    seen = [k for k, norm in enumerate(norms) if norm > 0]
    groups = _entangled(flat[:, seen] / norms[seen])
    entangled = tuple(tuple(terms[seen[k]] for k in group) for group in groups)
    tangled = {k for group in groups for k in group}
    clear = [seen[k] for k in range(len(seen)) if k not in tangled]
    if not clear:
        return Identifiability(unseen, entangled, (), 1.0)
    kept = design[:, :, clear] / norms[clear]
    values = np.linalg.svd(kept.reshape(-1, len(clear)), compute_uv=False)
    lone = tuple(
        (tuple(terms[clear[k]] for k in sorted(k for group in groups for k in group)), n)
        for n in range(len(design))
        if (groups := _entangled(np.delete(kept, n, axis=0).reshape(-1, len(clear))))
    )
    return Identifiability(unseen, entangled, lone, float(values[0] / values[-1]))


def _entangled(scaled: Array) -> list[list[int]]:
    """Groups of columns (m, k) that the null space ties together."""
    if scaled.shape[1] == 0:
        return []
    _, values, rows = np.linalg.svd(scaled, full_matrices=True)
    null = rows[int((values > DEGENERATE * values.max(initial=1e-300)).sum()) :]
    shares = null.T @ null  # projector on the null space
    open_, groups = [k for k in range(len(shares)) if shares[k, k] > PART], []
    while open_:
        group, reach = [], [open_[0]]
        while reach:
            k = reach.pop()
            if k in open_:
                open_.remove(k)
                group.append(k)
                reach += [other for other in open_ if abs(shares[k, other]) > PART]
        groups.append(sorted(group))
    return groups


@dataclass(frozen=True)
class Fit:
    """Least squares of some terms: `values` (k,), `covariance` (k, k), `residuals` (n, r) measured less fitted,
    `chi2` weighted sum of squares, `dof`; `stated`: the scatter was stated, so that `chi2` tells whether the model fits."""

    terms: tuple[str, ...]
    values: Array
    covariance: Array
    residuals: Array
    chi2: float
    dof: int
    stated: bool

    @property
    def u(self) -> Array:
        """Standard uncertainties (k,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def constants(self) -> dict[str, float]:
        """Values by name."""
        return dict(zip(self.terms, map(float, self.values), strict=True))


def fit(design: Array, measured: Array, u: Array | None, terms: Sequence[str], keep: Sequence[str]) -> Fit:
    """Weighted linear least squares of `keep`, a part of `terms`, on `measured` (n, r).

    With `u` (n, r), the standard uncertainty of every value, weights are 1/u^2 and the covariance is that of `u`, widened by
    the residuals where they are larger (Birge); without, all weights are equal and the residuals give the variance.

    Raises:
        AnalysisError: the points do not determine the terms, or leave no degree of freedom.
    """
    columns = [list(terms).index(name) for name in keep]
    variances = None if u is None else u.reshape(-1) ** 2
    found = linear(design[:, :, columns].reshape(-1, len(columns)), measured.reshape(-1), variances)
    if found.dof < 1:
        raise AnalysisError(f"found {measured.size} values for {len(columns)} terms; expected more values than terms")
    widened = 1.0 if u is None else max(1.0, found.chi2 / found.dof)
    return Fit(tuple(keep), found.terms, widened * found.covariance, found.residuals.reshape(measured.shape),
               found.chi2, found.dof, u is not None)  # fmt: skip


def predict(design: Array, terms: Sequence[str], constants: dict[str, float]) -> Array:
    """(n, r): the model's forces or torques; terms that `constants` lacks are zero."""
    out: Array = design @ np.array([constants.get(name, 0.0) for name in terms])
    return out
