"""The motor's force from the two AMBs that hold the shaft against it: the force row and the moment row (T 6.13).

With the shaft at rest at the sensors' zero, a current in the motor changes the forces of inboard AMB, outboard AMB and
motor by dF_i, dF_o, dF_m with

    dF_i + dF_o + dF_m = 0,    about the outboard AMB:  s dF_i = e dF_m

(s from AMB to AMB, e from the outboard AMB on to the motor), so the motor's force is found twice:

    force row   F_m = -(F_i + F_o)        moment row   F_m = F_i s / e

T (6.14a) prints the first with the wrong sign. The AMBs' forces come from their coil currents by each angle's own
F = F_0 + K u + K2 v (see `amb_calibration.fit`); F_0 is the same in every step of an angle and drops out (`load_at_rest`
looks at it).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Values = Mapping[str, float]
Sensors = tuple[float, ...]
TERMS = 5  # constant, direct, cross, branch, time
DIRECT, CROSS, BRANCH, TIME, BEND = 1, 2, 3, 4, slice(5, 7)
FORCE, MOMENT = 0, 1
PAIRS = {"y": ((1, 3), (4, 2)), "x": ((4, 2), (1, 3))}
"""By axis: the two segments whose half difference is the axis' own current, and those of the other axis (T 6.9)."""


@dataclass(frozen=True, eq=False)
class Ramps:
    """Step means of one axis. A angles, P steps per angle; bearing axis first: 0 inboard, 1 outboard.

    axis: "y" (vertical) or "x"
    coils (2, 2, A, P): A, [bearing, coil p or n], as the current sensors read them
    segments (4, A, P): A, as read
    positions (2, A, P): m at the AMB planes; motor_m (A, P): m at the motor plane; both from the sensor readings
    branch (A, P): +1 where the axis' current was reached by raising it, -1 by lowering it
    turning (A, P): 1 where it turns round afterwards
    time (A, P): s from the middle of the angle's steps
    angles (A,): rad
    """

    axis: str
    coils: Array
    segments: Array
    positions: Array
    motor_m: Array
    branch: Array
    turning: Array
    time: Array
    angles: Array


@dataclass(frozen=True)
class Constants:
    """Force of each AMB over its currents, (2, A) each: dF/di `k` N/A and `k2` N/A^2 at each angle."""

    k: Array
    k2: Array


@dataclass(frozen=True)
class Fit:
    """Per row and angle: `terms` (2, A, 5) = constant N, direct N/A, cross N/A, branch N, drift N/s; `residuals` (2, A, P)
    and `rows` (2, A, P) N, the motor's force as each row gives it; `current` (A, P) A, the axis' own current;
    `solvers` (A, 5, P) maps forces to terms; `bends` (2, A, 2) N: square and cube of the current, at its greatest."""

    terms: Array
    residuals: Array
    rows: Array
    current: Array
    solvers: Array
    bends: Array
    bend_solvers: Array


def vertical(p: Values, angles: int) -> Constants:
    """The constants of the calibration, from `p` "K_i@0" ... "K2_o@n"."""
    k, k2 = (np.array([[p[f"{name}_{b}@{n}"] for n in range(angles)] for b in "io"]) for name in ("K", "K2"))
    return Constants(k, k2)


def horizontal(r: Ramps, p: Values, y: Constants, bias_A: float, shift: Array | float = 0.0) -> Constants:
    """The constants of the x axis, which no weight can load: those of the y axis, scaled by `p` "asymmetry_i", "_o".

    What differs between the axes of one bearing besides its winding is where the journal stands in it: with e the distance
    from the magnetic centre over the gap, F = A i_p^2 - B i_n^2 gives K ~ (1 + e^2)/(1 - e^2)^2 and K2/K = e/(b (1 + e^2)).
    K2/K of the x axis is seen in the run itself (`curvature`); `shift` (2, 1) is added to it.
    """
    ratio = curvature(r, p, bias_A)[0] + shift
    scale = 1 + np.array([[p["asymmetry_i"]], [p["asymmetry_o"]]])
    k = y.k * scale * _gain_off_centre(ratio, bias_A) / _gain_off_centre(y.k2 / y.k, bias_A)
    return Constants(k, k * ratio)


def curvature(r: Ramps, p: Values, bias_A: float) -> tuple[Array, Array]:
    """K2/K of each AMB at each angle (2, A) in 1/A, and its standard uncertainty by the residuals (2,) for each AMB.

    The motor's force is proportional to its current, so K u + K2 v is, too: u = constant + c i + ... - (K2/K) v.
    """
    return _curvature(r, _coil_sensors(r.axis, p), _segment_sensors(p), bias_A)


@lru_cache(maxsize=4)
def _curvature(r: Ramps, coils: Sensors, segments: Sensors, bias_A: float) -> tuple[Array, Array]:
    """Kept like `_solvers`."""
    u, v = _coil_terms(r, coils, bias_A)
    design = _design(r, _motor_currents(r, segments))
    bent = np.concatenate([np.broadcast_to(design, (2, *design.shape)), v[..., None]], axis=-1)
    solvers = np.linalg.pinv(bent)
    terms = np.einsum("bafp,bap->baf", solvers, u)
    residuals = u - np.einsum("bapf,baf->bap", bent, terms)
    angles, points, count = bent.shape[1:]
    variance = (residuals**2).sum(axis=(1, 2)) / (angles * (points - count))
    spread = np.sqrt(variance * (solvers[:, :, -1] ** 2).sum(axis=-1).mean(axis=-1))
    return -terms[..., -1], spread


def _gain_off_centre(ratio: Array, bias_A: float) -> Array:
    """(1 + e^2)/(1 - e^2)^2 from K2/K = e/(b (1 + e^2))."""
    t = np.clip(bias_A * ratio, -0.45, 0.45)
    e = 2 * t / (1 + np.sqrt(1 - 4 * t**2))
    out: Array = (1 + e**2) / (1 - e**2) ** 2
    return out


def coil_terms(r: Ramps, p: Values, bias_A: float) -> tuple[Array, Array]:
    """u and v (2, A, P) of F = F_0 + K u + K2 v, from coil currents freed of offsets and gains as in the calibration."""
    return _coil_terms(r, _coil_sensors(r.axis, p), bias_A)


@lru_cache(maxsize=4)
def _coil_terms(r: Ramps, sensors: Sensors, bias_A: float) -> tuple[Array, Array]:
    """Kept like `_solvers`."""
    offset, gain = np.array(sensors).reshape(2, 2, 2, 1, 1)
    ip, i_n = ((r.coils[:, c] - offset[:, c]) / gain[:, c] for c in (0, 1))
    return (ip**2 - i_n**2) / (4 * bias_A), (ip**2 + i_n**2) / 2 - bias_A**2


def _motor_currents(r: Ramps, sensors: Sensors) -> tuple[Array, Array]:
    """The axis' own current and the other axis' current (A, P), freed of the segment sensors' offsets and gains."""
    i = {k: (r.segments[k - 1] - sensors[k - 1]) / sensors[k + 3] for k in (1, 2, 3, 4)}
    own, other = PAIRS[r.axis]
    return (i[own[0]] - i[own[1]]) / 2, (i[other[0]] - i[other[1]]) / 2


def fit(r: Ramps, p: Values, constants: Constants, bias_A: float, *, turning: float = 1.0) -> Fit:
    """Fit F_m = constant + direct i + cross i' + branch + drift t to both rows, at each angle, by least squares.

    `p` also holds amb_span, motor_to_outboard_amb, amb_gap, motor_stiffness. The AMBs' forces are referred to where the
    rotor really is (stiffness K b/gap, T 2.4), and what the motor's own stiffness adds off the zero is taken off.
    `turning` scales the branch of the steps where the current turns round: play is not wholly taken up there.
    """
    u, v = coil_terms(r, p, bias_A)
    stiffness = constants.k.mean(axis=1) * bias_A / p["amb_gap"]
    inboard, outboard = (
        constants.k[b][:, None] * u[b] + constants.k2[b][:, None] * v[b] + stiffness[b] * r.positions[b] for b in (0, 1)
    )
    pull = p["motor_stiffness"] * r.motor_m
    rows = np.stack([-(inboard + outboard), inboard * p["amb_span"] / p["motor_to_outboard_amb"]]) - pull
    current, design, solvers, bent = _solvers(r, _segment_sensors(p), turning)
    terms = np.einsum("afp,rap->raf", solvers, rows)
    residuals = rows - np.einsum("apf,raf->rap", design, terms)
    bends = np.einsum("afp,rap->raf", bent, rows)
    return Fit(terms, residuals, rows, current, solvers, bends, bent)


def _coil_sensors(axis: str, p: Values) -> Sensors:
    """Offsets, then gains, of the axis' coils: inboard p and n, outboard p and n."""
    return tuple(p[f"{what}_{axis}{b}{coil}"] for what in ("offset", "gain") for b in "io" for coil in "pn")


def _segment_sensors(p: Values) -> Sensors:
    """Offsets, then gains, of the four segments."""
    return tuple(p[f"{what}_m{k}"] for what in ("offset", "gain") for k in (1, 2, 3, 4))


@lru_cache(maxsize=4)
def _solvers(r: Ramps, sensors: Sensors, turning: float) -> tuple[Array, Array, Array, Array]:
    """Own current, design, and what maps forces to terms and to square and cube: they only change with the segments'
    sensors, so a propagation over everything else finds them once."""
    currents = _motor_currents(r, sensors)
    design = _design(r, currents, turning)
    scaled = currents[0] / np.abs(currents[0]).max()
    bent = np.linalg.pinv(np.concatenate([design, (scaled**2)[..., None], (scaled**3)[..., None]], axis=-1))[:, BEND]
    return currents[0], design, np.linalg.pinv(design).astype(np.float64), bent


def _design(r: Ramps, currents: tuple[Array, Array], turning: float = 1.0) -> Array:
    """(A, P, 5): constant, own current, other axis' current, branch, time."""
    branch = r.branch * np.where(r.turning > 0, turning, 1.0)
    return np.stack([np.ones_like(branch), *currents, branch, r.time], axis=-1)


def scatter(f: Fit) -> tuple[Array, int]:
    """Covariance (2, 2) N^2 of one step between the rows, pooled over the angles, and its degrees of freedom."""
    angles, points = f.residuals.shape[1:]
    dof = angles * (points - TERMS)
    covariance: Array = np.einsum("rap,qap->rq", f.residuals, f.residuals) / dof
    return covariance, dof


def best_weights(covariance: Array) -> Array:
    """Weights (n,) of the best linear unbiased mean of n estimates of one value with that covariance (n, n).

    They are V^-1 1 / (1' V^-1 1) (Aitken); one may be negative where the estimates share most of their error.
    """
    inverse = np.linalg.solve(covariance, np.ones(len(covariance)))
    weights: Array = inverse / inverse.sum()
    return weights


def aliased(angles: int, pole_pairs: int) -> bool:
    """Whether equally spaced angles all stand at one electrical phase of the ripple, order 2 x pole pairs of a turn."""
    return 2 * pole_pairs % angles == 0
