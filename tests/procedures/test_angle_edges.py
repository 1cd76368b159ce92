"""The angle between the counts of an encoder, and peaks in noise: captured steps against the motion that made them."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from procedures.angle_step.edges import edges
from procedures.angle_step.paths import peak_in_noise

Array = npt.NDArray[np.float64]
COUNT = 2 * math.pi / 4096
T = np.arange(4000) * 1e-4


def swing(size: float, hz: float, damping: float, start: float = 0.0) -> Array:
    """A step of second order that begins after 10 ms, rad."""
    w = 2 * math.pi * hz
    wd, t = w * math.sqrt(1 - damping**2), np.maximum(T - 0.01, 0.0)
    return start + size * (1 - np.exp(-damping * w * t) * (np.cos(wd * t) + damping * w / wd * np.sin(wd * t)))


def told(angle: Array) -> Array:
    """What the encoder makes of it, in single precision."""
    return (np.floor(angle / COUNT + 0.5) * COUNT).astype(np.float32).astype(np.float64)


@settings(max_examples=40, deadline=None)
@given(
    size=st.floats(0.08, 0.3), hz=st.floats(9, 16), damping=st.floats(0.2, 0.55), start=st.floats(-0.002, 0.002),
    way=st.sampled_from([1.0, -1.0]),
)  # fmt: skip
def test_a_swing_is_read_between_counts(size: float, hz: float, damping: float, start: float, way: float) -> None:
    """Crossings within half a tick's worth, the overshoot within a tenth of a count; telemetry knows them to a count."""
    y = swing(size, hz, damping, start)
    found = edges(T, told(way * y), COUNT).since(0.0, way)
    for share in (0.1, 0.9):
        k = int(np.argmax(y > share * size))
        exact = T[k - 1] + (share * size - y[k - 1]) / (y[k] - y[k - 1]) * 1e-4
        assert found.crossing(share * size) == pytest.approx(exact, abs=1.5e-4)
    assert max(top for _, top in found.turning()) == pytest.approx(y.max(), abs=0.1 * COUNT)
    outside = np.flatnonzero(np.abs(y - size) > 0.05 * size)
    nearly = [np.flatnonzero(np.abs(y - size) > b)[-1] for b in (0.05 * size - 0.2 * COUNT, 0.05 * size + 0.2 * COUNT)]
    last = found.last_outside(size, 0.05 * size)
    assert T[nearly[1]] - 3e-4 <= last <= T[nearly[0]] + 3e-4, T[outside[-1]]


def test_counts_that_are_passed_at_once_are_edges_each() -> None:
    found = edges(np.arange(3) * 1e-4, np.array([0.0, 3 * COUNT, 3 * COUNT]), COUNT)
    assert found.y == pytest.approx(np.array([0.5, 1.5, 2.5]) * COUNT)
    assert found.t == pytest.approx(np.array([1, 3, 5]) / 6 * 1e-4)


def test_a_level_that_is_not_reached() -> None:
    found = edges(T, told(swing(0.1, 12, 0.3)), COUNT)
    assert math.isnan(found.crossing(1.0))
    assert edges(T, np.zeros(4000), COUNT).turning() == []


@pytest.mark.parametrize("height", [2e-6, 2e-5])
def test_a_peak_is_freed_of_what_noise_adds(height: float) -> None:
    """A plateau that ends within 20 ms, as a mass can, or a bump of 4 ms on half its height, 0.16 um of noise in each of 4000
    readings."""
    shape = height * (0.5 + 0.5 * np.exp(-(((T - 0.1) / 0.004) ** 2)))
    flat = height * 0.5 * (1 - np.tanh((T - 0.3) / 0.02)) if height < 1e-5 else shape
    off, kept = [], []
    for seed in range(12):
        noise = np.random.default_rng(seed).normal(0, 1.6e-7, (2, 4000))
        peak, towards, raised, _ = peak_in_noise(np.array([0 * T, flat]) + noise, 1.6e-7)
        off.append(peak - raised.by - height)
        kept.append(peak - height)
        assert towards == pytest.approx((0.0, 1.0), abs=0.15)
    assert abs(np.mean(off)) < 0.35 * np.mean(kept) + 0.005 * height
    assert np.mean(kept) > 2e-8 or height > 1e-5
