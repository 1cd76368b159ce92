"""Loads on the simulated rotary-linear motor: the whole path, what is planted."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.figures import Figure
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.uncertainty import interval
from procedures.load_response.procedure import procedure
from reports.figures import draw as draw_figure

WAYS = {"x": "along", "angle": "around"}


def run(folder: Path, truth: Mapping[str, float] | None = None, seed: int = 1, **plan: Any) -> Simulated:
    return simulated_run("load-response", "rlsrm", seed, plan, folder / "recording.mcap", truth or {})


def told_by(done: Simulated) -> dict[str, Measured]:
    return {f"{r.quantity.name}@{r.where}": r for r in done.results if isinstance(r, Measured)}


def strong(done: Simulated) -> set[str]:
    return {r.code for r in done.results if isinstance(r, Finding) and r.effect is not Effect.NOTE}


@pytest.mark.parametrize("name", ["x", "angle"])
def test_the_whole_path(tmp_path: Path, name: str) -> None:
    """Every quantity within twice its U of what the drawn machine truly does; friction a little below the bearing's own."""
    done = run(tmp_path, axes=WAYS[name])
    values, truth = told_by(done), truth_of_motion(done)
    assert strong(done) == set()
    assert set(values) == set(truth)
    assert len(values) == 12
    for key, one in values.items():
        at = interval(one.estimate)
        assert abs(one.estimate.value - truth[key]) < (at.high - at.low), key
    held = "friction@x" if name == "x" else "friction_torque@angle"
    bearing = done.truth["F_c" if name == "x" else "T_c"]
    assert 0.9 * bearing < truth[held] < 1.02 * bearing
    shown = list(procedure.drawn(done.recording))
    assert [s.key for s in shown] == [f"loads-{name}", f"after-{name}", "static"]
    assert all(draw_figure(figure) for figure in shown if isinstance(figure, Figure))


@pytest.mark.parametrize(
    ("truth", "name", "code"),
    [
        ({"hook_exchanged": 1}, "x", "load-on-wrong-side"),
        ({"lever_exchanged": 1}, "angle", "load-on-wrong-side"),
        ({"brake_x": 3}, "x", "load-stuck"),
        ({"mass_error_M3": 0.15}, "x", "load-masses-differ"),
        ({"hooks.far.pulley.friction": 0.15}, "x", "pulley-rubs"),
    ],
)
def test_planted(tmp_path: Path, truth: dict[str, float], name: str, code: str) -> None:
    assert code in strong(run(tmp_path, truth, axes=WAYS[name], disturbed=False))
