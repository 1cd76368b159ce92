"""Frequency responses against scipy, a closed loop in closed form, and the peak of its sensitivity on seeded noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal
from turning import Shaft

from bench.analysis.peaks import peak
from bench.analysis.responses import (
    clear_of_orders,
    complementary,
    guaranteed_margins,
    lines,
    loop,
    response,
    single_response,
    without_orders,
)
from bench.errors import AnalysisError

RATE, PERIOD = 10_000.0, 2500
HZ = np.arange(8.0, 600.0, 4.0)


def sensitivity(hz: np.ndarray) -> np.ndarray:
    """One axis of an AMB with PD, low-pass and delay: S = 1/(1 + C P), P = ki/(m s^2 - ks)."""
    s = 2j * np.pi * hz
    controller = (1.2e4 + 25.0 * s / (1 + s / (2 * np.pi * 2000))) * np.exp(-1.5e-4 * s)
    return np.asarray(1 / (1 + controller * 40.0 / (6.0 * s**2 - 2e5)))


def injected(periods: int) -> np.ndarray:
    """A multisine with Schroeder's phases."""
    t = np.arange(PERIOD * periods) / RATE
    k = np.arange(HZ.size)
    phases = -np.pi * k * (k + 1) / HZ.size
    return np.asarray(np.cos(2 * np.pi * HZ[:, None] * t + phases[:, None]).sum(axis=0))


def closed(periods: int) -> np.ndarray:
    """What comes after the summing point in steady state: every line times S."""
    lined = np.fft.rfft(injected(1))
    places = np.rint(HZ * PERIOD / RATE).astype(int)
    out = np.zeros_like(lined)
    out[places] = lined[places] * sensitivity(HZ)
    return np.tile(np.fft.irfft(out, PERIOD), periods)


@pytest.mark.parametrize("estimator", ["H1", "H2", "ratio"])
def test_without_noise_every_estimator_is_exact(estimator: str) -> None:
    found = response(lines(np.array([injected(4), closed(4)]), RATE, PERIOD, HZ), 1, 0, estimator)  # type: ignore[arg-type]
    assert np.allclose(found.values, sensitivity(HZ), rtol=1e-9)
    assert np.allclose(found.coherence, 1)
    both = found.values + complementary(found).values
    assert np.allclose(both, 1)
    assert np.allclose(1 / (1 + loop(found).values), found.values)


def test_the_synchronous_lines_are_taken_out() -> None:
    shaft = Shaft(2 * np.pi * 83.3, 0.5)
    t = np.arange(PERIOD * 8) / RATE
    y = closed(8) + 40 * np.cos(shaft.angle(t) + 1) + 7 * np.cos(2 * shaft.angle(t)) + 3
    clean = without_orders(np.array([injected(8), y]), shaft.angle(t))
    found = response(lines(clean, RATE, PERIOD, HZ), 1, 0)
    clear = clear_of_orders(HZ, 2 * np.pi * 83.3, 3.0)
    assert HZ[~clear].tolist() == [84.0, 164.0, 168.0]
    assert np.abs(found.values - sensitivity(HZ))[clear].max() < 0.02
    raw = response(lines(np.array([injected(8), y]), RATE, PERIOD, HZ), 1, 0)
    assert np.abs(raw.values - sensitivity(HZ))[clear].max() > 0.2


def test_estimates_and_coherence_are_scipys_where_both_can() -> None:
    """Noise as injection, a box window without overlap: Welch's segments are our periods, at all of their lines."""
    rng = np.random.default_rng(0)
    x = rng.normal(size=64 * 40)
    y = signal.lfilter([1, 0.5], [1, -0.3], x) + rng.normal(0, 0.5, x.size)
    hz = np.arange(1, 32) / 64
    found = lines(np.array([x, y]), 1.0, 64, hz)
    options = {"fs": 1.0, "window": "boxcar", "nperseg": 64, "noverlap": 0, "detrend": False}
    _, xx = signal.welch(x, **options)
    _, yy = signal.welch(y, **options)
    _, xy = signal.csd(x, y, **options)
    assert np.allclose(response(found, 1, 0, "H1").values, (xy / xx)[1:32])
    assert np.allclose(response(found, 1, 0, "H2").values, (yy / np.conj(xy))[1:32])
    coherence = signal.coherence(x, y, **options)[1][1:32]
    h1 = response(found, 1, 0)
    assert np.allclose(h1.coherence, coherence)
    random_error = np.abs(h1.values) * np.sqrt((1 - coherence) / (2 * 40 * coherence))  # Bendat and Piersol
    assert np.median(h1.u_abs / random_error) == pytest.approx(1.0, abs=0.1)


def test_the_variance_holds_what_scatters() -> None:
    """200 records of 12 periods, noise on the response only."""
    hz, seen, told = HZ[:40], [], []
    x, y = injected(12), closed(12)
    for seed in range(200):
        noise = np.random.default_rng([1, seed]).normal(0, 3.0, y.size)
        found = response(lines(np.array([x, y + noise]), RATE, PERIOD, hz), 1, 0, "ratio")
        seen.append(found.values)
        told.append(np.trace(found.covariance, axis1=1, axis2=2))
    assert np.mean(np.var(seen, axis=0)) == pytest.approx(np.mean(told), rel=0.08)


@pytest.mark.parametrize(("power", "too_much"), [(0.0, 1.0), (1.0, 2.1)])
def test_bins_beside_a_single_line_tell_its_noise_also_where_it_grows_with_the_frequency(
    power: float, too_much: float
) -> None:
    """300 records of four periods, a line of one cycle in each, under white noise and under noise whose amplitudes grow as the
    frequency: their scatter then says twice too much. By hand: two bins to either side of four periods."""
    count, period, seen, told, scatter = 1000, 250, [], [], []
    t = np.arange(count) / period
    x = np.cos(2 * np.pi * t)
    shape = np.arange(4 * count + 1.0) ** power / (4 * count) ** power
    for seed in range(300):
        drawn = np.fft.rfft(np.random.default_rng([3, seed]).normal(size=8 * count))
        noise = np.fft.irfft(shape * drawn)[:count]  # a record is a piece of what goes on
        data = np.array([x, 0.5 * np.sin(2 * np.pi * t) + noise])
        found = single_response(data, float(period), period, 1.0, 1, 0)
        whole = response(lines(data, float(period), period, [1.0]), 1, 0)
        assert (found.values, found.dof) == (whole.values, 4.0)
        seen.append(found.values[0])
        told.append(np.trace(found.covariance[0]))
        scatter.append(np.trace(whole.covariance[0]))
    off = np.std(seen)
    assert abs(np.mean(seen) + 0.5j) < 3.3 * off / np.sqrt(300)
    assert np.sqrt(np.mean(told)) / off == pytest.approx(1.0, abs=0.1)
    assert np.sqrt(np.mean(scatter)) / off == pytest.approx(too_much, abs=0.15)


def test_intervals_of_the_peak_hold_it_and_the_raw_maximum_does_not() -> None:
    """100 loops of 5 % noise per line, the true maximum between the lines; 0.95 of 100 is 0.878 or more."""
    fine = np.arange(8, 600, 0.02)
    truth = np.abs(sensitivity(fine)).max()
    clean, hits, away, raw = sensitivity(HZ), [], [], []
    for seed in range(100):
        rng = np.random.default_rng([2, seed])
        e = rng.normal(0, 0.05 * np.sqrt(10), (20, HZ.size, 2))
        shares = (e - e.mean(axis=0)) / np.sqrt(20 * 19)
        z = clean + e.mean(axis=0).view(np.complex128)[:, 0]
        found = peak(HZ, z, np.einsum("pmi,pmj->mij", shares, shares), seed=seed, draws=150)
        hits.append(found.low <= truth <= found.high)
        away.append(found.value - truth)
        raw.append(found.raw - truth)
    assert np.mean(hits) >= 0.878
    assert abs(np.mean(away)) < 0.3 * np.mean(raw) or abs(np.mean(away)) < 3.3 * np.std(away) / 10
    assert np.std(away) < 0.05


def test_the_peak_lies_between_lines_of_a_narrow_mode() -> None:
    """Two lines in the half-power width, the peak in the middle of two: the greatest line alone is a tenth low."""
    x = np.arange(-20, 21) + 0.5
    z = 0.3 + 1 / (1 + 1j * x)
    found = peak(x, z, np.tile(1e-8 * np.eye(2), (x.size, 1, 1)))
    assert found.raw < 0.92 * 1.3
    assert found.value == pytest.approx(1.3, abs=2e-3)
    assert abs(found.at) < 0.15


def test_margins_that_a_peak_guarantees() -> None:
    up, down, phase = guaranteed_margins(3.0)
    assert (up, down, phase) == pytest.approx((1.5, 0.75, 19.188), abs=1e-3)


def test_refusals() -> None:
    with pytest.raises(AnalysisError, match="bins"):
        lines(np.zeros((1, 5000)), RATE, PERIOD, [10.0, 11.0])
    with pytest.raises(AnalysisError, match="three or more"):
        response(lines(np.ones((2, PERIOD)), RATE, PERIOD, HZ), 1, 0)
    with pytest.raises(AnalysisError, match="no injection"):
        response(lines(np.zeros((2, 4 * PERIOD)), RATE, PERIOD, HZ), 1, 0)
    with pytest.raises(AnalysisError, match="angle is not known"):
        without_orders(np.ones(4), [0, 1, np.nan, 2])
    with pytest.raises(AnalysisError, match="9 or more"):
        peak([1.0, 2.0], [1.0, 2.0], np.zeros((2, 2, 2)))
