"""Spectra against scipy and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal
from turning import FULL, TELEMETRY, Shaft

from bench.analysis.ordermap import order_map
from bench.analysis.spectra import amplitude, density, full, waterfall
from bench.errors import AnalysisError

RATE = 10_000.0


def sine(hz: float, size: float, n: int = 8192) -> np.ndarray:
    return np.asarray(size * np.cos(2 * np.pi * hz * np.arange(n) / RATE + 0.7))


@pytest.mark.parametrize("window", ["boxcar", "hann", "flattop"])
@pytest.mark.parametrize(("scaling", "factor"), [("0-pk", 1.0), ("pk-pk", 2.0), ("rms", np.sqrt(0.5))])
def test_a_sine_on_a_line_reads_its_amplitude(window: str, scaling: str, factor: float) -> None:
    hz = 40 * RATE / 1024
    found = amplitude(3e-6 + sine(hz, 5e-6), RATE, segment=1024, window=window, scaling=scaling)  # type: ignore[arg-type]
    assert found.hz[40] == pytest.approx(hz)
    assert found.values[0, 40] == pytest.approx(5e-6 * factor, rel=1e-9)
    assert found.values[0, 0] == 0
    assert found.averages == 15


@pytest.mark.parametrize("segment", [1000, 1024, 1023])
@pytest.mark.parametrize("window", ["hann", "blackmanharris"])
def test_the_density_is_welchs(segment: int, window: str) -> None:
    x = np.random.default_rng(0).normal(0, 1, (3, 20_000)) + 5.0
    found = density(x, RATE, segment=segment, window=window)
    hz, expected = signal.welch(x, RATE, window, segment, noverlap=segment - max(segment // 2, 1), detrend="constant")
    assert np.allclose(found.hz, hz)
    assert np.allclose(found.values, expected, rtol=1e-9, atol=1e-18)
    _, lines = signal.welch(x, RATE, window, segment, noverlap=segment - max(segment // 2, 1), scaling="spectrum")
    rms = amplitude(x, RATE, segment=segment, window=window, scaling="rms").values
    assert np.allclose(rms[:, 1:-1] ** 2, lines[:, 1:-1], rtol=1e-9)


def test_the_noise_bandwidth_turns_one_into_the_other() -> None:
    x = np.random.default_rng(1).normal(0, 1, 50_000)
    lines, psd = amplitude(x, RATE, segment=2000, scaling="rms"), density(x, RATE, segment=2000)
    assert lines.enbw_hz == pytest.approx(1.5 * RATE / 2000)
    assert np.allclose(lines.values[0, 1:-1] ** 2, psd.values[0, 1:-1] * psd.enbw_hz)


def test_a_waterfall_shows_the_synchronous_line_at_the_speed() -> None:
    shaft = Shaft(200.0, 80.0)
    t = np.arange(100_000) / RATE
    x = 4e-6 * np.cos(shaft.angle(t)) + 2e-6 * np.cos(2 * np.pi * 400 * t)
    found = waterfall(t, x, shaft.tacho(10.0), FULL, segment=2048, count=40)
    assert np.ptp(np.diff(found.speed)) < 0.2 * np.ptp(found.speed) / 40 * 2
    slow = found.hz < 300
    peak = found.hz[slow][found.values[:, slow].argmax(axis=1)]
    assert np.abs(peak - found.speed / 2 / np.pi).max() < RATE / 2048
    fixed = np.argmin(np.abs(found.hz - 400))
    assert np.allclose(found.values[:, fixed], 2e-6, rtol=0.06)


def test_an_order_map_keeps_the_orders_on_their_lines() -> None:
    shaft = Shaft(200.0, 80.0)
    t = np.arange(100_000) / RATE
    theta = shaft.angle(t)
    x = 4e-6 * np.cos(theta) + 1e-6 * np.cos(3 * theta) + 5e-7 * np.cos(0.4375 * theta)
    found = order_map(t, x, shaft.tacho(10.0), FULL, turns=16)
    for order, size in ((1.0, 4e-6), (3.0, 1e-6), (0.4375, 5e-7), (2.0, 0.0)):
        assert np.allclose(found.values[:, round(order * 16)], size, atol=2e-9)
    assert np.allclose(found.speed, 200 + 80 * found.t, rtol=2e-3)


def test_an_order_map_of_means_of_readings_is_put_right_and_blank_beyond_its_band() -> None:
    shaft = Shaft(500.0, 60.0)
    readings = np.arange(100_000) / RATE
    x = 4e-6 * np.cos(shaft.angle(readings))
    t = np.arange(1, 10_001) * 1e-3
    found = order_map(t, x.reshape(-1, 10).mean(axis=1), shaft.tacho(10.0), TELEMETRY, turns=16, highest=6)
    assert np.allclose(found.values[:, 16], 4e-6, rtol=0.02)
    assert np.isnan(found.values[-1, -1])
    assert np.isfinite(found.values[:, 16]).all()


def test_nothing_folds_into_the_order_map_of_a_slow_shaft() -> None:
    shaft = Shaft(40.0)
    t = np.arange(60_000) / RATE
    above = signal.butter(8, 1500, "highpass", fs=RATE, output="sos")
    x = signal.sosfilt(above, np.random.default_rng(6).normal(0, 1e-5, t.size))
    found = order_map(t, x, shaft.tacho(6.0), FULL, turns=8, highest=10)
    assert np.sqrt(np.mean(found.values[:, 8:] ** 2)) < 1e-9


@pytest.mark.parametrize("x_to_y", [True, False])
def test_a_full_spectrum_tells_forward_from_backward(x_to_y: bool) -> None:
    t = np.arange(10_000) / RATE
    way = 1 if x_to_y else -1
    z = (
        3e-6 * np.exp(2j * np.pi * 100 * t)
        + 1e-6 * np.exp(-2j * np.pi * 100 * t + 1j)
        + 5e-7 * np.exp(-2j * np.pi * 47 * t)
    )
    found = full(z.real, way * z.imag, RATE, x_to_y=x_to_y)
    read = {hz: found.values[np.argmin(np.abs(found.hz - hz))] for hz in (100, -100, -47, 47)}
    assert read == pytest.approx({100: 3e-6, -100: 1e-6, -47: 5e-7, 47: 0.0}, abs=1e-12)
    line = full(np.real(z) * 0 + sine(100.0, 4e-6, 10_000), np.zeros(10_000), RATE)
    assert line.values[np.abs(np.abs(line.hz) - 100) < 0.1] == pytest.approx([2e-6, 2e-6])


def test_refusals() -> None:
    with pytest.raises(AnalysisError, match="segments"):
        amplitude(np.zeros(100), RATE, segment=200)
    with pytest.raises(AnalysisError, match="turns"):
        order_map(np.arange(1000) / RATE, np.zeros(1000), Shaft(100.0).tacho(1.0), FULL)
