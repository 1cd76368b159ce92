"""A shaft that hardly swings: what dies away fast is no oscillation, and still is in the way of what slow integrators leave."""

from __future__ import annotations

from pathlib import Path

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.uncertainty import interval
from benchmarks.drawn_rigs import EXAMPLES, drawn


def test_a_shaft_that_hardly_swings(tmp_path: Path) -> None:
    """A spindle with magnets three times as strong: poles at -656 + 273i and -872 + 295i 1/s, an integrator of 57 ms. By
    constants of 10, 30 and 100 ms alone its settling times were .5 ms long, ten U; overshoot and bandwidth were not told."""
    path, dbc = tmp_path / "drawn.toml", next(EXAMPLES["spindle"].parent.glob("*.dbc"))
    path.write_text(drawn("spindle", 23), encoding="utf-8")
    (tmp_path / dbc.name).write_bytes(dbc.read_bytes())
    run = simulated_run("step", str(path), 1, {"axes": ["y"]}, tmp_path / "run.mcap")
    true = truth_of_motion(run)
    told = [m for m in run.results if isinstance(m, Measured) and f"{m.quantity.name}@{m.where}" in true]
    off = [(m.estimate.value - true[f"{m.quantity.name}@{m.where}"]) / interval(m.estimate).U for m in told]
    assert {m.quantity.name for m in told} == {"overshoot", "rise_time", "settling_time", "steady_error", "bandwidth"}
    assert len(off) == 20
    assert max(map(abs, off)) < 1.3
    assert [f for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE] == []
