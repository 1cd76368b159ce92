"""Ratio of the motor's force constants from the phase angle of the commutation (thesis 6.6.3; T 6.15 corrected).

The motor holds the outboard end at home, x = y = theta = 0, while gamma is stepped. With c = cos M (gamma - gamma_0) and
q = sin M (gamma - gamma_0), r = alpha_d/alpha_c, a the x winding's constant over the y winding's (segments are not
equal), and the forces on the shaft divided by the y winding's alpha_d:

    a c i_x - w q i_y + f_x = 0          c i_y + a w q i_x + f_y = 0          w = 1/r

gamma is a number that the controller is told, so it carries no error; the currents do. Solved for them,

    i_x = -(c f_x + w q f_y) / (a D),    i_y = -(c f_y - w q f_x) / D,    D = c^2 + (w q)^2

and least squares on the currents, equal weights, is the maximum likelihood fit with errors in every measured variable. It
is w that is fitted, because the model is smooth through w = 0: a wrong sign comes out as one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from procedures.estimators import leastsquares
from procedures.estimators.leastsquares import Fit
from procedures.estimators.stiffness import radial_currents, sensor_share

Array = npt.NDArray[np.float64]
TERMS = ("w", "a", "gamma_0", "f_x", "f_y", "d_x", "d_y")


@dataclass(frozen=True)
class Sweep:
    """Step means (N,) over gamma. `segments` (4, N) A, `y` and `x` (2, N) m [inboard, outboard sensor], as read; `gamma` (N,)
    rad as set; `time_s` (N,)."""

    segments: Array
    y: Array
    x: Array
    gamma: Array
    time_s: Array


@dataclass(frozen=True)
class CouplingFit:
    """`fit` of the 2 N currents (i_x first), terms as TERMS (d_x, d_y A: drift over the sequence); `i_x`, `i_y` (N,) A freed
    of the sensors' gains and offsets; `modelled` (2, N) A with the drift, `fit.residuals` what is left."""

    fit: Fit
    i_x: Array
    i_y: Array
    modelled: Array

    def term(self, name: str) -> float:
        """One of TERMS, or "r"."""
        return 1 / self.term("w") if name == "r" else float(self.fit.terms[TERMS.index(name)])


def currents(gamma: Array, terms: Array, pole_pairs: float, pull: Array | float = 0.0) -> Array:
    """i_x, i_y (2, N) A that hold the shaft; `terms` starts with w, a, gamma_0, f_x, f_y; `pull` (2, N) A is added to the
    forces: what the stiffness makes of a shaft that is not quite at the sensors' zero."""
    w, a, zero = terms[:3]
    c, q = np.cos(pole_pairs * (gamma - zero)), w * np.sin(pole_pairs * (gamma - zero))
    fx, fy = terms[3:5, None] + pull * np.ones((2, len(gamma)))
    d = c**2 + q**2
    return np.array([-(c * fx + q * fy) / (a * d), -(c * fy - q * fx) / d])


def fit_sweep(s: Sweep, p: Mapping[str, float]) -> CouplingFit:
    """Fit w, a, gamma_0, f_x, f_y and a drift of each current that is linear in time.

    `p` holds pole_pairs, gain_m1 .. offset_m4, l_is, l_os, z_m, and per_metre (A/m, stiffness over alpha_d) for what the shaft
    is off the sensors' zero.
    """
    i_x, i_y = radial_currents(s.segments, p)
    share = sensor_share(p["z_m"], p)
    pull = p["per_metre"] * np.array([v[0] * (1 - share) + v[1] * share for v in (s.x, s.y)])
    t = s.time_s / max(float(np.ptp(s.time_s)), 1e-9) - 0.5

    def model(terms: Array) -> Array:
        out: Array = (currents(s.gamma, terms, p["pole_pairs"], pull) + terms[5:, None] * t).ravel()
        return out

    def jacobian(terms: Array) -> Array:
        return _jacobian(s.gamma, terms, p["pole_pairs"], pull, t)

    middle = np.abs(s.gamma) <= np.abs(s.gamma).min() + 1e-9
    first = 1 / as_printed(s.gamma, i_x, i_y, p["pole_pairs"])
    start = np.array([first, 1.0, 0.0, -float(i_x[middle].mean()), -float(i_y[middle].mean()), 0.0, 0.0])
    fit = leastsquares.nonlinear(model, np.concatenate([i_x, i_y]), start, jacobian=jacobian)
    return CouplingFit(fit, i_x, i_y, model(fit.terms).reshape(2, -1))


def _jacobian(gamma: Array, terms: Array, pole_pairs: float, pull: Array, t: Array) -> Array:
    """d currents / d terms (2 N, 7)."""
    step = np.array([1e-6, 1e-6, 1e-7])
    columns = []
    for k in range(3):  # central differences: smooth functions, terms of order one
        ends = [
            currents(gamma, np.where(np.arange(7) == k, terms + sign * step[k], terms), pole_pairs, pull)
            for sign in (1, -1)
        ]
        columns.append(((ends[0] - ends[1]) / (2 * step[k])).ravel())
    forces = [currents(gamma, np.array([*terms[:3], *unit]), pole_pairs).ravel() for unit in ((1.0, 0.0), (0.0, 1.0))]
    none = np.zeros_like(t)
    return np.column_stack([*columns, *forces, np.concatenate([t, none]), np.concatenate([none, t])])


def as_printed(gamma: Array, i_x: Array, i_y: Array, pole_pairs: float, *, successive: bool = False) -> float:
    """r by linear least squares with gamma_0 = 0 as T (6.15) means it: d(c i_x) r = d(q i_y), d(c i_y) r = -d(q i_x).

    The differences are from the mean; `successive` takes them from step to step, which multiplies what an integrator that
    has not settled leaves behind.
    """
    c, q = np.cos(pole_pairs * gamma), np.sin(pole_pairs * gamma)

    def freed(x: Array) -> Array:
        return np.diff(x) if successive else x - x.mean()

    left = np.concatenate([freed(c * i_x), freed(c * i_y)])
    right = np.concatenate([freed(q * i_y), -freed(q * i_x)])
    return float(left @ right / (left @ left))
