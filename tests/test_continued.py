"""A calibration that was stopped goes on: its recording holds what both runs did, and needs the first one no more."""

from __future__ import annotations

import json
import re
import shutil
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from stopped_runs import CALIBRATION, Stopping, ran, stopped_after, went_on

from bench.cli.compose import Request, prepare
from bench.cli.loading import load_procedure
from bench.cli.virtual import flown
from bench.errors import ConfigError, RecordingError
from bench.findings import Effect, Finding
from bench.progress import Silent
from bench.record.outcomes import Outcome
from bench.record.records import SCHEMA_FILE, from_json, read_record
from bench.recording import Recording
from bench.recording.earlier import AGAIN, left_in
from bench.recording.recorder import Recorder
from bench.run import reanalysis, runner, stopped
from bench.run.runner import RunResult
from bench.run.supervisor import Supervisor
from bench.rundir import RunDirectory
from procedures.shared import continued

PLAN = {"angles": 1, "settle_s": 0.3, "average_s": 0.2}
DRIFT = (continued.DRIFTED,)
DONE = 5
"""Hangings of nine, the heaviest mass just hung."""


def opened(result: RunResult) -> Recording[Any]:
    return Recording.open(result.directory / "recording.mcap", load_procedure("amb-calibration").plan)


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    return stopped_after(DONE, tmp_path_factory.mktemp("first"))


@pytest.fixture(scope="module")
def second(first: RunResult, tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    return went_on(first.directory, tmp_path_factory.mktemp("second"))


def test_it_goes_on_at_the_first_step_that_was_not_completed(first: RunResult, second: RunResult) -> None:
    assert (first.outcome, len(opened(first).all_steps())) == (Outcome.ABORTED, DONE)
    steps = [(s.kind, s.labels["load"], s.labels["branch"]) for s in opened(second).all_steps()]
    loads = ["", "M1", "M2", "M3", "M4", "M4", "M3", "M2", "M1", ""]
    assert [load for _, load, _ in steps] == loads
    assert [kind for kind, *_ in steps] == ["hang"] * DONE + [f"hang{AGAIN}"] + ["hang"] * 4
    assert steps[DONE][1:] == steps[DONE - 1][1:]
    assert second.outcome is Outcome.PASS


def test_the_same_run_goes_on_in_the_same_way(first: RunResult, second: RunResult, tmp_path: Path) -> None:
    again = went_on(first.directory, tmp_path)
    assert list(opened(again).everything()) == list(opened(second).everything())


def test_what_a_person_said_later_of_a_step_is_taken_over(first: RunResult, tmp_path: Path) -> None:
    """The fifth hanging, of M4, was of M3 in truth; that is told when the sixth is asked for, and then stop."""

    class Correcting(Stopping):
        def step(self, text: str) -> None:
            if self._left == 0:
                recorders[0].correct(load="M3")
            super().step(text)

    recorders: list[Recorder] = []
    made = Recorder.__init__

    def noted(self: Recorder, *arguments: Any, **named: Any) -> None:
        recorders.append(self)
        made(self, *arguments, **named)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Recorder, "__init__", noted)
        path = ran(CALIBRATION, tmp_path / "a", Correcting(DONE)).directory
    steps = opened(went_on(path, tmp_path / "b")).steps("hang")
    assert [s.labels["load"] for s in steps][:DONE] == ["", "M1", "M2", "M3", "M3"]


def test_what_was_reached_by_unloading_is_reached_so_again(tmp_path: Path) -> None:
    """The exercise of every run first; then from the heaviest mass down to the one that is done again, and on."""
    path = stopped_after(6, tmp_path / "a").directory
    events = opened(went_on(path, tmp_path / "b")).events()
    seam = next(k for k, e in enumerate(events) if e["kind"] == "continued")
    hung = [e["load"] for e in events[seam:] if e["kind"] == "operator" and e["action"] == "hang"]
    assert hung == ["M4", "", "M4", "M3", "M2", "M1", ""]


def test_what_was_recorded_is_taken_over_byte_by_byte(first: RunResult, second: RunResult) -> None:
    """Every message of the first recording to the end of its last step, and nothing of how it was stopped."""
    end = opened(first).all_steps().items[-1].end_ns
    before, after = list(opened(first).everything()), list(opened(second).everything())
    wanted = [m for m in before if m[1] <= end]
    assert [m for m in after if m[1] <= end] == wanted
    assert len(wanted) > 500
    assert [e["stopped"] for e in opened(first).events("run-end")] == ["ABORTED"]
    assert [e["stopped"] for e in opened(second).events("run-end")] == [None]


def test_the_counts_are_those_of_both(second: RunResult) -> None:
    recording = opened(second)
    found: Counter[str] = Counter()
    for stream in recording.streams:
        found[stream] = sum(block.count for block in recording.blocks(stream))
    assert recording.integrity is not None
    assert recording.integrity["samples"] == found
    assert recording.integrity["frames"]["controller"] == sum(map(len, recording.frames("controller")))
    assert recording.integrity["events"] == len(recording.events())
    assert recording.integrity["steps"] == len(recording.all_steps())
    assert len({e["step"] for e in recording.events("step-begin")}) == len(recording.all_steps())


def test_the_record_names_both_recordings(first: RunResult, second: RunResult) -> None:
    (before,) = second.record.continues
    assert (before.run_id, before.steps, before.stopped) == (first.directory.name, DONE, "operator-stop")
    assert before.sha256 == opened(first).digest()
    assert second.record.recording is not None
    assert second.record.recording.sha256 == opened(second).digest()
    assert [f.code for f in second.record.findings if f.code.startswith("continued")] == ["continued"]
    stored = json.loads((second.directory / "record.json").read_text())
    jsonschema.validate(stored, json.loads(SCHEMA_FILE.read_text()))
    assert read_record(second.directory / "record.json") == second.record
    older = {k: v for k, v in stored.items() if k != "continues"} | {"schema": 2}
    assert from_json(json.dumps(older)).continues == ()


def test_it_is_whole_without_the_first_one(second: RunResult, tmp_path: Path) -> None:
    """Analysed from its own recording alone, somewhere else, it says the same."""
    copy = shutil.copytree(second.directory, tmp_path / second.directory.name)
    again = reanalysis.analyse(copy, load_procedure).record
    assert again.continues == second.record.continues
    assert again.measurements == second.record.measurements


def test_a_machine_that_is_switched_on_again_draws_anew(first: RunResult, second: RunResult) -> None:
    """Seats and noise of the second stretch are others than those of the first, the machine is the same."""
    truths = [json.loads((r.directory / "truth.json").read_text()) for r in (first, second)]
    assert truths[0]["values"] == truths[1]["values"]
    assert [t.get("stretch", 0) for t in truths] == [0, 1]
    whole, again = (s for s in opened(second).all_steps() if s.labels["load"] == "M4")
    assert whole.mean("i_yo_p") != again.mean("i_yo_p")
    assert whole.mean("i_yo_p") == pytest.approx(again.mean("i_yo_p"), rel=1e-3)


def test_a_continued_run_can_be_continued(first: RunResult, tmp_path: Path) -> None:
    """Stopped before anything was done again, and after two steps more; both seams stand in the last recording that need be."""
    nothing = went_on(first.directory, tmp_path / "a", progress=Stopping(0))
    further = went_on(nothing.directory, tmp_path / "b", progress=Stopping(3))
    last = went_on(further.directory, tmp_path / "c")
    assert [(c.run_id, c.steps) for c in last.record.continues] == [
        (nothing.directory.name, DONE),
        (further.directory.name, DONE + 3),
    ]
    kinds = [s.kind for s in opened(last).all_steps()]
    assert kinds == ["hang"] * 5 + [f"hang{AGAIN}"] + ["hang"] * 2 + [f"hang{AGAIN}"] + ["hang"] * 2
    assert last.outcome is Outcome.PASS


def test_steps_that_are_worth_something_together_alone(first: RunResult) -> None:
    """Of five hangings that count by twos four are done, of which everything is taken over and nothing later; of six none."""
    recording = opened(first)
    steps, left = recording.all_steps().items, left_in(recording, "hang", 2)
    assert left.steps == steps[:4]
    assert left.end_ns == steps[3].end_ns
    assert left.begun == 4
    assert [e["kind"] for e in opened(first).events()][left.kept - 1] == "step-end"
    assert max(t_ns for _, t_ns, _ in left.messages()) < steps[4].start_ns + 1_000_000_000
    procedure = replace(load_procedure("amb-calibration"), whole=lambda _rig, _plan: 6)
    with pytest.raises(ConfigError, match="found no 6 steps 'hang' in a row that were completed"):
        stopped.left_of(RunDirectory(first.directory), opened(first), procedure)


@pytest.mark.parametrize(("heavier_kg", "told"), [(0.0, False), (0.03, True)])
def test_another_hanger_is_a_drift_between_the_halves(
    tmp_path: Path, heavier_kg: float, told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """0.294 N more hang in the second stretch alone, of which the masses know nothing: by the levers of the rig file the
    bearings feel -d/s and 1 + d/s of it."""
    procedure, run, plan = load_procedure("amb-calibration"), RunDirectory(tmp_path), {**PLAN, "rounds": 2}
    half = flown("amb-calibration", "tsbs12", 1, plan, run.recording, progress=Stopping(14))
    earlier = stopped.left_of(run, stopped.opened(run), procedure)
    hanger = {"hanger": half.drawn.values["hanger"] + heavier_kg}
    done = flown("amb-calibration", "tsbs12", 1, plan, tmp_path / "whole.mcap", hanger, earlier=earlier).analysed()
    drifts = {f.where: f for f in done.results if isinstance(f, Finding) and f.code in DRIFT}
    assert set(drifts) == ({"inboard", "outboard"} if told else set())
    for where, share in (("inboard", -0.15 / 0.125), ("outboard", 1 + 0.15 / 0.125)) if told else ():
        assert drifts[where].effect is Effect.NOTE  # of so few hangings U is wider than what K moves by
        newtons = float(re.search(r"for ([+-][\d.]+) N", drifts[where].text)[1])  # type: ignore[index]
        assert newtons == pytest.approx(-share * heavier_kg * 9.81, abs=0.06)  # what the fit does not find applied
    monkeypatch.setattr(continued, "MATTERS", 0.05)
    recording: Recording[Any] = Recording.open(tmp_path / "whole.mcap", procedure.plan)
    again = {f.where: f.effect for f in procedure.analyse(recording) if isinstance(f, Finding) and f.code in DRIFT}
    assert set(again.values()) == ({Effect.INDETERMINATE} if told else set())


def test_a_sound_rig_whose_shaft_comes_back_from_the_other_side_is_silent(tmp_path: Path) -> None:
    """Stopped at the seventh of eight angles and pointed there from home: it rests 3 mrad beside where it stood, by which the
    hanging that is done again asks for 0.06 N more, five standard deviations."""
    run, plan = RunDirectory(tmp_path), {**PLAN, "angles": 8}
    flown("amb-calibration", "tsbs12", 2, plan, run.recording, progress=Stopping(60))
    earlier = stopped.left_of(run, stopped.opened(run), load_procedure("amb-calibration"))
    done = flown("amb-calibration", "tsbs12", 2, plan, tmp_path / "whole.mcap", earlier=earlier).analysed()
    told = [f.code for f in done.results if isinstance(f, Finding)]
    assert "continued" in told
    assert continued.DRIFTED not in told
    first, again = done.recording.steps("hang").items[59], done.recording.steps(f"hang{AGAIN}").items[0]
    assert abs(again.mean("angle") - first.mean("angle")) > 2e-3


@given(st.data())
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_wherever_a_kill_cuts_the_file_its_whole_steps_are_what_was_completed(
    first: RunResult, tmp_path: Path, data: st.DataObject
) -> None:
    whole = (first.directory / "recording.mcap").read_bytes()
    cut = data.draw(st.integers(len(whole) // 8, len(whole) - 1), label="bytes")
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole[:cut])
    try:
        recording: Recording[Any] = Recording.open(path)
        steps = left_in(recording).steps
    except RecordingError:
        return  # so little is left that nothing says what it is
    known = opened(first).all_steps().items
    assert [(s.kind, s.start_ns, s.end_ns) for s in steps] == [
        (s.kind, s.start_ns, s.end_ns) for s in known[: len(steps)]
    ]
    for mine, theirs in zip(steps, known, strict=False):
        assert len(mine.read("i_yo_p")["t_ns"]) >= len(theirs.read("i_yo_p")["t_ns"]) - 1


def test_another_firmware_is_refused(first: RunResult) -> None:
    earlier = left_in(opened(first))
    said = {"protocol": 1.0, "map_version": 2.0, "serial": 0.0}
    stopped.require_same_controller(earlier, said)
    with pytest.raises(ConfigError, match=r"map_version: found 3\.0; the stopped run has 2\.0"):
        stopped.require_same_controller(earlier, {**said, "map_version": 3.0})


def test_a_controller_that_changed_is_found_before_anything_exists(first: RunResult, tmp_path: Path) -> None:
    from contextlib import contextmanager

    job, connect = prepare(Request("", "", backend="", continues=first.directory))

    @contextmanager
    def other(supervisor: Supervisor) -> Any:
        with connect(supervisor) as live:
            yield replace(live, identity={**live.identity, "serial": 7.0})

    with Supervisor().watching() as supervisor, pytest.raises(ConfigError, match="serial"):
        runner.run(job, tmp_path / "runs", other, supervisor, Silent(), None)
    assert not (tmp_path / "runs").exists()


def test_a_clock_that_went_back_is_refused(first: RunResult) -> None:
    earlier = left_in(opened(first))
    stopped.require_later(earlier, earlier.last_ns + 1)
    with pytest.raises(ConfigError, match="set the clock"):
        stopped.require_later(earlier, earlier.last_ns)


def test_findings_of_the_first_run_stay_with_its_steps(first: RunResult) -> None:
    """What it had noticed on its way is carried over; why and how it was stopped is not."""
    run = RunDirectory(first.directory)
    told = stopped.left_of(run, opened(first), load_procedure("amb-calibration")).told
    assert told["stopped"] == "operator-stop"
    assert "operator-stop" not in [f["code"] for f in told["findings"]]


def test_differences_name_each_key() -> None:
    then, now = {"a": {"b": 1, "c": 2}, "d": "x"}, {"a": {"b": 1, "c": 3}, "e": [1]}
    assert list(stopped.differences(then, now)) == [
        "a.c: found 3; the stopped run has 2",
        "d: found none; the stopped run has 'x'",
        "e: found [1]; the stopped run has none",
    ]
