"""Torque constant of the motor from known weights on a lever, over the phase angle gamma (T 6.6.4, with gravity).

The motor holds the rotor at its home angle. A weight W at the arm l turns it forward on the left end and backward on the
right end; with gamma_0 the error of the encoder's zero and M pole pairs

    alpha_tau cos(M (gamma - gamma_0)) (i - i_base) = -W l_left    (left)    = +W l_right    (right)

T prints m l = alpha_tau cos(M gamma) i: gravity is missing, and the current without load too, which holds detent, the
sensors' offsets and any constant torque. At each gamma i_base is a straight line in time through the loads' own steps and
those without load, fitted together with alpha_tau and gamma_0, so that a linear drift of offsets drops out as well.

A scale that drifts (current sensors, magnets, amplifiers that warm up) is another matter: to the loads, torque per current
that changes by a share D over their time is

    alpha_tau (1 + D (t - t_mean)/span)

with which gamma_0 would be confused if gamma went in one direction: a turn by gamma_0 changes it by M gamma_0 tan(M gamma).
The procedure visits the phase angles in an order in which tan(M gamma) and time are nearly orthogonal, and D is fitted along:
it costs gamma_0 next to nothing. alpha_tau is that of the loads' mean time.

A loaded rotor comes to rest where its encoder changes between two counts, half a count beside the ones that the integrator
ignores: theta = +-1.5 counts. There the torque's ripple (T 5.25, third harmonic of the poles) has turned a little:

    cos(M g) becomes cos(M g) + r (cos(M g + 6 M theta) - cos(M g)),   g = gamma - gamma_0

r is fitted along. Both sides are loaded upwards, so that they rest on opposite edges and gamma_0 does not lean on r.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from procedures.shared.leastsquares import Fit, linear, nonlinear
from procedures.shared.weight import weight

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Steps:
    """Step means in time order, (n,) each but `segments` (n, k), the k currents along the field.

    segments: A, as the current sensors read; angle: rad, of the rotor (`resting`); gamma: rad; time: s, middle of the
    step, less the pauses of a run that was stopped and continued
    side: +1 left, -1 right, 0 no load; load: index into the masses, -1 for nothing
    spread: A, standard deviation of the torque current's samples: large where the angle jumps between two counts
    half: number of the half, from 0, of a run that was stopped and continued; () is one that never was
    """

    segments: Array
    angle: Array
    gamma: Array
    time: Array
    side: Ints
    load: Ints
    spread: Array
    half: Ints = field(default_factory=lambda: np.zeros(0, np.int64))


@dataclass(frozen=True)
class Detent:
    """Current in A that holds the released load-free rotor over the angle: constant + cosine and sine of its order."""

    constant: float
    cosine: float
    sine: float
    order: float

    @property
    def amplitude(self) -> float:
        """A, 0 to peak."""
        return math.hypot(self.cosine, self.sine)

    def off_home(self, angle: Array) -> Array:
        """Current at an angle less that at home, A."""
        turn = self.order * angle
        out: Array = self.cosine * (np.cos(turn) - 1) + self.sine * np.sin(turn)
        return out


NO_DETENT = Detent(0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Extra:
    """One more term: its `value`, standard uncertainty `u` (from the residuals), and t = value / u."""

    value: float
    u: float

    @property
    def t(self) -> float:
        return self.value / self.u if self.u > 0 else 0.0


@dataclass(frozen=True)
class Balance:
    """`alpha` N m/A, `gamma_0` rad, their `covariance` (2, 2) from the residuals; `ripple` r; `drift` D of the torque per
    current over the loads' time, relative; `current` (n,) A the torque current freed of sensors and detent, `base` (n,) A
    without load, `torque` (n,) N m of the loads; `fit` has residuals (n,) A; `u` (n,) how far each step may scatter, relative
    to the others; `dof` of the scatter; M, the `pole_pairs`."""

    alpha: float
    gamma_0: float
    ripple: float
    drift: Extra
    covariance: Array
    current: Array
    base: Array
    torque: Array
    fit: Fit
    u: Array
    dof: int
    pole_pairs: float

    @property
    def scale(self) -> float:
        """A per unit of `u`, from the residuals."""
        return math.sqrt(self.fit.chi2 / self.dof)


def resting(reading: Array, count: float) -> Array:
    """Where the rotor is in rad, from mean readings of an encoder with that count: within a count and a half the angle's loop
    lets it creep to the edge, beyond it the mean of the counts is where it is."""
    out: Array = np.where(
        np.abs(reading) < 0.5 * count, 0.0, np.sign(reading) * np.maximum(np.abs(reading), 1.5 * count)
    )
    return out


def detent(angle: Array, current: Array, order: float) -> Detent:
    """Fit of the holding current (n,) A over angles (n,) rad within a period of the detent.

    Raises:
        AnalysisError: the angles do not determine it.
    """
    turn = order * angle
    design = np.column_stack([np.ones_like(turn), np.cos(turn), np.sin(turn)])
    constant, cosine, sine = linear(design, current, np.ones_like(current)).terms
    return Detent(float(constant), float(cosine), float(sine), order)


def torque_current(segments: Array, p: Mapping[str, float]) -> Array:
    """Mean of the currents along the field, freed of the gains of their sensors. Offsets are the same at every step: they go
    into the current without load."""
    gains = np.array([p[f"gain_{k}"] for k in range(1, segments.shape[1] + 1)])
    out: Array = (segments / gains).mean(axis=1)
    return out


def load_torque(s: Steps, p: Mapping[str, float], masses: int) -> Array:
    """Torque in N m by which the loads turn the rotor forward, (n,)."""
    kg = np.array([p[f"mass_{k}"] for k in range(masses)] + [0.0])  # index -1 is nothing
    newtons = np.asarray(weight(kg[s.load], p["gravity"], p["air_density"], p["mass_density"]))
    arm = np.where(s.side > 0, p["lever_left"], p["lever_right"])
    out: Array = s.side * newtons * arm
    return out


def uneven(b: Balance, s: Steps) -> Array:
    """How far each step may scatter (n,) A: variance a + g spread^2, both from the residuals, g not negative.

    The mean of a current that jumps between the counts of the encoder is worse than that of one that rests. A residual's
    variance is 1 - h of its step's, h the leverage; near 1 the fit follows the step and says nothing of its scatter
    (MacKinnon and White, J. Econometrics 29, 305 (1985), HC2).
    """
    from scipy import optimize

    q, _ = np.linalg.qr(b.fit.jacobian / b.u[:, None])
    scatter = b.fit.residuals**2 / np.maximum(1 - (q**2).sum(axis=1), 0.1)
    square = s.spread**2
    (a, g), _ = optimize.nnls(np.column_stack([np.ones_like(square), square]), scatter)
    typical = float(scatter.mean())
    out: Array = np.sqrt(np.maximum(a, 0.05 * typical) + g * square)
    return out


def balance(
    s: Steps, p: Mapping[str, float], masses: int, pole_pairs: float, held: Detent = NO_DETENT, u: Array | None = None
) -> Balance:
    """Fit alpha_tau, gamma_0 and the current without load to all steps, weighted by `u` (n,) (all alike without it). The
    scale of the scatter always comes from the residuals; where their ratios do too (`uneven`), they cost one more degree of
    freedom.

    Raises:
        AnalysisError: a phase angle lacks loads or steps without load, or the fit does not converge.
    """
    torque = load_torque(s, p, masses)
    current = torque_current(s.segments, p) - held.off_home(s.angle) / np.cos(pole_pairs * s.gamma)
    lines = _lines_in_time(s)
    off = 6 * pole_pairs * s.angle * (s.side != 0)
    late = (s.time - np.average(s.time, weights=torque**2)) / np.ptp(s.time)

    def pull(q: Array) -> tuple[Array, Array, Array]:
        """Torque per current over alpha before it drifts, and its derivatives by turn and r."""
        turn = pole_pairs * (s.gamma - q[1])
        ripple = np.cos(turn + off) - np.cos(turn)
        by_turn = -np.sin(turn) - q[2] * (np.sin(turn + off) - np.sin(turn))
        return np.cos(turn) + q[2] * ripple, by_turn, ripple

    def model(q: Array) -> Array:
        out: Array = -torque / (q[0] * pull(q)[0] * (1 + q[3] * late)) + lines @ q[4:]
        return out

    def slopes(q: Array) -> Array:
        (per, by_turn, ripple), drifted = pull(q), 1 + q[3] * late
        part = -torque / (q[0] * per * drifted)
        return np.column_stack(
            [-part / q[0], part * by_turn * pole_pairs / per, -part * ripple / per, -part * late / drifted, lines]
        )

    start = linear(np.column_stack([-torque / np.cos(pole_pairs * s.gamma), lines]), current).terms
    relative = np.ones_like(current) if u is None else u / np.sqrt(np.mean(u**2))
    fit = nonlinear(model, current, np.concatenate([[1 / start[0], 0.0, 0.0, 0.0], start[1:]]), relative, slopes)
    alpha, gamma_0, ripple = (float(x) for x in fit.terms[:3])
    dof = fit.dof - (u is not None)
    if dof < 1:
        raise AnalysisError(f"fit: {len(current)} steps leave no residual to tell the scatter")
    covariance = fit.covariance[:4, :4] * fit.chi2 / dof
    drift = Extra(float(fit.terms[3]), math.sqrt(covariance[3, 3]))
    return Balance(
        alpha, gamma_0, ripple, drift, covariance[:2, :2], current, lines @ fit.terms[4:], torque, fit, relative, dof,
        pole_pairs,
    )  # fmt: skip


def _lines_in_time(s: Steps) -> Array:
    """Columns of i_base, (n, 2 k): at each of the k phase angles a constant and a slope in time; and (n, 1) more for each time
    that the run was stopped within one: a step, for sensors' zeros and where the rotor rests are other ones after a lift.

    Raises:
        AnalysisError: too few phase angles, or one that lacks loads or steps without load.
    """
    angles, index = np.unique(s.gamma, return_inverse=True)
    if len(angles) < 3:
        raise AnalysisError(f"found {len(angles)} phase angles; expected three or more (was the run stopped early?)")
    lines = np.zeros((len(s.gamma), 2 * len(angles)))
    for k in range(len(angles)):
        mine = index == k
        if (s.side[mine] == 0).sum() < 2 or not {1, -1} <= set(s.side[mine].tolist()):
            raise AnalysisError(
                f"phase angle {angles[k]:.4f} rad: found {int(mine.sum())} steps; expected loads on both sides and two steps "
                "without load (was the run stopped early?)"
            )
        lines[mine, 2 * k] = 1
        lines[mine, 2 * k + 1] = s.time[mine] - s.time[mine].mean()
    return np.column_stack([lines, *_steps_at_seams(s, index)])


def _steps_at_seams(s: Steps, index: Ints) -> list[Array]:
    """A column (n,) for each phase angle and seam that parts it."""
    out = []
    for half in range(1, int(s.half.max(initial=0)) + 1):
        for k in np.unique(index):
            after = (s.half >= half) & (index == k)
            if after.any() and not after[index == k].all():
                out.append(after.astype(np.float64))
    return out
