"""The bare model: what an axis moves, from force and reading of sines, with and without a part that is known.

The controller's map makes s F of a force F that it gives, and that comes later by a time tau, in which currents rise:

    s F(t - tau) = J a(t) + D v(t) + C sign v(t) + b.                                                  (1)

The reading is fitted by harmonics, as friction makes more of them than the first, and differentiated there: v turns not where
its first harmonic does, so that friction is not at right angles to the acceleration. About its turns the axis may stick, and
friction is not C there: what is slow is left out. y = J/s is a coefficient of F on the regressors X = (a, sign v, v, 1).

The reading is rounded, by e. By least squares, a + e'' in the place of a would make y less, by the share

    <e''^2>/<a^2> + <a e''>/<a^2>,                                                                     (2)

the latter as the loop goes by the reading: it answers e with a force, and a shaft of less inertia with more acceleration. And
a shaft that repeats its periods repeats their rounding: of N periods all of e is of harmonics, N times as much as of noise.
So X is multiplied by instruments Z alone, which e hardly reaches:

    y = first of (Z X^T)^-1 Z F,   Z = g (a_1, sign v_1, v_1, 1),   g = max(|v_1|/max|v_1| - SLOW, 0),  (3)

of the first harmonic. g begins at nothing, lest Z had high harmonics itself, which meet those of e''.

With a part P on, y_2 - y_1 = P/s, and

    J = P y_1/(y_2 - y_1),                                                                             (4)

in which s is no more, nor the scale of the reading. s differs from sine to sine, as the places do, and all sines of an axis are
to tell the same J. s is another for greater forces, too: iron saturates, sensors of currents have offsets, and while phases
take over from each other force is short of what the map says. So the sine with the part is slower: by the root of J/(J + P) it
would ask for as much force as the one without; what takeovers take is a share that grows with speed and with currents, and
would be the same by the fourth root. A delay that is taken wrongly turns acceleration into speed, which the regression has,
too: it moves J by little, and is in the budget.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Take = npt.NDArray[np.intp]
MOST, FEWEST = 40, 5  # harmonics
ROUNDED = 1e-3  # of the square of the acceleration, that rounding of the reading may make if no period repeats
SLOW = 0.3  # of the greatest speed: below it friction may be that of sticking; above it what counts grows evenly
LEFT = 4  # degrees of freedom, at least, where what goes around is taken out of a scatter
EVEN = 1e-6
DELAYS = (0.0, 2e-3)  # s, at which coefficients are worked out; between them they go straight


def harmonics_of(samples: int, amplitude: float, count: float) -> int:
    """How many harmonics of a reading are fitted. Rounded to counts p it has p^2/12 of noise, of which each harmonic takes 2/n;
    up to H these are accelerations of the square p^2 H^5/(30 n A^2) of that of a sine of amplitude A, and as many times more as
    there are periods, where these repeat."""
    if count == 0:
        return MOST
    most = (30 * ROUNDED * samples * (amplitude / count) ** 2) ** 0.2
    return int(min(max(most, FEWEST), MOST))


def operators(t: Array, reading: Array, hz: float, count: float = 0.0) -> tuple[float, Array, Array]:
    """First amplitude of a reading (n,), in counts of that size, and what a force is multiplied by to be inertia and Coulomb
    friction, (2, n) each, at both DELAYS, by (3)."""
    many = harmonics_of(len(t), float(np.ptp(reading)) / 2, count)
    turn = 2 * math.pi * hz * np.arange(1, many + 1)

    def harmonics(at: Array) -> Array:
        return np.concatenate([np.exp(1j * np.outer(turn, at)).real, np.exp(1j * np.outer(turn, at)).imag])

    design = np.concatenate([np.ones((1, len(t))), harmonics(t)]).T
    found = np.linalg.lstsq(design, reading, rcond=None)[0][1:]
    half = found[:many] - 1j * found[many:]
    inertia, rubs = [], []
    for delay in DELAYS:
        wave = half[:, None] * np.exp(1j * np.outer(turn, t + delay))
        regressors = _terms(*((1j * turn) ** k @ wave for k in (2, 1)))
        instruments = _terms(*((1j * turn[0]) ** k * wave[0] for k in (2, 1)))
        speed = np.abs(instruments[2])
        instruments *= np.maximum(speed / speed.max() - SLOW, 0)
        inverse = np.linalg.solve(instruments @ regressors.T, instruments)
        inertia.append(inverse[0])
        rubs.append(inverse[1])
    return float(abs(half[0])), np.array(inertia), np.array(rubs)


def _terms(a: npt.NDArray[np.complex128], v: npt.NDArray[np.complex128]) -> Array:
    """What (1) is made of, (4, n)."""
    return np.array([a.real, np.sign(v.real), v.real, np.ones(len(v))])


@dataclass(frozen=True)
class Axis:
    """Of one axis, bare and with the part, n repeats, m sines: force by the map per acceleration, and Coulomb friction by the
    map, (2, n, m, 2) at both DELAYS."""

    per: Array
    rubs: Array


@dataclass(frozen=True)
class Moved:
    """`each` (m,), J by each sine; `by_map` (2, m), J/s bare and with the part; friction `rubs` (2, m) by the map."""

    each: Array
    by_map: Array
    rubs: Array

    @property
    def inertia(self) -> float:
        """By the first sine."""
        return float(self.each[0])


def moved(a: Axis, part: float, delay: float, take: Take) -> Moved:
    """At a delay of the force, by means over the repeats `take`."""
    share = (delay - DELAYS[0]) / (DELAYS[1] - DELAYS[0])
    by_map, rubs = (((1 - share) * x[..., 0] + share * x[..., 1])[:, take].mean(axis=1) for x in (a.per, a.rubs))
    return Moved(part * by_map[0] / (by_map[1] - by_map[0]), by_map, rubs)


def pseudo(values: Sequence[Array], whole: Array) -> Array:
    """Of n results with one repeat left out each: what each repeat says by itself (Tukey), (n, q)."""
    n = len(values)
    return n * whole - (n - 1) * np.array(values)


def scatter(values: Array, turn: Array) -> tuple[float, float]:
    """Standard uncertainty of the mean of n values, and its degrees of freedom. Where they are spread evenly over the angles
    `turn` (n,), rad, what goes once around with these adds nothing to the mean, and is left out of what scatters."""
    n, around = len(values), np.exp(1j * turn)
    even = abs(around.mean()) < EVEN and abs((around**2).mean()) < EVEN
    parts = [np.ones(n), around.real, around.imag] if even and n - 3 >= LEFT else [np.ones(n)]
    design, dof = np.column_stack(parts), n - len(parts)
    left = values - design @ np.linalg.lstsq(design, values, rcond=None)[0]
    return math.sqrt(float(left @ left) / dof / n), float(dof)
