"""Where the shaft stands when a hanging is done again: the force's slope over the angle, and what a reading's counts allow."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from procedures.amb_calibration import stands
from procedures.amb_calibration.fit import Fit
from procedures.amb_calibration.inputs import HAND_RAD

COUNT = 2 * math.pi / 4096
SIZES = st.floats(-30, 30)


@given(st.integers(8, 12), st.lists(st.tuples(SIZES, SIZES), min_size=1, max_size=3), st.integers(0, 7), SIZES)
def test_the_slope_is_that_of_the_orders(
    angles: int, orders: list[tuple[float, float]], at: int, current: float
) -> None:
    """By hand: d/dθ of a cos nθ + b sin nθ in F_0, and in K times the current."""
    theta = 2 * math.pi * np.arange(angles) / angles
    of_angle = sum(a * np.cos(n * theta) + b * np.sin(n * theta) for n, (a, b) in enumerate(orders, 1))
    terms = np.stack([100 + of_angle, 75 + of_angle, 0 * theta, 0 * theta], axis=-1)[None]
    design = np.broadcast_to([1.0, current, 0.0, 1.0], (1, angles, 1, 4))
    f = Fit(terms, *(np.zeros(1),) * 4)
    expected = sum(
        n * (b * math.cos(n * theta[at]) - a * math.sin(n * theta[at])) for n, (a, b) in enumerate(orders, 1)
    )
    assert stands.slopes(f, design, at, 0)[0] == pytest.approx((1 + current) * expected, rel=1e-9, abs=1e-8)


class Stood:
    """A step with so many counts of an encoder, wrapped as readings are."""

    def __init__(self, *counts: int) -> None:
        self._angles = np.float32([math.remainder(n * COUNT, 2 * math.pi) for n in counts])

    def read(self, channel: str) -> dict[str, Any]:
        return {channel: self._angles}


def recorded(angles: int = 8, channel: str = "angle", by: str = "rotation") -> Any:
    rig = SimpleNamespace(
        mark=SimpleNamespace(angle=channel) if channel else None, shaft=None,
        devices={"controller": SimpleNamespace(roles=("levitation", by))},
        capabilities=SimpleNamespace(angle=object()),
    )  # fmt: skip
    return SimpleNamespace(plan=SimpleNamespace(angles=angles), rig=rig)


def test_readings_say_how_far_it_turned_within_a_count() -> None:
    first: Any = Stood(*[1023] * 20)
    again = stands.turned(recorded(), first, Stood(*[1026] * 10, *[1025] * 10))  # type: ignore[arg-type]
    assert again.rad == pytest.approx(2.5 * COUNT, rel=1e-3)
    assert (again.count, again.u) == (pytest.approx(COUNT, rel=1e-3), 0.0)


def test_readings_that_wrap() -> None:
    again = stands.turned(recorded(), Stood(2047, 2047), Stood(2049, 2049))  # type: ignore[arg-type]
    assert again.rad == pytest.approx(2 * COUNT, rel=1e-3)


def test_a_hand_turns_it_anew_each_time() -> None:
    for rig in (recorded(by="drive"), recorded(channel="")):
        again = stands.turned(rig, Stood(0), Stood(0))  # type: ignore[arg-type]
        assert (again.rad, again.count, again.u) == (0.0, 0.0, pytest.approx(math.sqrt(2) * HAND_RAD))


def test_a_shaft_that_nobody_turns() -> None:
    assert stands.turned(recorded(angles=1), Stood(0), Stood(3)) == stands.Turned(0.0, 0.0, 0.0)  # type: ignore[arg-type]
