"""A shaft with probes beside those of its bearings' axes: of what is not evaluated of them, a note says so."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from procedures.synchronous.dwelling import left_out

STRANGERS = Path(__file__).resolve().parents[1] / "strangers"
CODE = "planes-left-out"


@pytest.mark.parametrize(
    ("rig", "names"),
    [("threeplanes", "m1, m2"), ("overhung", "midp, midq"), ("suspendu", "x_pied, y_pied"), ("gemischt", None)],
)
def test_probes_that_no_axis_has_are_named(rig: str, names: str | None) -> None:
    assert [f.where for f in left_out(load_rig(str(STRANGERS / f"{rig}.toml")))] == ([names] if names else [])


def test_a_rig_of_four_probes_leaves_none_out() -> None:
    assert list(left_out(load_rig("amb5dof"))) == []


@pytest.mark.parametrize("procedure", ["unbalance", pytest.param("run-up", marks=pytest.mark.long), "coast-down"])
def test_a_run_tells_what_it_leaves_out(procedure: str, tmp_path: Path) -> None:
    """Vectors were told of the bearings' planes alone, and nothing of the third; its readings are in the recording."""
    plan: dict[str, Any] = {"slow_s": 4.0} | ({"dwell_s": 1.0, "repeat": False} if procedure == "unbalance" else {})
    run = simulated_run(procedure, str(STRANGERS / "threeplanes.toml"), 1, plan, tmp_path / "run.mcap")
    (note,) = [f for f in run.results if isinstance(f, Finding) and f.code == CODE]
    assert note.effect is Effect.NOTE
    assert "of what m1, m2 read" in note.text
    of = {m.where.split(",")[0] for m in run.results if isinstance(m, Measured) and m.quantity.name == "vector_cos"}
    assert of == {"L1", "L2", "R1", "R2"}
    (slow,) = run.recording.steps("slow-roll")
    assert all(x.std() > 0 for name, x in slow.read("gap_m1", "gap_m2").items() if name.startswith("gap"))
