"""Settling times of a shaft that hardly swings: what dies away fast is no oscillation, and still is in the way of what slow
integrators leave."""

from __future__ import annotations

from pathlib import Path

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import simulated_run
from bench.procedure import Measured
from bench.uncertainty import interval
from benchmarks.drawn_rigs import EXAMPLES, drawn


def test_settling_times_where_nothing_swings(tmp_path: Path) -> None:
    """A spindle with magnets three times as strong: poles at -656 + 273i and -872 + 295i 1/s, an integrator of 57 ms. By
    constants of 10, 30 and 100 ms alone its settling times were .5 ms long, ten U."""
    path, dbc = tmp_path / "drawn.toml", next(EXAMPLES["spindle"].parent.glob("*.dbc"))
    path.write_text(drawn("spindle", 23), encoding="utf-8")
    (tmp_path / dbc.name).write_bytes(dbc.read_bytes())
    run = simulated_run("step", str(path), 1, {"axes": ["y"], "settle_s": 1}, tmp_path / "run.mcap")
    true = truth_of_motion(run)
    told = [m for m in run.results if isinstance(m, Measured) and m.quantity.name == "settling_time"]
    off = [(m.estimate.value - true[f"settling_time@{m.where}"]) / interval(m.estimate).U for m in told]
    assert len(off) == 4
    assert max(map(abs, off)) < 1.2
