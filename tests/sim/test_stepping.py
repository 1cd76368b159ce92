"""What a step shows of a machine, where it shows nothing of a kind."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_backend.machines.stepping import Shown

TICK = 1e-4


def bandwidth(hz: float) -> float:
    """Of a first-order answer with this corner."""
    t = TICK * np.arange(6000)
    return Shown(t, 1 - np.exp(-2 * math.pi * hz * t), 0.0, TICK).bandwidth


def test_a_bandwidth_within_what_is_looked_at_is_the_corner() -> None:
    assert bandwidth(100.0) == pytest.approx(100.0, rel=0.05)


def test_a_bandwidth_above_all_that_is_looked_at_is_told_as_none() -> None:
    """Between 20 and 500 Hz the gain does not fall below 0.707."""
    assert bandwidth(2000.0) == math.inf
