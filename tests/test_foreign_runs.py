"""Procedures on the twins of another laboratory's rigs, by their own messages: a run, a refusal, what each lacks by name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from bench import catalogue
from bench.cli.loading import load_procedure
from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.recording import Recording
from bench.rigfile import load_rig
from procedures.step import checks
from procedures.step.plan import Plan
from procedures.step.steps import read_steps

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
SPINDLE, STAND = str(EXAMPLES / "vertical-spindle/spindle.toml"), str(EXAMPLES / "plain-stand/stand.toml")


RUNNING = {
    SPINDLE: {"step", "unbalance", "run-up", "coast-down", "balance", "spindown"},
    STAND: {"step", "bearing-model", "sensitivity"},
}


def told(run: Simulated) -> dict[tuple[str, str], float]:
    return {(m.quantity.name, m.where): m.estimate.value for m in run.results if isinstance(m, Measured)}


def wrong(run: Simulated) -> list[str]:
    return [f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE]


def test_a_standing_shaft_with_axes_at_30_degrees_is_stepped(tmp_path: Path) -> None:
    """Set points by bearing axis in one message, telemetry at 2 kHz, no capture, no choice of law. Both planes are stepped
    together, so that what swings is near the slowest mode that the linear model of the same twin has."""
    run = simulated_run("step", SPINDLE, 1, {"axes": ["y"]}, tmp_path / "spindle.mcap")
    assert wrong(run) == []
    found = told(run)
    assert found["natural_frequency", "A, y, 0 r/min"] == pytest.approx(run.truth["frequency"], rel=0.03)
    assert found["damping", "A, y, 0 r/min"] == pytest.approx(run.truth["damping"], rel=0.05)
    recording = Recording.open(tmp_path / "spindle.mcap", Plan)
    written = [e["t_ns"] for e in recording.events("parameter") if e["name"] in ("TargetLowerU", "TargetUpperU")]
    assert written
    assert written[::2] == written[1::2]
    _two_writes_apart_are_told(recording)


def _two_writes_apart_are_told(recording: Recording[Plan]) -> None:
    """The step rises in 2.6 ms: 0.2 ms between the set points of its bearings are told, 0.1 ms are not."""
    steps = read_steps(recording)
    for apart, codes in ((0.0, set()), (1e-4, set()), (2e-4, {"set-points-apart"})):
        so = [replace(d, apart=apart) if k == 1 else d for k, d in enumerate(steps)]
        found = list(checks.of_steps(so, recording.plan))
        assert {f.code for f in found} == codes
        for f in found:
            assert f.effect is Effect.INDETERMINATE
            assert f"@{steps[1].case.where}" in f.concerns
            assert "0.2 ms apart" in f.text
            assert "one message" in f.text


def test_telemetry_that_is_too_slow_for_a_step_is_told_and_nothing_measured(tmp_path: Path) -> None:
    """Two samples of 2 ms in a rise: an overshoot by them would be a guess."""
    run = simulated_run("step", STAND, 1, {"axes": ["y"]}, tmp_path / "stand.mcap")
    assert wrong(run) == ["telemetry-too-slow"]
    assert told(run) == {}


@pytest.mark.parametrize("path", [SPINDLE, STAND], ids=["spindle", "stand"])
def test_what_a_procedure_lacks_is_told_by_tables_and_names(path: str) -> None:
    rig = load_rig(path)
    lacking = {entry.name: load_procedure(entry.name).lacking(rig) for entry in catalogue.PROCEDURES}
    assert {name for name, lines in lacking.items() if not lines} == RUNNING[path]
    if path == STAND:
        assert all("nothing turns it" in lacking[name][0] for name in ("unbalance", "run-up", "coast-down", "balance"))
    lines = [line for said in lacking.values() for line in said]
    assert all(line.partition(": ")[2] for line in lines)
    assert any("no injection" in line for line in lacking["sensitivity"]) == (path == SPINDLE)
