"""Peaks of coil currents and voltages: a quantity that does not grow with the record, whose interval holds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.uncertainty import coverage_factor
from procedures.synchronous.coil_peaks import Exceeded, find_exceeded

TURN, PHI = 100, 0.8  # samples; of the noise from one to the next


def noisy(rng: np.random.Generator, turns: int, amplitude: float, noise: float) -> np.ndarray:
    """A coil's voltage: mean, order 1, coloured noise (turns x TURN,)."""
    n = turns * TURN
    white = rng.standard_normal(n + 200) * noise * math.sqrt(1 - PHI**2)
    coloured = np.zeros(n + 200)
    for k in range(1, n + 200):
        coloured[k] = PHI * coloured[k - 1] + white[k]
    return 1.5 + amplitude * np.cos(2 * np.pi * np.arange(n) / TURN + 0.3) + coloured[200:]


def found(x: np.ndarray, blocks: int = 16) -> Exceeded:
    return find_exceeded(x, np.round(np.linspace(0, len(x) // TURN, blocks + 1)).astype(np.intp) * TURN)


@pytest.mark.parametrize(("amplitude", "noise"), [(1.0, 0.2), (0.1, 0.2), (1.0, 0.02)])
def test_intervals_hold_the_quantile_of_a_long_record(amplitude: float, noise: float) -> None:
    rng, runs = np.random.default_rng(4), 200
    true = float(np.quantile(np.abs(noisy(rng, 4000, amplitude, noise)), 0.99))
    some = [found(noisy(rng, 32, amplitude, noise)) for _ in range(runs)]
    held = [abs(s.value - true) <= coverage_factor(s.dof) * s.u for s in some]
    assert np.mean(held) == pytest.approx(0.95, abs=3.3 * math.sqrt(0.95 * 0.05 / runs))


def test_it_does_not_grow_with_the_record_as_the_largest_reading_does() -> None:
    rng = np.random.default_rng(5)
    short, long = ([noisy(rng, turns, 0.5, 0.2) for _ in range(12)] for turns in (20, 320))
    means = [np.mean([found(x, 10).value for x in some]) for some in (short, long)]
    largest = [np.mean([np.abs(x).max() for x in some]) for some in (short, long)]
    assert means[1] == pytest.approx(means[0], abs=0.03)
    assert largest[1] - largest[0] > 0.1


def test_the_peak_of_a_clean_sine_is_its_amplitude() -> None:
    rng = np.random.default_rng(6)
    clean = found(-noisy(rng, 20, 1.0, 0.0), 10)
    assert clean.value == pytest.approx(2.5, rel=1e-3)
    assert clean.u < 1e-3
    assert clean.sign == -1
