"""What means over a period leave of a rise of few of them, on made responses: more than a hundredth, no more than is told."""

from __future__ import annotations

import math

import numpy as np
import pytest

from procedures.step import response, rising
from procedures.step.oscillation import Array, One
from procedures.step.steps import Case

UP = Case("A", 0.0, "z", 10e-6, 1)
LAG = 0.15  # of a loop, over 1/w
FINE = 1e-3


def total(z: float, lag: float) -> tuple[Array, float]:
    """Running sum of a second-order step of w = 1 behind a lag, at every FINE, and the rise of the step itself."""
    t = np.arange(0, 14, FINE)
    pole = complex(-z, math.sqrt(1 - z * z))
    y = 1 - ((1 - 1j * z / pole.imag) * np.exp(pole * t)).real
    if lag:
        weights = np.exp(-t / lag)
        y = np.convolve(y, weights / weights.sum())[: len(t)]
    top = int(np.flatnonzero(y >= 0.9)[0]) + 1
    low, high = np.interp((0.1, 0.9), y[:top], t[:top])
    return np.concatenate(([0.0], np.cumsum((y[1:] + y[:-1]) / 2) * FINE)), float(high - low)


def seen(summed: Array, period: float, phase: float) -> One:
    """Means over a period (from which t counts in seconds, of 1 kHz) that begin at a phase of it; the step acts at 0."""
    edges = (np.arange(-20, 12) + phase) * period
    y = np.diff(np.where(edges < 0, 0.0, np.interp(edges, np.arange(len(summed)) * FINE, summed))) / period
    return One(edges[1:] / period * 1e-3, np.array([y, 0 * y]))


@pytest.mark.parametrize("unclear", [False, True])
@pytest.mark.parametrize("samples", [2.2, 2.44, 3.0, 3.5])
@pytest.mark.parametrize("z", [0.2, 0.3, 0.45, 0.6])
def test_what_few_samples_leave_is_within_the_bound(z: float, samples: float, unclear: bool) -> None:
    summed, rise = total(z, LAG)
    period, worst = rise / samples, 0.0
    for phase in np.arange(0, 1, 0.04):
        found, left = rising.rises({UP: [seen(summed, period, float(phase))]}, {UP.group} if unclear else ())
        error = abs(found.values[UP] / 1e-3 - samples)
        assert error < left[UP] / 1e-3 + 1e-4
        worst = max(worst, error)
    if z == 0.6 and samples < 3:  # what was told of it until then
        assert worst > rising.RISE_SHARE


def test_from_rest_a_sharp_foot_is_told_better() -> None:
    summed, rise = total(0.6, LAG)
    off: dict[str, list[float]] = {"plain": [], "held": []}
    for phase in np.arange(0, 1, 0.04):
        one = seen(summed, rise / 2.44, float(phase))
        for name, curve in (("plain", response.curve), ("held", response.curve_from_rest)):
            off[name].append(abs(response.rise_time(*curve(one.t, one.both[0])) / 1e-3 - 2.44))
    assert max(off["plain"]) > 0.035
    assert max(off["held"]) < 0.02


def test_many_samples_are_told_by_the_spline_alone() -> None:
    summed, rise = total(0.3, 0.0)
    one = seen(summed, rise / 4.4, 0.3)
    for unclear in ((), (UP.group,)):
        found, left = rising.rises({UP: [one]}, unclear)
        assert found.values[UP] == response.rise_time(*response.curve(one.t, one.both[0]))
        assert left[UP] == pytest.approx(rising.spline_left(found.values[UP], 1e-3), rel=1e-9)
