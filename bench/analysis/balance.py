"""Balancing with influence coefficients, and the permissible residual unbalance of ISO 21940-11.

X = X_0 + A u: vectors X (p,) m at the probes, unbalance u = m r exp(j beta) (q,) kg m added in the planes, beta from the mark
in the direction of rotation. A trial weight u_j in plane j gives a column of A, (X_j - X_0)/u_j. Correction weights are
u = -(A^H W A)^-1 A^H W X (Goodman, Trans. ASME J. Eng. Ind. 86, 273 (1964)); the unbalance that is there is -u.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.analysis.sampling import Array, Complex
from bench.analysis.vectors import Vectors, complexes, parts, propagated, radius2, region, stacked
from bench.errors import AnalysisError

G_MM = 1e-6  # kg m in a g mm
WORST_CONDITION = 100.0


@dataclass(frozen=True)
class Trial:
    """A weight of `unbalance` kg m (complex) with standard uncertainties `u_size` (relative) and `u_angle` rad, in plane
    `plane`, and the `vectors` (p,) with it mounted."""

    plane: int
    unbalance: complex
    vectors: Vectors
    u_size: float = 0.0
    u_angle: float = 0.0


@dataclass(frozen=True)
class Correction:
    """`influence` A (p, q) m/(kg m); correction `weights` (q,) kg m; `residual` (p,) m, predicted at the probes; `condition` of
    A. `weights` negated is the unbalance that was found."""

    influence: Complex
    weights: Vectors
    residual: Vectors
    condition: float


def correct(
    start: Vectors, trials: Sequence[Trial], now: Vectors | None = None, weight: npt.ArrayLike | None = None
) -> Correction:
    """Correction weights from the vectors at the `start` (p,) and one trial in each of q planes; `weight` (p,) of the probes.

    With `now` (p,), vectors of a later run, those are what is corrected: its negated weights are the residual unbalance.
    The covariances of all runs and of the trial weights are propagated together: the start is in every column.

    Raises:
        AnalysisError: fewer probes than planes, a plane without or with two trials, a trial that moved nothing, or planes
            that the probes cannot tell apart.
    """
    ordered = sorted(trials, key=lambda trial: trial.plane)
    q, p = len(ordered), len(start.values)
    if [trial.plane for trial in ordered] != list(range(q)) or not 1 <= q <= p:
        raise AnalysisError(
            f"balance: found trials in planes {[t.plane for t in ordered]} and {p} probes; expected one in each"
        )
    for trial in ordered:
        _moved(start, trial)
    w = np.ones(p) if weight is None else np.asarray(weight, np.float64)
    weights_of = [_trial_weight(trial) for trial in ordered]
    inputs = stacked([start, *(trial.vectors for trial in ordered), *weights_of, *([] if now is None else [now])])

    def model(values: Array) -> Array:
        z = complexes(values)
        a, u = _solution(z, p, q, w)
        return parts(np.concatenate([u, (z[:p] if now is None else z[-p:]) + a @ u]))

    influence, _ = _solution(inputs.values, p, q, w)
    condition = float(np.linalg.cond(influence / np.linalg.norm(influence, axis=0)))
    if condition > WORST_CONDITION:
        raise AnalysisError(
            f"balance: the condition of the influence coefficients is {condition:.0f}; the probes do not tell the planes apart"
        )
    out, covariance = propagated(model, inputs.parts, inputs.covariance)
    dof = min(v.dof for v in (start, *(trial.vectors for trial in ordered), *([] if now is None else [now])))
    k = 2 * q
    found = complexes(out)
    return Correction(
        influence,
        Vectors(found[:q], covariance[:k, :k], dof),
        Vectors(found[q:], covariance[k:, k:], dof),
        condition,
    )


def _solution(z: Complex, p: int, q: int, w: Array) -> tuple[Complex, Complex]:
    x = z[: p * (q + 1)].reshape(q + 1, p)
    rest = z[p * (q + 1) :]
    a = ((x[1:] - x[0]) / rest[:q, None]).T
    weighed = a.conj().T * w
    return a, -np.linalg.solve(weighed @ a, weighed @ (rest[q:] if rest.size > q else x[0]))


def _trial_weight(trial: Trial) -> Vectors:
    """The trial weight with the covariance of its size and angle."""
    u = np.array([trial.unbalance])
    along, across = parts(u), parts(1j * u)
    covariance = np.outer(along, along) * trial.u_size**2 + np.outer(across, across) * trial.u_angle**2
    return Vectors(u, covariance)


def _moved(start: Vectors, trial: Trial) -> None:
    """Refuses a trial that at no probe moved the vector out of its 95 % region (Bonferroni over the probes)."""
    away = trial.vectors.minus(start)
    p = len(start.values)
    for k in range(p):
        one = away.one(k)
        distance = float(one.parts @ np.linalg.pinv(one.covariance, hermitian=True) @ one.parts)
        if distance > radius2(max(one.dof, 1.5), 1 - 0.05 / p):
            return
    raise AnalysisError(
        f"balance: the trial weight of {abs(trial.unbalance) / G_MM:.3g} g mm in plane {trial.plane} moved no vector beyond "
        "its scatter; mount a heavier one, or see whether it is mounted"
    )


def permissible(grade: float, mass: float, speed: float) -> float:
    """U_per in kg m of a rotor of `mass` kg at its highest `speed` rad/s: e_per = G/omega, `grade` G in m/s (G2.5 is 0.0025).

    Raises:
        AnalysisError: one of them is not positive.
    """
    if not (grade > 0 and mass > 0 and speed > 0):
        raise AnalysisError(f"balance: found G = {grade} m/s, {mass} kg, {speed} rad/s; expected all above 0")
    return grade / speed * mass


def allocated(total: float, to_left: float, to_right: float) -> tuple[float, float]:
    """U_per in the left and the right plane, of a centre of mass `to_left` and `to_right` m from them and between them.

    Each gets the lever of the other over their distance, within 0.3 and 0.7 (ISO 21940-11, rotors between bearings).
    """
    if not (to_left >= 0 and to_right >= 0 and to_left + to_right > 0):
        raise AnalysisError(
            f"balance: found distances {to_left} and {to_right} m; expected a centre of mass between the planes"
        )
    left = min(max(to_right / (to_left + to_right), 0.3), 0.7)
    return total * left, total * (1 - left)


def reached(residual: Vectors, limit: Sequence[float], probability: float = 0.95) -> list[bool]:
    """Whether U_res + U <= U_per in each plane (q,), U_res + U being `bound`."""
    return [bound(residual.one(k), probability) <= per for k, per in enumerate(limit)]


def bound(residual: Vectors, probability: float = 0.95) -> float:
    """U_res + U of a single vector: the greatest amount in its region (an ellipse), which holds the truth with `probability`.

    Along the vector alone would be too little where the vector is short and the ellipse is long across it.
    """
    outline: Complex = region(residual, 181, probability)
    return float(np.abs(outline).max())


def split(weight: complex, positions: int) -> list[complex]:
    """A weight (kg m) on the two of `positions` equally spaced angles, the first at 0, that enclose it; 0: anywhere.

    Raises:
        AnalysisError: fewer than three positions cannot enclose every angle.
    """
    if positions == 0:
        return [weight]
    if positions < 3:
        raise AnalysisError(f"balance: found {positions} positions; expected 0 (any angle), or three or more")
    step = 2 * math.pi / positions
    k = math.floor(np.angle(weight) % (2 * math.pi) / step + 1e-9)
    a, b = np.exp(1j * step * k), np.exp(1j * step * (k + 1))
    share = np.linalg.solve([[a.real, b.real], [a.imag, b.imag]], [weight.real, weight.imag])
    return [complex(m * z) for m, z in zip(share, (a, b), strict=True) if m > 1e-9 * abs(weight)]
