"""A telemetry whose samples are readings and no means (`binding.samples`): the twin sends them, procedures take them so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.uncertainty import interval
from procedures.shared.sampled import of_telemetry

SPINDLE = Path(__file__).resolve().parents[1] / "examples/vertical-spindle/spindle.toml"
BINDING = "[devices.controller.binding]\n"


def reading(folder: Path) -> str:
    """The vertical spindle, whose samples are readings."""
    text = SPINDLE.read_text(encoding="utf-8")
    assert BINDING in text
    (folder / "spindle.toml").write_text(text.replace(BINDING, f'{BINDING}samples = "reading"\n'), encoding="utf-8")
    (folder / "spindle.dbc").write_bytes(SPINDLE.with_suffix(".dbc").read_bytes())
    return str(folder / "spindle.toml")


def test_a_mean_is_half_a_period_late_and_a_reading_a_tick(tmp_path: Path) -> None:
    """Ten ticks of 50 us: a mean's middle is 50 + 225 us before its time."""
    mean, last = of_telemetry(load_rig(str(SPINDLE)), 5e-4), of_telemetry(load_rig(reading(tmp_path)), 5e-4)
    assert (mean.ticks, mean.late) == (10, pytest.approx(2.75e-4))
    assert (last.ticks, last.late) == (1, pytest.approx(5e-5))
    assert last.gain(2 * np.pi * 500.0) == pytest.approx(1.0)


@pytest.mark.long
def test_vectors_of_readings_are_those_of_the_shaft(tmp_path: Path) -> None:
    """Taken for means they lag by 225 us: 9 degrees at 7000 r/min, 6 U."""
    plan = {"slow_s": 6.0, "dwell_s": 1.5, "settle_s": 1.0}
    run = simulated_run("unbalance", reading(tmp_path), 1, plan, tmp_path / "run.mcap")
    assert [f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE] == []
    truth = truth_of_motion(run)
    told = {f"{m.quantity.name}@{m.where}": m.estimate for m in run.results if isinstance(m, Measured)}
    off = [(e.value - truth[key]) / interval(e).U for key, e in told.items() if key in truth]
    assert len(off) >= 20
    assert max(map(abs, off)) < 2
