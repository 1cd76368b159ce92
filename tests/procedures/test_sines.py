"""Sensitivity where the controller makes one sine at a time: the lines, and the result against the loop's linear model."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from twin_loops import sensitivity

from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from procedures.sensitivity import sines
from procedures.sensitivity.estimates import Candidate
from procedures.sensitivity.margins import fall, phase
from procedures.sensitivity.plan import Plan
from procedures.sensitivity.procedure import check, procedure
from procedures.sensitivity.steps import HALF, REFINED

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SPINDLE, STAND = (str(EXAMPLES / name) for name in ("vertical-spindle/spindle.toml", "plain-stand/stand.toml"))
QUICK: dict[str, Any] = {"axes": ("y_vorn",), "settle_s": 1.0, "start_s": 0.3, "survey_start_s": 0.5}


@pytest.mark.parametrize("sampled", [8000.0, 10000.0, 20000.0])
def test_every_line_repeats_with_the_samples(sampled: float) -> None:
    """By hand: 101 Hz in what repeats after 1/8 s becomes 104 Hz, 13 periods of it."""
    for hz in np.geomspace(2.0, 2000.0, 61).tolist():
        line = sines.sine(hz, 0.02, sampled)
        assert line.hz == [line.first]
        for whole in (line.period_s * sampled, line.period_s * line.first):
            assert whole == pytest.approx(round(whole), abs=1e-9)
        assert line.first == pytest.approx(hz, abs=0.5 / line.period_s)
        assert line.peak == 0.02
    assert sines.sine(101.0, 0.02, 8000.0).first == 104.0


def test_a_peak_is_refined_by_lines_within_its_width_at_both_amplitudes() -> None:
    rig, plan = load_rig(STAND), Plan()
    passes = sines.refinements(rig, plan, Candidate(124.0, 74.0))
    full, half = ([c for kind, _, c in passes if kind == which] for which in (REFINED, HALF))
    assert [c.first for c in full] == [c.first for c in half]
    assert len([c for c in full if abs(c.first - 124) < 37]) >= 6
    assert {c.amplitude for c in full} == {2 * c.amplitude for c in half} == {0.015 * 1.5}
    assert all(c.first <= sines.highest(rig, plan) for c in full)


def test_a_plan_that_asks_too_much_is_refused_before_anything_starts() -> None:
    rig = load_rig(STAND)
    assert not [*check(rig, Plan()), *procedure.problems(rig, Plan())]
    for plan, said in (
        (Plan(sine_A=0.4), "sine_A: found 0.4 A"),
        (Plan(axes=("yi",)), "axes: found yi; the controller injects into"),
        (Plan(speeds_rad_s=(0.0, 500.0)), "nothing turns the shaft"),
    ):
        assert any(said in line for line in check(rig, plan))
    assert any("no injection" in line for line in procedure.lacking(load_rig(SPINDLE)))


@pytest.mark.long
@pytest.mark.timeout(300)
def test_the_loop_of_another_laboratory_is_recovered_within_its_intervals(tmp_path: Path) -> None:
    """Against the linear model of the same twin; three standard uncertainties and a thousandth, which is the model's own."""
    run = simulated_run("sensitivity", STAND, 1, QUICK, tmp_path / "s.mcap")
    assert [f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE] == []
    told = {m.quantity.name: m.estimate for m in run.results if isinstance(m, Measured)}
    hz = np.geomspace(2.0, 1800.0, 3000)
    true = sensitivity(run.recording.rig, run.drawn.plant, "y_vorn", hz)
    open_loop, top = 1 / true - 1, int(np.abs(true).argmax())
    for name, value in (("s_max", float(abs(true[top]))), ("s_max_hz", float(hz[top])), ("phase_margin", phase(open_loop)),
                        ("gain_reduction", fall(open_loop))):  # fmt: skip
        assert abs(told[name].value - value) < 3 * told[name].u + 1e-3 * value, name
    zone = next(f for f in run.results if isinstance(f, Finding) and f.code == "zone")
    assert "greatest value up to" in zone.text
    assert math.isfinite(told["s_max"].u)
