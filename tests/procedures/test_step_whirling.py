"""Steps while the shaft turns, on rigs that tell only the edges of their mark; gyroscopic moments that couple y and z."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.uncertainty import interval

SPINDLE = "examples/vertical-spindle/spindle.toml"
OVERHUNG = str(Path(__file__).resolve().parents[1] / "strangers/ventil.toml")


def stepped(rig: str, speed: float, tmp_path: Path) -> Simulated:
    plan = {"axes": ["y"], "settle_s": 1, "speeds_rad_s": [speed]}
    return simulated_run("step", rig, 2, plan, tmp_path / "run.mcap")


def off(run: Simulated) -> dict[str, float]:
    """Off the truth, in U."""
    true = truth_of_motion(run)
    told = {f"{m.quantity.name}@{m.where}": m.estimate for m in run.results if isinstance(m, Measured)}
    return {k: (e.value - true[k]) / interval(e).U for k, e in told.items() if k in true}


def codes(run: Simulated, effect: Effect) -> set[str]:
    return {f.code for f in run.results if isinstance(f, Finding) and f.effect is effect}


def test_a_turning_spindle_that_tells_its_edges_alone(tmp_path: Path) -> None:
    run = stepped(SPINDLE, 600.0, tmp_path)
    seen = off(run)
    assert len(seen) == 22
    assert max(map(abs, seen.values())) < 2.0
    assert codes(run, Effect.NOTE) == {"coordinates"}
    assert [f for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE] == []


@pytest.mark.parametrize(("speed", "told"), [(0.0, set()), (600.0, {"gyroscopic"})])
def test_an_overhung_shaft_swings_across_its_step(speed: float, told: set[str], tmp_path: Path) -> None:
    """At 600 rad/s z moves by .07 of a step along y; by two oscillations a bandwidth was 4 U off and an overshoot 2.8."""
    run = stepped(OVERHUNG, speed, tmp_path)
    seen = off(run)
    assert codes(run, Effect.INDETERMINATE) == told
    lacking = (
        {q.name for q in run.procedure.measures} - {k.partition("@")[0] for k in seen} - {"size_effect", "way_effect"}
    )
    assert lacking <= {q.name for q in run.procedure.optional}  # or the run would be an ERROR
    assert {k.partition("@")[0] for k in seen} == (
        {"rise_time", "steady_error"} if told else {"rise_time", "steady_error", "settling_time", "overshoot", "bandwidth",
                                                    "damping", "natural_frequency"}
    )  # fmt: skip
    assert max(map(abs, seen.values())) < 2.0
