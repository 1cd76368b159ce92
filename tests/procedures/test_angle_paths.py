"""How far the mean path of some steps goes, and how well that is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import signal

from procedures.angle_step.paths import levered, peak_in_noise, peak_of, slow, smoothed

TICK = 1e-4


@pytest.mark.parametrize(("seconds", "height"), [(0.004, 8e-6), (0.02, 2e-6), (0.03, 1e-6)])
def test_what_noise_adds_to_a_peak_is_taken_off(seconds: float, height: float) -> None:
    """Half a sine by itself, sharp and far above the noise, or round and nearer to it: known before noise is drawn, and found
    in the mean within a tenth of the noise and what the parabola leaves of a sharp one, 1 %."""
    noise, ticks = 0.16e-6, 4000
    t = (np.arange(ticks) - ticks / 2) * 1e-4
    arc = np.where(np.abs(t) < seconds / 2, height * np.cos(np.pi * t / seconds), 0.0)
    clean, random = np.array([0.6 * arc, 0.8 * arc]), np.random.default_rng(3)
    found = [peak_in_noise(clean + random.normal(0.0, noise, clean.shape), noise, TICK) for _ in range(40)]
    off = float(np.mean([radius - raised.by for radius, _, raised in found])) - height
    assert abs(off) < 0.1 * noise + (0.01 * height if seconds < 0.01 else 0.0)
    assert all(raised.off < noise for _, _, raised in found)


def test_a_mean_path_has_little_of_what_a_loop_does_with_noise() -> None:
    """A shaft that follows 50 nm of slow noise, which its sensors do not show: one step's own peak is higher by it, that of the
    mean of ten, each longer than the next, by less than half as much."""
    t, random = np.arange(4000) * 1e-4, np.random.default_rng(5)
    arc = 1e-6 * np.exp(-(((t - 0.1) / 0.03) ** 2))
    slow = [signal.lfilter(*signal.butter(2, 150, fs=1e4), random.normal(0.0, 0.3e-6, (2, 4000))) for _ in range(10)]
    paths = [np.array([0 * arc, arc])[:, : 4000 - k] + s[:, : 4000 - k] for k, s in enumerate(slow)]
    alone = float(np.mean([peak_in_noise(p, 1e-9, TICK)[0] for p in paths])) - 1e-6
    together = peak_of(paths, 1e-9, TICK)
    assert alone > 60e-9
    assert 0 < together.radius - 1e-6 < alone / 2
    assert together.without.mean() == pytest.approx(together.radius, rel=0.02)
    assert 20e-9 < math.sqrt(10 * together.variance) < 100e-9


@pytest.mark.parametrize(("lasts_s", "most"), [(0.002, 1.4), (0.15, 3.6)])
def test_what_steps_say_of_the_peak_of_their_mean_is_what_it_varies_by(lasts_s: float, most: float) -> None:
    """Five steps of a peak that is sharp, or is held for 0.3 s, in slow noise of 50 nm, again and again. The variance that five
    tell is that of what they tell where it is sharp. Where it is held, what they differ by at one moment is five times too
    much, and the jackknife still three times."""
    t, random = np.arange(3000) * 1e-4, np.random.default_rng(11)
    arc = 1e-6 * np.exp(-(((t - 0.15) / lasts_s) ** 8))
    low = signal.butter(2, 150, fs=1e4)
    found, there = [], []
    for _ in range(150):
        slow = signal.lfilter(*low, random.normal(0.0, 0.25e-6, (5, 2, 3000)), axis=-1)
        found.append(peak_of(list(np.array([0 * arc, arc]) + slow), 1e-9, TICK))
        there.append(float(smoothed(slow, 21)[:, 1, 1500].var(ddof=1)) / 5)
    told, true = float(np.mean([p.variance for p in found])), float(np.var([p.radius for p in found]))
    assert 0.8 < told / true < most
    assert (float(np.mean(there)) > 4 * true) is (lasts_s > 0.1)


@pytest.mark.parametrize(("tick", "most"), [(1e-4, 0.0), (2e-4, 0.005), (4e-4, 0.02)])
def test_a_peak_is_as_high_at_another_rate(tick: float, most: float) -> None:
    """Half a sine of 8 ms; by 21 ticks whatever they last, 4 kHz had read it 4 % low, and 2.5 kHz 10 %."""
    t = (np.arange(round(0.2 / tick)) - round(0.1 / tick)) * tick
    arc = np.where(np.abs(t) < 0.004, 9e-6 * np.cos(np.pi * t / 0.008), 0.0)
    height = peak_of([np.array([0.6 * arc, 0.8 * arc])] * 4, 1e-9, tick).radius
    assert height == pytest.approx(9e-6, rel=0.002 + most)
    assert slow(5e-4)
    assert not slow(tick)


def test_the_share_of_the_sensors_moves_a_peak_by_what_their_planes_are_apart() -> None:
    t = np.arange(2000) * TICK
    inboard, outboard = (a * np.exp(-(((t - 0.1) / 0.03) ** 2)) for a in (2e-6, 9e-6))

    def path(share: float) -> list[np.ndarray]:
        x = inboard * (1 - share) + outboard * share
        return [np.array([0.6 * x, 0.8 * x])] * 3

    grows = levered(path(1.3), path(1.0), 1.3, TICK)
    by = (peak_of(path(1.31), 1e-9, TICK).radius - peak_of(path(1.29), 1e-9, TICK).radius) / 0.02
    assert grows == pytest.approx(7e-6, rel=0.01)
    assert by == pytest.approx(grows, rel=0.01)
