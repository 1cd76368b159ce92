"""The runner on the real simulated rig: order, make-safe, outcomes, and what the files say afterwards."""

from __future__ import annotations

import contextlib
import dataclasses
import io
import json
import logging
import os
import re
import signal
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import pytest
import tiny_procedures
from jsonschema import Draft202012Validator
from mcap.records import Attachment, Chunk, Metadata
from mcap.stream_reader import StreamReader
from tiny_procedures import Plan

from bench.cli.compose import simulated
from bench.errors import BenchError
from bench.procedure import Procedure
from bench.progress import PlainProgress
from bench.record.limits import Limit, Verdict
from bench.record.outcomes import Outcome
from bench.record.records import SCHEMA_FILE, Record, read_record
from bench.record.setup import certified_of
from bench.recording import Recording
from bench.rigfile import RigFile, load_rig
from bench.run import reanalysis, runner
from bench.run.job import Job
from bench.run.runner import RunResult
from bench.run.supervisor import Supervisor

Run = Callable[..., RunResult]


@pytest.fixture(scope="module")
def rig() -> RigFile:
    return load_rig("tsbs12")


@pytest.fixture
def run(tmp_path: Path, rig: RigFile) -> Run:
    def start(
        plan: Plan | None = None,
        *,
        procedure: Procedure = tiny_procedures.resting,
        limits: Mapping[str, Limit] | None = None,
        truth: Mapping[str, float] | None = None,
        seed: int = 1,
        report: runner.Report | None = None,
        on: RigFile | None = None,
    ) -> RunResult:
        used = on or rig
        job = Job(procedure, used, plan or Plan(), limits or {}, "sim", seed)
        connect = simulated(used, seed, truth or {}, "auto")
        progress = PlainProgress(io.StringIO())
        with Supervisor().watching() as supervisor:
            return runner.run(job, tmp_path / "runs", connect, supervisor, progress, report)

    return start


def codes(result: RunResult) -> list[str]:
    return [f.code for f in result.record.findings]


def last_state(result: RunResult, rig: RigFile) -> str:
    """The controller's state in the last telemetry of the recording."""
    recording: Recording[Any] = Recording.open(result.directory / "recording.mcap")
    assert not recording.truncated
    *_, block = recording.blocks("telemetry")
    return rig.messages["Telemetry"].signal("state").choices[int(block.columns["state"][-1])]


def test_a_run_leaves_a_recording_a_record_a_truth_and_a_log(run: Run, rig: RigFile) -> None:
    result = run()
    assert result.outcome is Outcome.DONE
    files = {p.name for p in result.directory.iterdir()}
    assert files == {"recording.mcap", "record.json", "truth.json", "run.log"}
    stored = json.loads((result.directory / "record.json").read_text())
    Draft202012Validator(json.loads(SCHEMA_FILE.read_text())).validate(stored)
    (supply,) = stored["measurements"]
    assert (supply["name"], supply["verdict"]) == ("supply", "none")
    assert supply["value"] == pytest.approx(148, abs=2)
    assert stored["recording"]["sha256"] == Recording.open(result.directory / "recording.mcap").digest()
    assert stored["link"]["frames"] > 1000
    assert (stored["link"]["gaps"], stored["link"]["errors"]) == (0, 0)
    truth = json.loads((result.directory / "truth.json").read_text())
    assert truth["seed"] == 1
    assert {"K_i", "K_o"} <= set(truth["quantities"])
    assert last_state(result, rig) == "OFF"


def test_a_levitated_run_lands_and_switches_off(run: Run, rig: RigFile) -> None:
    result = run(procedure=tiny_procedures.levitated)
    assert result.outcome is Outcome.DONE
    recording: Recording[Any] = Recording.open(result.directory / "recording.mcap")
    commands = [e["name"] for e in recording.events("command")]
    assert commands == ["ENABLE", "LEVITATE", "LAND", "DISABLE"]
    assert last_state(result, rig) == "OFF"


def test_settings_are_written_before_levitation(run: Run) -> None:
    result = run(Plan(bias_A=2.5), procedure=tiny_procedures.levitated)
    recording: Recording[Any] = Recording.open(result.directory / "recording.mcap")
    order = [e["name"] for e in recording.events() if e["kind"] in ("command", "parameter")]
    assert order[:3] == ["ENABLE", "bias_i", "LEVITATE"]
    assert recording.events("parameter")[0]["value"] == 2.5


def test_the_record_says_what_the_run_was_set_up_with(run: Run, rig: RigFile) -> None:
    setup = run(Plan(bias_A=2.5), procedure=tiny_procedures.levitated).record.setup
    assert setup is not None
    assert (setup.rig_sha256, setup.firmware) == (rig.digest, "protocol 1, map version 2")
    assert (setup.parameters["bias_i"], setup.parameters["bias_z"]) == (
        2.5,
        2.0,
    )  # set by the plan; the rig file's default
    assert setup.aliases["K_i"] == "K@inboard"


def test_the_rig_files_numbers_are_kept_as_it_states_them(rig: RigFile) -> None:
    found = certified_of(rig, ("masses/hanger", "sensors/i_yi_p/gain", "scatter/1", "masses/beyond/1"))
    assert found.keys() == {"masses/hanger", "sensors/i_yi_p/gain"}  # what a run found stands in no file
    assert (found["masses/hanger"].value, found["masses/hanger"].standard_uncertainty) == (0.25, 25e-6)


def test_while_it_runs_the_record_says_unfinished(tmp_path: Path, run: Run) -> None:
    seen: list[Record] = []

    def look(rig: Any, plan: Any, record: Any) -> None:
        (path,) = (tmp_path / "runs").glob("*/record.json")
        seen.append(read_record(path))

    run(procedure=dataclasses.replace(tiny_procedures.resting, acquire=look))
    assert seen[0].outcome is Outcome.ERROR
    assert [f.code for f in seen[0].findings] == ["unfinished"]


@pytest.mark.parametrize(
    ("act", "outcome", "code"),
    [("raise", Outcome.ERROR, "exception"), ("refuse", Outcome.ABORTED, "interlock"),
     ("stop", Outcome.ABORTED, "operator-stop")],
)  # fmt: skip
def test_whatever_ends_acquire_the_machine_is_made_safe(
    run: Run, rig: RigFile, act: Any, outcome: Outcome, code: str
) -> None:
    result = run(Plan(act=act), procedure=tiny_procedures.levitated)
    assert result.outcome is outcome
    assert codes(result) == [code]
    assert [m.verdict for m in result.record.measurements] == [Verdict.MISSING]
    assert last_state(result, rig) == "OFF"


def test_the_traceback_of_a_mistake_is_in_the_log_and_not_in_the_record(run: Run) -> None:
    result = run(Plan(act="raise"))
    log = (result.directory / "run.log").read_text()
    assert "Traceback" in log
    assert "tiny_procedures.py" in log
    assert "Traceback" not in (result.directory / "record.json").read_text()
    assert "ZeroDivisionError: a mistake in the procedure" in result.reason


def test_nothing_is_sent_when_the_envelope_refuses(run: Run) -> None:
    result = run(Plan(act="refuse"))
    recording: Recording[Any] = Recording.open(result.directory / "recording.mcap")
    assert [e["value"] for e in recording.events("parameter")] == [3.0]


def test_an_interlock_on_telemetry_ends_in_make_safe(run: Run, rig: RigFile) -> None:
    text = rig.toml_text.replace("max_temperature_K = 353.0", "max_temperature_K = 250.0")
    assert text != rig.toml_text
    cold = RigFile.parse(text, rig.dbc_text)
    result = run(on=cold)
    assert result.outcome is Outcome.ABORTED
    assert codes(result) == ["interlock"]
    assert "temp_" in result.reason
    assert last_state(result, rig) == "OFF"


def test_a_supply_outside_its_range_while_the_rotor_is_held_ends_in_make_safe(run: Run, rig: RigFile) -> None:
    text = rig.toml_text.replace("min_supply_V = 130.0", "min_supply_V = 150.0")
    assert text != rig.toml_text
    result = run(on=RigFile.parse(text, rig.dbc_text), procedure=tiny_procedures.levitated)
    assert result.outcome is Outcome.ABORTED
    assert codes(result) == ["interlock"]
    assert "supply" in result.reason
    assert last_state(result, rig) == "OFF"


def test_a_fault_of_the_controller_is_an_abort(run: Run) -> None:
    result = run(truth={"fault_after_s": 0.6})
    assert result.outcome is Outcome.ABORTED
    assert codes(result)[0] == "controller-fault"


def test_a_dead_link_is_an_error_and_every_step_of_make_safe_is_tried(run: Run) -> None:
    result = run(procedure=tiny_procedures.levitated, truth={"dead_after_s": 3.0}, plan=Plan(seconds=2.0))
    assert result.outcome is Outcome.ERROR
    assert codes(result)[0] == "link-lost"
    tried = [line for line in (result.directory / "run.log").read_text().splitlines() if "make safe: " in line]
    begun = [line.split("make safe: ")[1] for line in tried if "failed" not in line and "waiting" not in line]
    assert begun == [
        "take the torque away",
        "wait for the rotor to be slow",
        "land the rotor",
        "switch the amplifiers off",
        "the controller's own make-safe",
        "the controller's watchdog",
    ]
    failed = [f.text for f in result.record.findings if f.code == "make-safe-failed"]
    assert failed[-1].startswith("make-safe failed (the controller's watchdog): the machine cannot be seen")
    assert not [text for text in failed if "LAND" in text]
    assert not Recording.open(result.directory / "recording.mcap").truncated


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_in_the_middle_of_a_sleep(run: Run, rig: RigFile, number: signal.Signals) -> None:
    times: list[int] = []

    def interrupted(live: Any, plan: Any, record: Any) -> None:
        live.clock.sleep(0.2)
        times.append(live.clock.now_ns())
        os.kill(os.getpid(), number)
        live.clock.sleep(1e6)

    result = run(procedure=dataclasses.replace(tiny_procedures.levitated, acquire=interrupted))
    assert result.outcome is Outcome.ABORTED
    assert number.name in result.reason
    assert result.stopped_by_signal
    assert last_state(result, rig) == "OFF"
    recording: Recording[Any] = Recording.open(result.directory / "recording.mcap")
    stopped = recording.events("log")[0]
    landing = next(e for e in recording.events("command") if e["name"] == "LAND")
    assert stopped["t_ns"] - times[0] <= 100_000_000
    assert landing["t_ns"] - stopped["t_ns"] <= 50_000_000


class Interrupting(PlainProgress):
    """Sends a signal when a stage begins."""

    def __init__(self, at: str) -> None:
        super().__init__(io.StringIO())
        self._at = at

    def stage(self, text: str) -> None:
        if text == self._at:
            os.kill(os.getpid(), signal.SIGTERM)


@pytest.mark.parametrize("stage", ["bring the rig to LEVITATED", "acquire", "make safe", "analyse", "report"])
def test_a_signal_in_any_part_of_a_run_lands_and_ends_aborted(tmp_path: Path, rig: RigFile, stage: str) -> None:
    job = Job(tiny_procedures.levitated, rig, Plan(), {}, "sim", 1)
    connect = simulated(rig, 1, {}, "auto")
    with Supervisor().watching() as supervisor:
        result = runner.run(job, tmp_path, connect, supervisor, Interrupting(stage), lambda *_: None)
    assert result.outcome is Outcome.ABORTED
    assert codes(result) == ["signal"]
    assert last_state(result, rig) == "OFF"
    assert json.loads((result.directory / "record.json").read_text())["outcome"] == "ABORTED"


@pytest.mark.parametrize(
    ("then", "outcome", "code"),
    [
        ("nothing", Outcome.ERROR, None),
        ("doubt", Outcome.INDETERMINATE, "doubt"),
        ("raise", Outcome.ERROR, "analysis-failed"),
    ],
)
def test_what_analyse_yields_decides(run: Run, then: Any, outcome: Outcome, code: str | None) -> None:
    result = run(Plan(then=then))
    assert result.outcome is outcome
    assert codes(result) == ([code] if code else [])
    verdict = result.record.measurements[0].verdict
    assert verdict is (Verdict.NONE if then == "doubt" else Verdict.MISSING)


def test_a_limit_at_a_place_that_was_not_measured_is_a_missing_quantity(run: Run) -> None:
    result = run(limits={"supply@hall": Limit(140, 160, "V", "test", True)})
    assert result.outcome is Outcome.ERROR
    assert [(m.where, m.verdict) for m in result.record.measurements] == [
        ("", Verdict.NONE),
        ("hall", Verdict.MISSING),
    ]


@pytest.mark.parametrize(
    ("low", "high", "outcome"),
    [(140, 160, Outcome.PASS), (160, 180, Outcome.FAIL), (148, 160, Outcome.INDETERMINATE)],
)
def test_limits_decide(run: Run, low: float, high: float, outcome: Outcome) -> None:
    assert run(limits={"supply": Limit(low, high, "V", "test", True)}).outcome is outcome


@pytest.mark.parametrize(
    ("least", "outcome"), [(10**9, Outcome.INDETERMINATE), (3, Outcome.INDETERMINATE), (2, Outcome.PASS)]
)
def test_a_recording_that_lacks_steps_of_its_plan_is_no_pass(run: Run, least: int, outcome: Outcome) -> None:
    limits = {"supply": Limit(140, 160, "V", "test", True)}
    counted = dataclasses.replace(tiny_procedures.resting, step_count=lambda _: least)
    result = run(procedure=counted, limits=limits)
    assert (result.outcome, "steps-missing" in codes(result)) == (outcome, outcome is not Outcome.PASS)
    ends_early = dataclasses.replace(counted, fewest_steps=lambda _: 2)
    assert run(procedure=ends_early, limits=limits).outcome is Outcome.PASS
    doubtful = run(Plan(then="doubt"), procedure=counted)
    assert codes(doubtful) == ["doubt"]  # whose reason is said already


def test_an_undeclared_quantity_is_an_error(run: Run) -> None:
    odd = dataclasses.replace(tiny_procedures.resting, measures=())
    result = run(procedure=odd)
    assert result.outcome is Outcome.ERROR
    assert "does not declare" in result.reason


def test_a_failing_report_is_a_finding_and_keeps_the_verdict(run: Run) -> None:
    def broken(*_: Any) -> None:
        raise BenchError("no ink")

    result = run(report=broken)
    assert result.outcome is Outcome.DONE
    assert codes(result) == ["report-failed"]
    assert "no ink" in (result.directory / "record.json").read_text()


def test_a_signal_while_the_report_is_built_makes_the_run_aborted(run: Run) -> None:
    def slow(*_: Any) -> None:
        os.kill(os.getpid(), signal.SIGINT)

    result = run(report=slow)
    assert result.outcome is Outcome.ABORTED
    assert json.loads((result.directory / "record.json").read_text())["outcome"] == "ABORTED"


def test_lost_frames_are_counted_and_noted(run: Run) -> None:
    result = run(truth={"drop_fraction": 0.02})
    assert result.record.link.gaps > 0
    assert codes(result) == ["samples-lost", "step-incomplete", "step-incomplete"]
    assert re.fullmatch(
        r"step 2 \(look number 1\): \d+ of 500 samples of telemetry are missing", result.record.findings[2].text
    )


def content(path: Path) -> list[Any]:
    """Everything in an MCAP file except the record of the wall clock and the summary that points at it."""
    kept: list[Any] = []
    with path.open("rb") as file:
        for record in StreamReader(file, emit_chunks=True).records:
            if isinstance(record, Chunk):
                kept.append(record.data)
            elif isinstance(record, Attachment):
                kept.append((record.name, record.data))
            elif isinstance(record, Metadata) and record.name != "wall":
                kept.append((record.name, record.metadata))
    return kept


def test_equal_seed_and_plan_give_equal_files_and_another_seed_does_not(run: Run) -> None:
    first, second, other = run(seed=3), run(seed=3), run(seed=4)
    same = [content(r.directory / "recording.mcap") for r in (first, second, other)]
    assert same[0] == same[1]
    assert same[0] != same[2]
    assert first.record.measurements == second.record.measurements
    assert (first.directory / "truth.json").read_text() == (second.directory / "truth.json").read_text()


def load(_: str) -> Procedure:
    return tiny_procedures.resting


@pytest.mark.parametrize("plan", [Plan(), Plan(act="raise"), Plan(then="doubt")])
def test_a_stored_run_analysed_again_gives_the_same_record(run: Run, plan: Plan) -> None:
    result = run(plan, limits={"supply": Limit(140, 160, "V", "test", True)})
    before = {p: p.read_bytes() for p in result.directory.iterdir()}
    again = reanalysis.analyse(result.directory, load)
    assert again.record == result.record
    assert again.directory.parent == result.directory.resolve() / "analyses"
    assert {p: p.read_bytes() for p in before} == before


def test_a_cut_recording_is_analysed_as_truncated(run: Run) -> None:
    result = run()
    path = result.directory / "recording.mcap"
    path.write_bytes(path.read_bytes()[:-2000])
    again = reanalysis.analyse(result.directory, load)
    assert again.outcome is Outcome.ERROR
    assert codes(again) == ["recording-truncated"]
    assert again.record.started == result.record.started


def test_a_display_that_nobody_reads_does_not_stop_a_run(tmp_path: Path, rig: RigFile) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    job = Job(tiny_procedures.resting, rig, Plan(), {}, "sim", 1)
    stream = os.fdopen(writer, "w")
    with Supervisor().watching() as supervisor:
        connect = simulated(rig, 1, {}, "auto")
        result = runner.run(job, tmp_path, connect, supervisor, PlainProgress(stream), None)
    with contextlib.suppress(BrokenPipeError):
        stream.close()
    assert result.outcome is Outcome.DONE


def test_warnings_are_events(run: Run) -> None:
    def warn(*_: Any) -> None:
        logging.getLogger("procedures").warning("the air is damp")

    result = run(procedure=dataclasses.replace(tiny_procedures.resting, acquire=warn))
    recording: Recording[Any] = Recording.open(result.directory / "recording.mcap")
    assert [e["text"] for e in recording.events("log")] == ["the air is damp"]


def test_progress_shows_stages_and_steps(tmp_path: Path, rig: RigFile) -> None:
    stream = io.StringIO()
    job = Job(tiny_procedures.resting, rig, Plan(), {}, "sim", 1)
    with Supervisor().watching() as supervisor:
        runner.run(job, tmp_path, simulated(rig, 1, {}, "auto"), supervisor, PlainProgress(stream), None)
    shown = stream.getvalue()
    assert "step 1/2: look number 0" in shown
    stages: Iterable[str] = ("bring the rig to READY", "acquire", "make safe", "analyse")
    positions = [shown.index(f"{stage}\n") for stage in stages]
    assert positions == sorted(positions)
