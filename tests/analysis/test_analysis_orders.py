"""Synchronous vectors: the convention of phase, exactness, averaged samples, run-ups, and the coverage of their regions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from turning import FULL, TELEMETRY, Array, Shaft, coloured

from bench.analysis.orders import SlowRoll, compensated, synchronous
from bench.analysis.sampling import Sampling
from bench.analysis.tachometer import tachometer
from bench.analysis.vectors import Vectors, contains, radius2
from bench.errors import AnalysisError


@given(st.floats(0, 359.9), st.floats(60, 1500), st.floats(0, 6.28))
@settings(max_examples=20, deadline=None)
def test_the_lag_is_the_turn_from_the_mark_to_the_high_spot(lag: float, speed: float, first: float) -> None:
    """The probe sees the high spot `lag` degrees of turn after the mark has passed the pickup."""
    shaft = Shaft(speed, 0.0, first)
    t = np.arange(20_000) * 1e-4
    since_mark = np.mod(shaft.angle(t), 2 * np.pi)
    x = 5e-6 * np.cos(since_mark - np.radians(lag)) + 2e-5
    found = synchronous(t, x, shaft.tacho(2.0), FULL).vectors(0)
    assert found.amplitude[0] == pytest.approx(5e-6, rel=1e-6)
    assert (found.lag_deg[0] - lag + 180) % 360 - 180 == pytest.approx(0, abs=1e-4)


def test_a_golden_vector_worked_out_by_hand() -> None:
    """A turn in 8 samples, from the mark on: 3 cos(theta) + 4 sin(theta) has its peak of 5 at 53.13 deg."""
    t = np.arange(8 * 6 + 1) / 8.0
    x = np.tile([3.0, 7 / np.sqrt(2), 4.0, 1 / np.sqrt(2), -3.0, -7 / np.sqrt(2), -4.0, -1 / np.sqrt(2)], 7)[: t.size]
    found = synchronous(t, x, tachometer(np.arange(7.0)), Sampling(1 / 8), orders=(1.0,)).vectors(0)
    assert found.values[0] == pytest.approx(3 - 4j, abs=1e-12)
    assert found.lag_deg[0] == pytest.approx(53.1301, abs=1e-4)


@given(st.integers(1, 10), st.floats(100, 1500))
@settings(max_examples=20, deadline=None)
def test_means_of_readings_are_put_right(ticks: int, speed: float) -> None:
    shaft = Shaft(speed)
    sampling = Sampling(1e-4, ticks, 1e-4)
    readings = np.arange(20_000 // ticks * ticks) * 1e-4
    x = 5e-6 * np.cos(shaft.angle(readings) - 1.0) + 1e-6 * np.cos(2 * shaft.angle(readings) - 0.4)
    t = readings.reshape(-1, ticks)[:, -1] + 1e-4
    found = synchronous(t, x.reshape(-1, ticks).mean(axis=1), shaft.tacho(2.0), sampling)
    expected = [5e-6 * np.exp(-1j), 1e-6 * np.exp(-0.4j)]
    assert np.allclose(found.values[0, 0], expected, rtol=2e-4, atol=0)


def test_several_channels_share_their_scatter() -> None:
    shaft, rng = Shaft(600.0), np.random.default_rng(2)
    t = np.arange(40_000) * 1e-4
    noise = rng.normal(0, 1e-6, t.size)
    x = np.array([np.cos(shaft.angle(t)) * 1e-5 + noise, np.sin(shaft.angle(t)) * 1e-5 + noise])
    joint = synchronous(t, x, shaft.tacho(4.0), FULL).vectors(0, (0, 1))
    correlation = joint.covariance[0, 2] / np.sqrt(joint.covariance[0, 0] * joint.covariance[2, 2])
    assert correlation > 0.999
    assert np.degrees(np.angle(joint.values)) == pytest.approx([0, -90], abs=0.1)


def test_a_run_up_is_followed_block_by_block() -> None:
    shaft = Shaft(300.0, 60.0)
    t = np.arange(100_000) * 1e-4
    speed = shaft.speed + shaft.rise * t
    response = 1e-5 * speed**2 / (600.0**2 - speed**2 + 2j * 0.1 * 600.0 * speed)
    x = np.real(response * np.exp(1j * shaft.angle(t)))
    x = x + np.random.default_rng(4).normal(0, 2e-7, t.size)
    track = synchronous(t, x, shaft.tacho(10.0), FULL, turns=8, orders=(1.0,))
    expected = 1e-5 * track.speed**2 / (600.0**2 - track.speed**2 + 2j * 0.1 * 600.0 * track.speed)
    values, covariance = track.curve()
    assert np.abs(values - expected).max() < 1.2e-7
    assert np.allclose(np.diff(track.speed), 8 * 2 * np.pi * 60 / track.speed[:-1], rtol=0.05)
    white = 2e-7**2 * 2 / (8 * 2 * np.pi / track.speed / 1e-4)
    assert np.median(covariance[:, 0, 0] / white) == pytest.approx(1.0, abs=0.25)  # the trend is not scatter


@pytest.mark.parametrize("keep", [0.0, 0.95, 0.999])
def test_regions_hold_the_truth_in_coloured_noise(keep: float) -> None:
    """95 % regions and amplitudes of 400 records; 0.95 +- 3.3 sqrt(0.95 0.05/400) is 0.914 to 0.986."""
    shaft = Shaft(700.0)
    t = np.arange(8_000) * 1e-4
    tacho, truth = shaft.tacho(0.8), 4e-6 * np.exp(-2j)
    clean = np.real(truth * np.exp(1j * shaft.angle(t)))
    hits = []
    wide, away = [], []
    for seed in range(20):
        rng = np.random.default_rng([7, seed])
        x = clean + np.array([coloured(rng, t.size, keep, 1e-6) for _ in range(20)])
        track = synchronous(t, x, tacho, FULL, orders=(1.0,))
        for c in range(20):
            vector = track.vectors(0, (c,))
            hits.append(contains(vector, truth))
            wide.append(2.145 * np.sqrt(vector.covariance[0, 0]))
            away.append(abs(vector.values[0].real - truth.real))
    assert 0.914 <= np.mean(hits) <= 0.986
    assert 0.8 <= np.mean(wide) / np.quantile(away, 0.95) <= 1.25


def test_another_vibration_in_the_record_widens_and_does_not_fool() -> None:
    """A rotor that also vibrates at 0.47 of its speed: the region must hold the synchronous vector all the same."""
    shaft, hits = Shaft(700.0), []
    t = np.arange(8_000) * 1e-4
    for seed in range(60):
        phase = np.random.default_rng([9, seed]).uniform(0, 6.28, 3)
        x = 1e-6 * np.cos(shaft.angle(t)) + 1e-5 * np.cos(0.4713 * shaft.angle(t) + phase[0])
        x += 1e-7 * np.random.default_rng(seed).standard_normal(t.size)
        hits.append(contains(synchronous(t, x, shaft.tacho(0.8), FULL, orders=(1.0,)).vectors(0), 1e-6 + 0j))
    assert np.mean(hits) > 0.93


def test_slow_roll_is_subtracted_channel_by_channel() -> None:
    a = Vectors(np.array([5 + 1j, 2j]), np.diag([4.0, 4, 1, 1]), 14)
    slow = SlowRoll(Vectors(np.array([1 + 1j, 1j]), np.diag([1.0, 1, 1, 1]), 14), 50.0, "2026-11-21T10:00:00Z")
    out = compensated(a, slow)
    assert np.array_equal(out.values, [4, 1j])
    assert np.array_equal(np.diag(out.covariance), [5, 5, 2, 2])
    assert out.dof == pytest.approx(14**1 * 14**2 / (10**2 + 4**2))
    with pytest.raises(AnalysisError, match="channel by channel"):
        compensated(a.one(0), slow)


def test_the_radius_is_hotellings() -> None:
    assert np.sqrt(radius2(np.inf)) == pytest.approx(2.4477, abs=1e-4)
    assert radius2(14) == pytest.approx(2 * 14 / 13 * 3.8056, rel=1e-4)  # F(2, 13) at 0.95, from tables


def test_refusals() -> None:
    shaft = Shaft(700.0)
    t = np.arange(100) * 1e-4
    with pytest.raises(AnalysisError, match="whole turns"):
        synchronous(t, np.zeros(100), shaft.tacho(1.0), FULL)
    t = np.arange(200) * 4e-3
    with pytest.raises(AnalysisError, match=r"2\.5 samples"):
        synchronous(t, np.zeros(200), shaft.tacho(1.0), FULL)
    t = np.arange(1000) * 1e-3
    bad: Array = np.zeros(1000)
    bad[3] = np.nan
    with pytest.raises(AnalysisError, match="not finite"):
        synchronous(t, bad, shaft.tacho(1.0), TELEMETRY)
