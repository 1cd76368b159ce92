"""What steps show, from readings of ticks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_backend.machines.stepping import Shown


@pytest.mark.parametrize("share", [0.2, 0.21, 0.22, 0.23])
@pytest.mark.parametrize("tick_s", [5e-5, 1.25e-4])
def test_a_response_settles_between_ticks(share: float, tick_s: float) -> None:
    """Whole ticks are up to 63 us off on a controller of 8 kHz, half as much as the interval that they are held against."""
    constant, window = 0.06, 6e-3
    t = np.arange(round(0.5 / tick_s)) * tick_s
    shown = Shown(t, 1 + share * np.exp(-t / constant), 0.0, tick_s)
    gain = constant / window * (math.exp(window / constant) - 1)
    assert shown.settling_time(0.02, window) == pytest.approx(constant * math.log(share * gain / 0.02), abs=1e-6)


def test_what_never_leaves_the_band_has_settled_at_once_and_what_does_not_come_back_when_the_record_ends() -> None:
    t = np.arange(2000) * 1e-4
    assert Shown(t, np.full(2000, 1.01), 0.0, 1e-4).settling_time(0.02, 6e-3) == 0.0
    assert Shown(t, np.full(2000, 1.03), 0.0, 1e-4).settling_time(0.02, 6e-3) == pytest.approx(0.2)
