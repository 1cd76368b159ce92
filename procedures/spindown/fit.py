"""A rotor that coasts under viscous drag and Coulomb friction: J w' = -B w - T_c sgn(w).

T (6.16) leaves the constant torque out (and prints J for J_z). With b = B/J and c = T_c/J the speed falls from w_0 as

    w(t) = w_0 e^(-b t) - c (1 - e^(-b t)) / b
    theta(t) = theta_0 + (w_0 + c/b) (1 - e^(-b t)) / b - c t / b

until it stops at t_s = ln(1 + w_0 b / c) / b. Both forms are fitted: to the speed, and to the angle, which has been
differentiated and filtered by nobody. Speeds are taken in the direction of turning, so that w_0 > 0.

From one run-down come b and c alone; J turns them into B and T_c. From two, with and without a ring of known inertia
J_r, comes J as well: J = J_r b_r / (b - b_r).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from procedures.shared.leastsquares import Fit, correlated, nonlinear

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Coast:
    """One fitted run-down: `b` 1/s, `c` rad/s^2, `speed` at t = 0 rad/s; `covariance` (2, 2) of b and c, the residuals'
    correlation in time allowed for; `fit` has the residuals (rad/s or rad)."""

    b: float
    c: float
    speed: float
    covariance: Array
    fit: Fit
    shared: Array = field(default_factory=lambda: np.zeros((2, 1)))
    """What standard uncertainties that all run-downs share do to b and c, (2, k): `procedures.spindown.waves`."""


def speed(t: Array, b: float, c: float, start: float) -> Array:
    """w(t) in rad/s while it turns (no stop)."""
    fallen = -np.expm1(-b * t)
    return start * (1 - fallen) - c * _over(fallen, b, t)


def angle(t: Array, b: float, c: float, start: float) -> Array:
    """theta(t) - theta(0) in rad while it turns (no stop)."""
    part = _over(-np.expm1(-b * t), b, t)
    return start * part - c * _lag(t, b, part)


def _over(fallen: Array, b: float, t: Array) -> Array:
    """(1 - e^(-b t)) / b, also where b is nothing."""
    return fallen / b if abs(b) > 1e-9 else t * (1 - b * t / 2)


def _lag(t: Array, b: float, part: Array) -> Array:
    """(t - (1 - e^(-b t))/b) / b, by its series where the difference loses its digits."""
    x = b * t
    series = t**2 / 2 * (1 - x / 3 * (1 - x / 4 * (1 - x / 5 * (1 - x / 6 * (1 - x / 7)))))
    return series if abs(b) < 1e-9 else np.where(np.abs(x) < 0.05, series, (t - part) / b)


def stopping_time(b: float, c: float, start: float) -> float:
    """Seconds from `start` rad/s to standstill; inf without Coulomb friction."""
    if c <= 0:
        return math.inf
    return math.log1p(start * b / c) / b if abs(b) > 1e-12 else start / c


def of_speed(t: npt.ArrayLike, w: npt.ArrayLike, lags: int) -> Coast:
    """Fit b, c and w_0 to speeds (n,) rad/s, all in the direction of turning, at times (n,) s.

    A first-order filter of the speed scales w_0 + c/b and nothing else, so that b and c are right once its transient is
    over. `lags` samples are how far the residuals may repeat themselves.

    Raises:
        AnalysisError: too few samples, a speed that does not fall, or no convergence.
    """
    time, values = np.asarray(t, np.float64), np.asarray(w, np.float64)
    b, c, start = _guess(time, values)
    fit = nonlinear(lambda p: speed(time, *p), values, [b, c, start])
    return _coast(fit, lags)


def of_angle(t: npt.ArrayLike, theta: npt.ArrayLike, lags: int, fewest: int = 400) -> Coast:
    """Fit b, c, w_0 and theta_0 to unwrapped angles (n,) rad, growing in the direction of turning; n is `fewest` or more.

    Raises:
        AnalysisError: too few samples, a rotor that does not slow down, or no convergence.
    """
    time, values = np.asarray(t, np.float64), np.asarray(theta, np.float64)
    parts = np.array_split(np.arange(len(time)), 40)
    if len(time) < fewest:
        raise AnalysisError(f"run-down: found {len(time)} angles; expected {fewest} or more")
    rates = [(values[k[-1]] - values[k[0]]) / (time[k[-1]] - time[k[0]]) for k in parts]
    b, c, start = _guess(np.array([time[k].mean() for k in parts]), np.array(rates))
    fit = nonlinear(lambda p: p[3] + angle(time, *p[:3]), values, [b, c, start, values[0]])
    return _coast(fit, lags)


def _guess(t: Array, w: Array) -> tuple[float, float, float]:
    """b, c and w_0 from the integral of the equation: w - w_0 = -b (theta - theta_0) - c t, linear in all three."""
    if len(t) < 8 or t.shape != w.shape or not np.isfinite(w).all():
        raise AnalysisError(
            f"run-down: found {t.shape} times and {w.shape} speeds; expected eight or more of each, finite"
        )
    if not w[: len(w) // 4].mean() > w[-(len(w) // 4) :].mean() > 0:
        raise AnalysisError("run-down: the speed does not fall, or it is not counted in the direction of turning")
    turned = np.concatenate([[0.0], np.cumsum(np.diff(t) * (w[1:] + w[:-1]) / 2)])
    b, c, start = np.linalg.lstsq(np.column_stack([-turned, -(t - t[0]), np.ones_like(t)]), w, rcond=None)[0]
    return float(b), float(c), float(start)


def _coast(fit: Fit, lags: int) -> Coast:
    b, c, start = (float(x) for x in fit.terms[:3])
    return Coast(b, c, start, correlated(fit, min(lags, fit.jacobian.shape[0] // 4))[:2, :2], fit)


def viscous_only(t: npt.ArrayLike, w: npt.ArrayLike) -> float:
    """b of T (6.16), the model without Coulomb friction. Kept to show what it costs; nothing reports it as a result.

    Raises:
        AnalysisError: too few samples, or no convergence.
    """
    time, values = np.asarray(t, np.float64), np.asarray(w, np.float64)
    b, c, start = _guess(time, values)
    fit = nonlinear(lambda p: p[1] * np.exp(-p[0] * time), values, [max(b, 1e-3) + c / start, start])
    return float(fit.terms[0])


def inertia_from_ring(b: float, b_ring: float, ring: float) -> float:
    """J in kg m^2 from the rates without and with a ring of known inertia; the drag is the same: b J = b_r (J + J_r).

    Raises:
        AnalysisError: the ring does not slow the decay.
    """
    if not b > b_ring > 0:
        raise AnalysisError(
            f"ring: found rates of {b:.4g} 1/s without and {b_ring:.4g} 1/s with it; expected a slower decay"
        )
    return ring * b_ring / (b - b_ring)
