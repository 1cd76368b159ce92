"""Ratio of the motor's force constants from the phase angle of the commutation (thesis 6.6.3; T 6.15 corrected).

The motor holds the outboard end at home, x = y = theta = 0, while gamma is stepped. With c = cos M (gamma - gamma_0) and
q = sin M (gamma - gamma_0), r = alpha_d/alpha_c, a the x winding's constant over the y winding's (segments are not
equal), and the forces on the shaft divided by the y winding's alpha_d:

    a c i_x - w q i_y + f_x = 0          c i_y + a w q i_x + f_y = 0          w = 1/r

gamma is a number that the controller is told, so it carries no error; the currents do. Solved for them,

    i_x = -(c f_x + w q f_y) / (a D),    i_y = -(c f_y - w q f_x) / D,    D = c^2 + (w q)^2

and least squares on the currents, equal weights, is the maximum likelihood fit with errors in every measured variable. It
is w that is fitted, because the model is smooth through w = 0: a wrong sign comes out as one.

The rotor cannot be kept at home better than to a count of its encoder. Off home by theta, the ripple (T 5.25, terms 2 and 3)
adds rho_2 (cos M g - cos(M g + P theta)) to c and rho_3 (sin(M g + P theta) - sin M g) to q, where g = gamma - gamma_0 and
P = 2 M. So the rotor is kept at a known place off home, one edge of a count on the way up and the other on the way down,
and rho_2 and rho_3 are fitted too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from procedures.servomotor.conventions import displacement, sensor_share
from procedures.servomotor.segments import radial_currents
from procedures.shared import leastsquares
from procedures.shared.leastsquares import Fit

Array = npt.NDArray[np.float64]
TERMS = ("w", "a", "gamma_0", "f_x", "f_y", "rho_2", "rho_3", "d_x", "d_y")


@dataclass(frozen=True)
class Sweep:
    """Step means (N,) over gamma. `segments` (4, N) A, `y` and `x` (2, N) m [inboard, outboard sensor], as read; `gamma` (N,)
    rad as set; `theta` (N,) rad, the rotor's angle; `time_s` (N,)."""

    segments: Array
    y: Array
    x: Array
    gamma: Array
    theta: Array
    time_s: Array


@dataclass(frozen=True)
class CouplingFit:
    """`fit` of the 2 N currents (i_x first), terms as TERMS (d_x, d_y A: drift over the sequence); `i_x`, `i_y` (N,) A freed
    of the sensors' gains and offsets; `modelled` (2, N) A with the drift, `fit.residuals` what is left. `turn` is by how
    much the force turns for the gamma that was told, found from what the fit leaves, with its standard uncertainty by the
    residuals."""

    fit: Fit
    i_x: Array
    i_y: Array
    modelled: Array
    turn: tuple[float, float]

    def term(self, name: str) -> float:
        """One of TERMS, or "r"."""
        return 1 / self.term("w") if name == "r" else float(self.fit.terms[TERMS.index(name)])


def currents(
    gamma: Array, terms: Array, pole_pairs: float, theta: Array | None = None, pull: Array | None = None
) -> Array:
    """i_x, i_y (2, N) A that hold the shaft; `terms` starts with w, a, gamma_0, f_x, f_y, rho_2, rho_3.

    `theta` (N,) rad is the rotor's angle; `pull` (2, N) A is added to the forces, what the stiffness makes of a displacement.
    """
    w, a, zero, fx, fy, direct, coupled = terms[:7]
    turn = pole_pairs * (gamma - zero)
    c, q = np.cos(turn), np.sin(turn)
    if theta is not None:
        off = turn + 2 * pole_pairs * theta
        c, q = c + direct * (c - np.cos(off)), q + coupled * (np.sin(off) - q)
    if pull is not None:
        fx, fy = fx + pull[0], fy + pull[1]
    q = w * q
    square = c**2 + q**2
    return np.array([-(c * fx + q * fy) / (a * square), -(c * fy - q * fx) / square])


def fit_sweep(s: Sweep, p: Mapping[str, float]) -> CouplingFit:
    """Fit w, a, gamma_0, f_x, f_y, rho_2, rho_3 and a drift of each current that is linear in time.

    `p` holds pole_pairs, gain_m1 .. offset_m4, l_is, l_os, z_m, and per_metre (A/m, stiffness over alpha_d) for what the shaft
    is off the sensors' zero.

    Raises:
        AnalysisError: the data do not determine the terms: gamma or the rotor stayed where they were.
    """
    i_x, i_y = radial_currents(s.segments, p)
    share = sensor_share(p["z_m"], p["l_is"], p["l_os"])
    pull = p["per_metre"] * np.array([displacement(v[0], v[1], share) for v in (s.x, s.y)])
    t = s.time_s / max(float(np.ptp(s.time_s)), 1e-9) - 0.5
    none = np.zeros_like(t)
    drift = np.column_stack([np.concatenate([t, none]), np.concatenate([none, t])])

    def model(terms: Array) -> Array:
        out: Array = currents(s.gamma, terms, p["pole_pairs"], s.theta, pull).ravel() + drift @ terms[7:]
        return out

    def jacobian(terms: Array) -> Array:
        columns = []
        for k, step in enumerate((1e-6, 1e-6, 1e-7, 1e-3, 1e-3, 1e-3, 1e-3)):  # central: smooth, of order one
            ends = [model(np.where(np.arange(9) == k, terms + sign * step, terms)) for sign in (1, -1)]
            columns.append((ends[0] - ends[1]) / (2 * step))
        return np.column_stack([*columns, drift])

    middle = np.abs(s.gamma) <= np.abs(s.gamma).min() + 1e-9
    first = 1 / as_printed(s.gamma, i_x, i_y, p["pole_pairs"])
    forces = (-float(i_x[middle].mean()), -float(i_y[middle].mean()))
    fit = leastsquares.nonlinear(
        model, np.concatenate([i_x, i_y]), np.array([first, 1.0, 0.0, *forces, 0.0, 0.0, 0.0, 0.0]), jacobian=jacobian
    )

    def scaled(factor: float) -> Array:
        return currents(factor * s.gamma, fit.terms, p["pole_pairs"], s.theta, pull).ravel()

    return CouplingFit(
        fit, i_x, i_y, model(fit.terms).reshape(2, -1), _turn(fit, (scaled(1.001) - scaled(0.999)) / 0.002)
    )


def _turn(fit: Fit, column: Array) -> tuple[float, float]:
    """One step of Gauss and Newton with a term more, whose derivative is `column` (2 N,): the factor of gamma. The ratio acts
    by sin, this by cos too, 12 % at 28 degrees electrical, so that the two are apart."""
    more = leastsquares.linear(np.column_stack([fit.jacobian, column]), fit.residuals)
    return 1 + float(more.terms[-1]), float(more.u[-1])


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
