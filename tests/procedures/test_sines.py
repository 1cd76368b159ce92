"""Sine fits: exact on exact sines, unbiased with noise, by the known scatter of IEEE 1057."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.errors import AnalysisError
from procedures.shared.sines import known_frequency, unknown_frequency

amplitudes, phases, offsets = st.floats(0.01, 100), st.floats(-3.1, 3.1), st.floats(-100, 100)


@settings(deadline=None)
@given(amplitudes, phases, offsets, st.floats(0.3, 40))
def test_a_sine_of_known_frequency_is_found(amplitude: float, phase: float, offset: float, hz: float) -> None:
    t = np.arange(500) * 1e-2 + 17.0
    found = known_frequency(t, offset + amplitude * np.sin(2 * np.pi * hz * t + phase), hz)
    assert found.amplitude == pytest.approx(amplitude, rel=1e-6, abs=1e-9)
    assert found.offset == pytest.approx(offset, rel=1e-6, abs=1e-6)
    assert math.remainder(found.phase - phase, 2 * math.pi) == pytest.approx(0, abs=1e-6)


@settings(deadline=None)
@given(amplitudes, phases, st.floats(0.5, 40), st.booleans())
def test_a_sine_of_unknown_frequency_is_found(amplitude: float, phase: float, hz: float, guessed: bool) -> None:
    t = np.arange(1000) * 1e-2 - 3.0
    y = 2.0 + amplitude * np.sin(2 * np.pi * hz * t + phase)
    found = unknown_frequency(t, y, hz * 1.002 if guessed else None)
    assert found.hz == pytest.approx(hz, rel=1e-7)
    assert found.amplitude == pytest.approx(amplitude, rel=1e-6)
    assert math.remainder(found.phase - phase, 2 * math.pi) == pytest.approx(0, abs=1e-4)
    np.testing.assert_allclose(found.at(t), y, atol=1e-5 * amplitude)


def test_uncertainty_is_that_of_white_noise() -> None:
    """u(amplitude) = s sqrt(2/n), u(phase) = u(amplitude)/amplitude for whole periods."""
    rng = np.random.default_rng(8)
    t = np.arange(400) * 5e-3
    found = [
        known_frequency(t, 3 * np.sin(2 * np.pi * 5 * t + 0.4) + 0.2 * rng.normal(size=400), 5.0) for _ in range(300)
    ]
    expected = 0.2 * math.sqrt(2 / 400)
    assert np.mean([f.u_amplitude for f in found]) == pytest.approx(expected, rel=0.05)
    assert np.std([f.amplitude for f in found]) == pytest.approx(expected, rel=0.15)
    assert np.mean([f.u_phase for f in found]) == pytest.approx(expected / 3, rel=0.05)
    assert np.std([f.phase for f in found]) == pytest.approx(expected / 3, rel=0.15)
    assert np.mean([f.rms for f in found]) == pytest.approx(0.2, rel=0.05)


def test_noise_does_not_bias_the_frequency() -> None:
    """Known bound: u(f) = sqrt(6/n) s / (pi A T)."""
    rng = np.random.default_rng(9)
    t = np.arange(500) * 4e-3
    found = [unknown_frequency(t, np.sin(2 * np.pi * 7.3 * t) + 0.1 * rng.normal(size=500)).hz for _ in range(200)]
    bound = math.sqrt(6 / 500) * 0.1 / (math.pi * 2.0)
    assert np.mean(found) == pytest.approx(7.3, abs=4 * bound / math.sqrt(200))
    assert np.std(found) == pytest.approx(bound, rel=0.2)


@pytest.mark.parametrize("hz", [0.0, -1.0, math.nan])
def test_a_frequency_must_be_one(hz: float) -> None:
    with pytest.raises(AnalysisError):
        known_frequency(np.arange(10.0), np.arange(10.0), hz)


def test_too_few_samples() -> None:
    with pytest.raises(AnalysisError):
        unknown_frequency(np.arange(4.0), np.arange(4.0))
