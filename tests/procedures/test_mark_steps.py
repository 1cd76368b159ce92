"""Edges whose times are told in coarse steps are evened out: the mark hands the step on to the tachometer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.rigfile import load_rig
from bench.rigfile.roles import AGE, PULSES, resolution_s
from procedures.synchronous import mark

SPINDLE = Path(__file__).parents[2] / "examples" / "vertical-spindle" / "spindle.toml"


def test_the_step_of_the_edge_s_time_is_handed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    rig, handed = load_rig(SPINDLE), []
    assert not mark.by_angle(rig)
    true = mark.tachometer

    def tachometer(*pulses: Any) -> Any:
        handed.append(pulses[2:])
        return true(*pulses)

    monkeypatch.setattr(mark, "tachometer", tachometer)
    t = np.arange(0.0, 1.0, 1e-3)
    turns = np.floor(t / 0.0123)
    mark.tachometer_of(rig, t, {PULSES: turns, AGE: t - 0.0123 * turns})
    assert handed == [(resolution_s(rig),)]
    assert handed[0][0] > 0
