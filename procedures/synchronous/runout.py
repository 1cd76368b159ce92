"""Runout of a levitated shaft from a slow roll: what the probes read less what the shaft does, by the balance of forces.

A shaft on bearings with a stiff loop does not lie still at slow roll. The loop takes the runout for motion and moves the
shaft against it: with the sensitivity S of the loop the probes read S R of a runout R, and the shaft moves by -(1 - S) R.
At a few Hz abs(S) is far from 1, so that the slow-roll reading itself is not the runout and must not be subtracted as such.
The coils tell what the shaft does. With the vectors of order n at w = n times the speed,

    (D(w) - A' K_x A) q = A' (K_p I_p + K_n I_n) + w^2 B' U   (U at n = 1 alone),   R = M/g - A_s q,

q the shaft's (y, z, psi, theta), A, A_s, B its arms at AMBs, probes and balancing planes, K_p, K_n, K_x the slopes of
T (2.4b) at the mean currents and place, D = -w^2 M + j w G + K_c. U is what the same balance gives at a high speed with
the runout just found; at slow roll its share is w^2 U over the stiffness. Orders act on each other by a percent, since the
forces are not linear: that is put right by the whole of T (2.4b) over the turn.

All of it takes stacks too: a `Stand` of many sets of inputs, whose numbers are arrays (...) and whose arrays (..., 4), gives
as many answers along the leading axes, in the time of a few. Shapes in the docstrings are those of one stand.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from procedures.amb_rotor.stations import SQUARE

Number = Any  # a float; of a stack an array (...)
Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
SCALE = np.array([1.0, 1.0, 10.0, 10.0])  # moments at arms of 0.1 m, beside forces
ROUNDS = 4  # U changes R by little, R changes U by little
TURN = np.arange(32) * (2 * np.pi / 32)


@dataclass(frozen=True)
class Stand:
    """What the balance needs, SI. `beta`, `offset`, `gain`, `gap` (4,) in the order yi zi yo zo; `zero` (4,) of the probes; of
    the eight coils `i_gain`, `i_zero`; lengths from the centre of mass. `axes` and `probes` (4, 4) say what the bearings' axes
    and the probes make of y z psi theta. `hand` is 1 where the shaft turns from y towards z, -1 where from z towards y."""

    beta: Array
    offset: Array
    gain: Array
    zero: Array
    i_gain: Array
    i_zero: Array
    gap: Array
    coupling: Number
    mass: Number
    inertia: Number
    polar: Number
    l_ia: Number
    l_oa: Number
    l_is: Number
    l_os: Number
    l_iu: Number
    l_ou: Number
    l_c: Number
    axes: Array
    probes: Array
    hand: Number = 1.0

    @classmethod
    def of(cls, v: Mapping[str, Number]) -> Stand:
        """From numbers by name, those of an array with `_0`, `_1`, ... . Places and angles of each axis and probe where they
        are told, else two planes of axes that look along y and z."""

        def several(name: str, size: int = 4) -> Array:
            return np.stack([v[f"{name}_{k}"] for k in range(size)], axis=-1)

        told = "at_axis_0" in v
        gap = several("gap") if told else np.stack([v["gap"]] * 4, axis=-1)
        axes = placed(several("at_axis"), several("turn_axis")) if told else arms(v["l_ia"], v["l_oa"])
        probes = placed(several("at_probe"), several("turn_probe")) if told else arms(v["l_is"], v["l_os"])
        return cls(
            several("beta"), several("offset"), several("gain"), several("zero"), several("i_gain", 8), several("i_zero", 8),
            gap, v["coupling"],
            v["mass"], v["inertia"], v["polar"], v["l_ia"], v["l_oa"], v["l_is"], v["l_os"], v["l_iu"], v["l_ou"], v["l_c"],
            axes, probes, v.get("hand", 1.0),
        )  # fmt: skip


@dataclass(frozen=True)
class Turning:
    """Mean readings (12,) and vectors of one order (12,), four probes and eight coils (p, n by axis), at a speed in rad/s.

    `higher` has those of higher orders by order, beside an order 1 whose force is to be that of the whole of T (2.4b): where
    a law lets the coils of an axis pull in turns, order 2 makes a quarter of it.
    """

    speed: float
    means: Array
    vectors: Complex
    higher: Mapping[float, Complex] = field(default_factory=dict)


def matrix(rows: Sequence[Sequence[Number]]) -> Any:
    """(..., m, n) of numbers, or of stacks of them."""
    elements = np.broadcast_arrays(*(x for row in rows for x in row))
    return np.stack(elements, axis=-1).reshape(*elements[0].shape, len(rows), len(rows[0]))


def times(a: Any, x: Any) -> Any:
    """A x of matrices (..., m, n) and vectors (..., n)."""
    return (a @ x[..., None])[..., 0]


def divided(x: Any, a: Any) -> Any:
    """A^-1 x of matrices (..., n, n) and vectors (..., n)."""
    return np.linalg.solve(a, x[..., None])[..., 0]


def arms(inboard: Number, outboard: Number) -> Array:
    """Displacements yi zi yo zo of two planes from y z psi theta."""
    return np.asarray(matrix([[1, 0, 0, -inboard], [0, 1, inboard, 0], [1, 0, 0, outboard], [0, 1, -outboard, 0.0]]))


def placed(at: Array, turn: Array) -> Array:
    """The same of axes or probes at places (4,) m and angles (4,) rad from y towards z, as `stations.row` has it."""
    y, z = (_square(f(turn)) for f in (np.cos, np.sin))
    return np.stack([y, z, -z * at, y * at], axis=-1)


def _square(shares: Array) -> Array:
    nearest = np.round(shares)
    return np.where(np.abs(shares - nearest) < SQUARE, nearest, shares)


def waves(s: Stand) -> Complex:
    """(4, 2): how an unbalance in each of two planes pulls along y and z there."""
    late = -1j * s.hand
    return np.asarray(matrix([[1, 0], [late, 0], [0, 1], [0, late]]))


def impedance(s: Stand, k_x: Array, speed: Number, w: Number) -> Complex:
    """D(w) - A' K_x A, (4, 4) N/m and N m; stacks of speeds go with stacks of stands."""
    heavy, slow, gyro = -(w**2) * s.mass, -(w**2) * s.inertia, 1j * w * s.polar * s.hand * speed
    moving = matrix([[heavy, 0, 0, 0], [0, heavy, 0, 0], [0, 0, slow, gyro], [0, 0, -gyro, slow]])
    end, at = matrix([[1, 0, 0, -s.l_c], [0, 1, s.l_c, 0]]), s.axes
    coupled = np.asarray(s.coupling)[..., None, None] * (end.mT @ end)
    return np.asarray(moving + coupled - at.mT @ (k_x[..., None] * at))


def slopes(s: Stand, means: Array) -> tuple[Array, Array, Array]:
    """K_p, K_n N/A and K_x N/m of the four axes, at mean readings (12,)."""
    i = (means[..., 4:] - s.i_zero) / s.i_gain
    p, n = i[..., ::2], i[..., 1::2]
    place = times(s.axes, divided((means[..., :4] - s.zero) / s.gain, s.probes))
    near, far = s.gap - place - s.offset, s.gap + place + s.offset
    return (
        2 * s.beta * p / near**2,
        -2 * s.beta * n / far**2,
        2 * s.beta * (p**2 / near**3 + n**2 / far**3),
    )


def mean_forces(s: Stand, means: Array) -> Array:
    """Mean forces of the four axes, N, at mean readings (12,), by T (2.4b)."""
    k_p, k_n, _ = slopes(s, means)
    i = (means[..., 4:] - s.i_zero) / s.i_gain
    return np.asarray((k_p * i[..., ::2] + k_n * i[..., 1::2]) / 2)


def control_forces(s: Stand, turning: Turning) -> tuple[Complex, Array]:
    """Forces and moments (4,) of the control currents, and K_x (4,)."""
    k_p, k_n, k_x = slopes(s, turning.means)
    i = turning.vectors[..., 4:] / s.i_gain
    force = k_p * i[..., ::2] + k_n * i[..., 1::2]
    if turning.higher:
        orders = {1.0: turning.vectors, **turning.higher}
        at = {n: Turning(turning.speed, turning.means, v) for n, v in orders.items()}
        force = force + forces_beyond_slopes(s, at, {n: v[..., :4] / s.gain for n, v in orders.items()})[1.0]
    return np.asarray(times(s.axes.mT, force)), k_x


def unbalances(s: Stand, turning: Turning, runout: Complex, more: Complex | None = None) -> tuple[Complex, Number]:
    """Unbalance (2,) kg m, e^(j angle from the mark), by least squares; the share of the forces that it leaves unexplained.
    `more` (4,) N at the AMBs, beyond the slopes."""
    u, left, whole = left_over(s, turning, runout, more)
    return u, np.linalg.norm(left, axis=-1) / whole


def left_over(
    s: Stand, turning: Turning, runout: Complex, more: Complex | None = None
) -> tuple[Complex, Complex, Number]:
    """Unbalance (2,) kg m as `unbalances` gives it; what it leaves of forces and moments (4,) N, moments at arms of 0.1 m; the
    size of the forces, N."""
    force, k_x = control_forces(s, turning)
    if more is not None:
        force = force + times(s.axes.mT, more)
    w = turning.speed
    q = divided(turning.vectors[..., :4] / s.gain - runout, s.probes)
    inertial = times(impedance(s, k_x, w, w), q)
    u, left = equivalent(s, inertial - force, w)
    return u, left, np.linalg.norm(SCALE * inertial, axis=-1) + np.linalg.norm(SCALE * force, axis=-1)


def equivalent(s: Stand, force: Complex, w: float) -> tuple[Complex, Complex]:
    """Unbalance (2,) kg m in the planes that at `w` rad/s acts as forces and moments (4,), by least squares; what it leaves
    over of them (4,) N, moments at arms of 0.1 m."""
    acts = SCALE[:, None] * (w**2 * arms(s.l_iu, s.l_ou).mT @ waves(s))
    target = SCALE * force
    u = times(np.linalg.pinv(acts), target)
    return np.asarray(u, np.complex128), np.asarray(target - times(acts, u), np.complex128)


def as_unbalance(s: Stand, means: Array, runout: Complex, w: float) -> Complex:
    """The unbalance (2,) kg m that at `w` rad/s would make the probes read what a runout (4,) m makes them read.

    A loop of any controller sees nothing but what the probes read. With q = H (F + w^2 B U) of the shaft alone and
    X = A_s q + R the readings of U and R are X = G (U + U_R) with w^2 B U_R = H^-1 A_s^-1 R: the loop is in G alone.
    """
    return equivalent(s, runout_forces(s, means, runout, w), w)[0]


def runout_forces(s: Stand, means: Array, runout: Complex, w: float) -> Complex:
    """Forces and moments (4,) by which a runout (4,) m acts on a loop at `w` rad/s: H^-1 A_s^-1 R."""
    return np.asarray(times(impedance(s, slopes(s, means)[2], w, w), divided(runout, s.probes)))


def shaft_motion(s: Stand, turning: Turning, order: float, unbalance: Complex, more: Complex | None = None) -> Complex:
    """What the shaft itself does at the probes (4,) m, by the balance of forces; `more` (4,) N at the AMBs."""
    force, k_x = control_forces(s, turning)
    if more is not None:
        force = force + times(s.axes.mT, more)
    w = order * turning.speed
    if order == 1:
        force = force + w**2 * times(arms(s.l_iu, s.l_ou).mT, times(waves(s), unbalance))
    return np.asarray(times(s.probes, divided(force, impedance(s, k_x, turning.speed, w))))


@dataclass(frozen=True)
class Found:
    """Of slow roll, by order: `runout` (4,) m, what the shaft did at the probes `shaft` (4,) m; `unbalance` (2,) kg m and the
    share of the forces at the fast dwell that is not explained."""

    runout: Mapping[float, Complex]
    shaft: Mapping[float, Complex]
    unbalance: Complex
    misfit: float


@dataclass(frozen=True)
class Mixed:
    """Forces beyond the slopes, (4,) N at the AMBs: of each order at slow roll, of order 1 at the fast dwell."""

    slow: Mapping[float, Complex]
    fast: Complex


def find_runout(s: Stand, slow: Mapping[float, Turning], fast: Turning | None, more: Mixed | None = None) -> Found:
    """Runout of every order of `slow`."""
    unbalance, misfit = np.zeros(2, complex), 0.0
    more = more or Mixed({n: np.zeros(4, complex) for n in slow}, np.zeros(4, complex))
    shaft = {n: shaft_motion(s, at, n, unbalance, more.slow[n]) for n, at in slow.items()}
    for _ in range(ROUNDS if fast is not None and 1.0 in slow else 0):
        runout = slow[1.0].vectors[..., :4] / s.gain - shaft[1.0]
        unbalance, misfit = unbalances(s, fast, runout, more.fast)  # type: ignore[arg-type]
        shaft[1.0] = shaft_motion(s, slow[1.0], 1.0, unbalance, more.slow[1.0])
    return Found({n: at.vectors[..., :4] / s.gain - shaft[n] for n, at in slow.items()}, shaft, unbalance, misfit)


def mixed_forces(s: Stand, slow: Mapping[float, Turning], fast: Mapping[float, Turning]) -> Mixed:
    """What the slopes leave out, at slow roll and at a fast dwell, whose orders are given too."""
    first = find_runout(s, slow, fast.get(1.0))
    moving = {n: at.vectors[..., :4] / s.gain - first.runout[n] for n, at in fast.items() if n in slow}
    there = forces_beyond_slopes(s, {n: fast[n] for n in moving}, moving).get(1.0) if moving else None
    return Mixed(forces_beyond_slopes(s, slow, first.shaft), np.zeros(4, complex) if there is None else there)


def forces_beyond_slopes(
    s: Stand, slow: Mapping[float, Turning], shaft: Mapping[float, Complex]
) -> dict[float, Complex]:
    """What T (2.4b) gives of each order beyond its slopes, (4,) N at the AMBs: i^2 and 1/gap^2 make of order 1 times order 2
    another order 1, a percent of it."""
    to_amb = s.axes @ np.linalg.inv(s.probes)
    means = next(iter(slow.values())).means
    place = times(to_amb, (means[:4] - s.zero) / s.gain)[..., None] + np.zeros(len(TURN))
    i = ((means[4:] - s.i_zero) / s.i_gain)[..., None] + np.zeros(len(TURN))
    k_p, k_n, k_x = slopes(s, means)
    straight: dict[float, Complex] = {}
    for n, at in slow.items():
        turn, x, amps = np.exp(1j * n * TURN), times(to_amb, shaft[n]), at.vectors[..., 4:] / s.i_gain
        place, i = place + (x[..., None] * turn).real, i + (amps[..., None] * turn).real
        straight[n] = k_p * amps[..., ::2] + k_n * amps[..., 1::2] + k_x * x
    near, far = (s.gap[..., None] + side * (place + s.offset[..., None]) for side in (-1, 1))
    force = s.beta[..., None] * ((i[..., ::2, :] / near) ** 2 - (i[..., 1::2, :] / far) ** 2)
    return {n: 2 * (force * np.exp(-1j * n * TURN)).mean(axis=-1) - straight[n] for n in slow}
