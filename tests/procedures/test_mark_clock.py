"""The time of the mark's edge and the telemetry's ticks are of one clock, or no phase is worth anything."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench.rigfile import load_rig
from bench.rigfile.roles import AGE, PULSES
from procedures.synchronous.mark import of_clock, tachometer_of

SPINDLE = str(Path(__file__).resolve().parents[2] / "examples/vertical-spindle/spindle.toml")
TICK_S, APART_S = 5e-5, 5e-4


@pytest.mark.parametrize(("drift", "told"), [(0.0, []), (1e-6, []), (5e-6, ["mark-clock"])])
def test_edges_that_age_between_two_dwells_are_told(drift: float, told: list[str]) -> None:
    """Half a minute later 5 parts in a million are three ticks, 1 is less than one: so much is left to how both are read."""
    dwells = []
    for begin in (0.0, 30.0):
        t = begin + np.arange(4000) * APART_S
        turns = np.floor(t * 41.3)
        samples = {PULSES: turns % 65536, AGE: t - turns / 41.3 + drift * t}
        dwells.append(tachometer_of(load_rig(SPINDLE), t, samples))
    assert [f.code for f in of_clock(dwells, TICK_S)] == told
