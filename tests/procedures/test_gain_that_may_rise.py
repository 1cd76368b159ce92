"""How far a gain may rise, by single sines: six lines an octave bend the curve through them more than those of a comb."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from scipy.optimize import brentq

from bench.analysis import peaks
from procedures.sensitivity import margins

NOISE = 0.01  # of a line, by which lines are weighed; the lines themselves have none


def loop(hz: npt.ArrayLike) -> npt.NDArray[np.complex128]:
    """A magnet of 40 Hz with PD (60 Hz), amplifiers and filter of 800 and 900 Hz and 190 µs of delay."""
    s = 2j * math.pi * np.asarray(hz, np.float64)

    def corner(at: float) -> npt.NDArray[np.complex128]:
        return np.asarray(1 + s / (2 * math.pi * at))

    return np.asarray(
        2.6 * corner(60) / ((s / (2 * math.pi * 40)) ** 2 - 1) / corner(800) / corner(900) * np.exp(-s * 1.9e-4)
    )


@pytest.mark.parametrize(
    ("reaches", "low", "high"),
    [(margins.OF_SINES, -0.006, 0.006), (margins.REACHES[:1], 0.0, math.inf), (((3.0, 3),), 0.04, 0.07)],
)
def test_lines_of_single_sines(reaches: tuple[tuple[float, int], ...], low: float, high: float) -> None:
    """A polynomial of degree 3 over a factor of three tells 5 % too much; one for lines of a comb has too few of them."""
    at = brentq(lambda f: float(loop(f).imag), 300.0, 600.0)
    true = -1 / float(loop(at).real)
    hz = 2.0 * 2 ** (np.arange(62) / 6)
    z, power = 1 / (1 + loop(hz)), np.full(hz.size, NOISE**2)
    covariance = power[:, None, None] / 2 * np.eye(2)
    smooth, drawn = peaks.smoother(hz, z, covariance), peaks.noise(covariance, 0, margins.DRAWS)
    found = margins._least(hz, z, smooth.at_lines(z), power, drawn, smooth, reaches)
    if math.isinf(high):
        assert found is None
        return
    assert found is not None
    assert low < 1 / found[0] / true - 1 < high
