"""The second harmonic of a swing about a magnet that carries a load: what a fit of oscillations leaves out of the overshoot."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from procedures.step.estimates import harmonic_left
from procedures.step.fit import swing
from procedures.step.oscillation import One

TICK_S, PERIOD, LENGTH_S = 5e-5, 10, 0.3
LOAD, SIZE, LAG_S, HZ = 0.3, 0.04, 3e-4, 85.0  # share of the bias, of the gap, of the amplifiers, of the loop
Array = np.ndarray


def force(u: float, v: float) -> float:
    """Of two coils on a shaft, u of the gap away, v of the bias: v + u where both are small."""
    return ((1 + v) ** 2 / (1 - u) ** 2 - (1 - v) ** 2 / (1 + u) ** 2) / 4


def holding(u: float) -> float:
    """The current that holds the load there."""
    low, high = -1.0, 1.0
    for _ in range(60):
        low, high = ((low + high) / 2, high) if force(u, (low + high) / 2) < LOAD else (low, (low + high) / 2)
    return low


def stepped(gain: float, damping: float, constant: float, begin: float, end: float) -> Array:
    """Positions (n,) over the gap, of a loop with an integrator of that time constant."""
    rate = 2 * math.pi * HZ
    stiff = rate**2 / (gain - 1)
    damper, integral = 2 * damping * rate / stiff, (gain - 1) / constant
    u, du, v = begin, 0.0, holding(begin)
    held, out = v, []
    for _ in range(round(LENGTH_S / TICK_S)):
        out.append(u)
        for _ in range(4):  # Euler, half implicit: quick, and near enough to a loop with as much delay
            h = TICK_S / 4
            v += h / LAG_S * (gain * (end - u) - damper * du + held - v)
            held += h * integral * (end - u)
            du += h * stiff * (force(u, v) - LOAD)
            u += h * du
    return np.array(out)


@cache
def made(gain: float, damping: float, constant: float) -> dict[int, list[Array]]:
    """Responses by way, as shares of the step."""
    out: dict[int, list[Array]] = {1: [], -1: []}
    for begin, end in ((0.0, SIZE), (SIZE, 0.0), (0.0, -SIZE), (-SIZE, 0.0)):
        out[1 if end > begin else -1].append((stepped(gain, damping, constant, begin, end) - begin) / (end - begin))
    return out


def one(y: Array) -> One:
    """A step as means over PERIOD ticks."""
    many = len(y) // PERIOD
    means = y[: many * PERIOD].reshape(many, PERIOD).mean(axis=1)
    t = (np.arange(1, many + 1) * PERIOD - 0.5) * TICK_S
    return One(t, np.array([means, np.zeros(many)]))


@pytest.mark.parametrize("constant", [0.06, 0.58])
@pytest.mark.parametrize("gain", [3.0, 6.0])
@pytest.mark.parametrize("damping", [0.3, 0.45, 0.6])
def test_what_fits_leave_is_within_the_bound_and_not_far_below(gain: float, damping: float, constant: float) -> None:
    """A tenth of the directions' difference, whatever the damping, was ten times as much as is left at a damping of 0.5, and
    most of the budget of steps across a load."""
    responses = made(gain, damping, constant)
    tops = {way: float(np.mean(of, axis=0)[: round(0.08 / TICK_S)].max()) - 1 for way, of in responses.items()}
    fits = {way: swing([one(y) for y in of]) for way, of in responses.items()}
    left = {way: fits[way].peak - 1 - tops[way] for way in fits}
    apart = abs(left[1] - left[-1]) / 2
    half = harmonic_left(tops[1] - tops[-1], fits[1])
    assert abs(tops[1] - tops[-1]) > 5e-3
    assert apart < half < 9 * apart
