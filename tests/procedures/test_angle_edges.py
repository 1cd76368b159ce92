"""The angle between the counts of an encoder, and peaks in noise: captured steps against the motion that made them."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from procedures.angle_step.course import Course, course
from procedures.angle_step.edges import edges
from procedures.angle_step.paths import peak_in_noise

Array = npt.NDArray[np.float64]
COUNT = 2 * math.pi / 4096
TICK = 1e-4
T = np.arange(4000) * TICK


def swing(size: float, hz: float, damping: float, start: float = 0.0) -> Array:
    """A step of second order that begins after 10 ms, rad."""
    w = 2 * math.pi * hz
    wd, t = w * math.sqrt(1 - damping**2), np.maximum(T - 0.01, 0.0)
    return start + size * (1 - np.exp(-damping * w * t) * (np.cos(wd * t) + damping * w / wd * np.sin(wd * t)))


def told(angle: Array) -> Array:
    """What the encoder makes of it, in single precision."""
    return (np.floor(angle / COUNT + 0.5) * COUNT).astype(np.float32).astype(np.float64)


def read(angle: Array, torque: Array, way: float = 1.0) -> Course:
    reading = told(way * angle)
    return course(edges(T, reading, COUNT).since(0.0, way), T, way * reading, torque, 100)


@settings(max_examples=40, deadline=None)
@given(
    size=st.floats(0.08, 0.3), hz=st.floats(9, 16), damping=st.floats(0.2, 0.55), start=st.floats(-0.002, 0.002),
    way=st.sampled_from([1.0, -1.0]),
)  # fmt: skip
def test_a_swing_is_read_between_counts(size: float, hz: float, damping: float, start: float, way: float) -> None:
    """By the torque that makes it: crossings within half a tick, the overshoot within a twentieth of a count, and settling as
    well as the count is known; telemetry knows them to a count."""
    y = swing(size, hz, damping, start)
    found = read(y, np.gradient(np.gradient(y, T), T) / 87, way)
    for share in (0.1, 0.9):
        k = int(np.argmax(y > share * size))
        exact = T[k - 1] + (share * size - y[k - 1]) / (y[k] - y[k - 1]) * 1e-4
        assert found.crossing(share * size) == pytest.approx(exact, abs=0.5e-4)
    assert found.top == pytest.approx(y.max(), abs=0.05 * COUNT)
    nearly = [np.flatnonzero(np.abs(y - size) > b)[-1] for b in (0.05 * size - 0.1 * COUNT, 0.05 * size + 0.1 * COUNT)]
    assert T[nearly[1]] - 2e-4 <= found.last_outside(size, 0.05 * size) <= T[nearly[0]] + 2e-4


def kicked(size: float) -> tuple[Array, Array]:
    """The angle and its torque current of a loop that has the derivative of counts: every edge kicks it."""
    angle, speed, keep, filtered, before = 0.0, 0.0, 1 / (1 + 2 * math.pi * 200 * 1e-4), 0.0, 0.0
    y, torque = np.zeros(len(T)), np.zeros(len(T))
    for k in range(len(T)):
        error = (size if k >= 100 else 0.0) - COUNT * math.floor(angle / COUNT + 0.5)
        filtered = keep * filtered + (1 - keep) * (error - before) / 1e-4
        y[k], before = angle, error
        torque[k] = 50 * error + 0.5 * filtered
        speed += (87 * torque[k] - 2 * speed) * 1e-4
        angle += speed * 1e-4
    return y, torque


@pytest.mark.parametrize("size", [0.0340, 0.0349, 0.0362, 0.087])
def test_kicks_at_the_edges_are_seen_in_the_torque(size: float) -> None:
    """A polynomial through the edges about a turning point was a tenth of a count off."""
    y, torque = kicked(size)
    found = read(y, torque)
    turns = [
        k for k in range(101, 2000) if (y[k] - y[k - 1]) * (y[k + 1] - y[k]) < 0 and abs(y[k] - size) > 1.3 * COUNT
    ]
    assert len(turns) >= 2
    for k in turns:
        assert found.y[k] == pytest.approx(y[k], abs=0.03 * COUNT)
    assert 80 < found.gain < 95


def test_no_angle_is_read_that_the_encoder_did_not_tell() -> None:
    """Where edges are far between, a spline may swing where the rotor stands (13 ms of settling in the mean of ten steps)."""
    y, torque = kicked(0.05)
    torque[2500:] += 0.3 * np.sin(np.arange(1500) / 40)  # a current that moved nothing
    off = np.abs(read(y, torque).y - told(y))
    assert off.max() <= 0.5001 * COUNT


def test_few_edges_have_lines_between_them() -> None:
    found = read(swing(4 * COUNT, 12, 0.7), np.zeros(len(T)))
    assert math.isnan(found.gain)
    assert found.y.max() == pytest.approx(4 * COUNT, abs=0.6 * COUNT)


def test_counts_that_are_passed_at_once_are_edges_each() -> None:
    found = edges(np.arange(3) * 1e-4, np.array([0.0, 3 * COUNT, 3 * COUNT]), COUNT)
    assert found.y == pytest.approx(np.array([0.5, 1.5, 2.5]) * COUNT)
    assert found.t == pytest.approx(np.array([1, 3, 5]) / 6 * 1e-4)


def test_a_level_that_is_not_reached() -> None:
    found = read(swing(0.1, 12, 0.3), np.zeros(len(T)))
    assert math.isnan(found.crossing(1.0))
    assert not read(np.zeros(len(T)), np.zeros(len(T))).y.any()


@pytest.mark.parametrize("height", [2e-6, 2e-5])
def test_a_peak_is_freed_of_what_noise_adds(height: float) -> None:
    """A plateau that ends within 20 ms, as a mass can, or a bump of 4 ms on half its height, 0.16 um of noise in each of 4000
    readings."""
    shape = height * (0.5 + 0.5 * np.exp(-(((T - 0.1) / 0.004) ** 2)))
    flat = height * 0.5 * (1 - np.tanh((T - 0.3) / 0.02)) if height < 1e-5 else shape
    off, kept = [], []
    for seed in range(12):
        noise = np.random.default_rng(seed).normal(0, 1.6e-7, (2, 4000))
        peak, towards, raised = peak_in_noise(np.array([0 * T, flat]) + noise, 1.6e-7, TICK)
        off.append(peak - raised.by - height)
        kept.append(peak - height)
        assert towards == pytest.approx((0.0, 1.0), abs=0.15)
    assert abs(np.mean(off)) < 0.35 * np.mean(kept) + 0.005 * height
    assert np.mean(kept) > 2e-8 or height > 1e-5
