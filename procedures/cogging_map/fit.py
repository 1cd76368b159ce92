"""The bare model: harmonics of a current that moves a mass slowly over a force that changes with its place.

    K i = F(x) + M x''

F of c periods to a turn of the phase is F_1 sin c(p - p_0) + S sin 2c(p - p_0) + C cos 2c(p - p_0), taken off by K i. A loop
does not hold its reference: the mover swings about steady progress, by several times as much where nothing is fed forward.
Harmonics of the time, of which the position has a constant, a straight line and the first few, are known in closed form; so is
their x''. In harmonics of the place x'' has others, too: of a swing e at k periods, (k w)^2 e k e/2 at twice as many.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from procedures.shared.leastsquares import linear

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
GRID = 720
SWINGS = 5  # harmonics of the time that the position has


@dataclass(frozen=True)
class Swept:
    """Of one sweep: mean of the current, `constant`, its `harmonics` (p,) by order, complex c of Re(c exp(j k b)), and those of
    the acceleration, `rising`; `rate`, db/dt of the map's phase b, rad/s; how far the mover `swung` at the first one."""

    constant: float
    harmonics: Complex
    rising: Complex
    rate: float
    swung: float

    def corrected(self, mass_over_constant: float) -> Complex:
        """Harmonics of F/K: without what the mass takes to swing."""
        out: Complex = self.harmonics - mass_over_constant * self.rising
        return out


def swept(phase: Array, times: Array, position: Array, current: Array, orders: Sequence[int], first: int) -> Swept:
    """Fit of readings (n,) at phases of the map, `first` the periods of cogging on it.

    Raises:
        AnalysisError: the phases do not determine the harmonics.
    """
    t = times - times.mean()
    rate = float(np.polyfit(t, phase, 1)[0])
    swings = first * np.arange(1, SWINGS + 1)
    in_time = _waves(rate * t, swings)
    terms = linear(np.column_stack([in_time, t]), position).terms
    squared = (rate * np.concatenate([[0], swings, swings])) ** 2
    acceleration = -(in_time * squared) @ terms[:-1]
    basis = _waves(phase, orders)
    (constant, harmonics), (_, rising) = (_complex(linear(basis, y).terms) for y in (current, acceleration))
    return Swept(constant, harmonics, rising, rate, float(math.hypot(terms[1], terms[1 + SWINGS])))


def _waves(phase: Array, orders: npt.ArrayLike) -> Array:
    turns = np.outer(phase, np.asarray(orders))
    return np.column_stack([np.ones_like(phase), np.cos(turns), np.sin(turns)])


def _complex(terms: Array) -> tuple[float, Complex]:
    p = terms.size // 2
    return float(terms[0]), terms[1 : p + 1] - 1j * terms[p + 1 :]


@dataclass(frozen=True)
class Shape:
    """`amplitude` of the first harmonic, `phase` p_0 rad of the current's phase, the second's shares `sine` and `cosine`."""

    amplitude: float
    phase: float
    sine: float
    cosine: float
    per: int

    def at(self, phase: npt.ArrayLike) -> Array:
        """What takes cogging off, at phases of the current."""
        b = self.per * (np.asarray(phase, np.float64) - self.phase)
        out: Array = self.amplitude * (np.sin(b) + self.sine * np.sin(2 * b) + self.cosine * np.cos(2 * b))
        return out

    @property
    def peak(self) -> tuple[float, float, float]:
        """Where the magnitude is greatest: sin b, sin 2b, cos 2b there, with the sign that makes their sum greatest."""
        b = 2 * np.pi * np.arange(GRID) / GRID
        parts = np.array([np.sin(b), np.sin(2 * b), np.cos(2 * b)])
        for _ in range(3):
            whole = parts[0] + self.sine * parts[1] + self.cosine * parts[2]
            k = int(np.argmax(np.abs(whole)))
            step = 2 * (b[1] - b[0])
            b = b[k] + np.linspace(-step, step, GRID)
            parts, sign = np.array([np.sin(b), np.sin(2 * b), np.cos(2 * b)]), math.copysign(1.0, whole[k])
        best = int(np.argmax(sign * (parts[0] + self.sine * parts[1] + self.cosine * parts[2])))
        return tuple(float(sign * x[best]) for x in parts)  # type: ignore[return-value]


def shape(first: complex, second: complex, per: int) -> Shape:
    """Of the first two harmonics: first = -j F_1 exp(-j c p_0), second = (C - j S) exp(-2j c p_0).

    Raises:
        AnalysisError: there is no first harmonic.
    """
    size = abs(first)
    if not size > 0:
        raise AnalysisError("the current does not change with the place")
    turned = -(math.atan2(first.imag, first.real) + math.pi / 2)  # c p_0
    turned = math.remainder(turned, 2 * math.pi)
    there = second / size * complex(math.cos(2 * turned), math.sin(2 * turned))
    return Shape(size, turned / per, -there.imag, there.real, per)
