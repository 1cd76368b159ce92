"""Runs that a mistake, an interlock, a fault, a dead link or a signal ends: the machine is made safe, the record says why."""

from __future__ import annotations

import dataclasses
import io
import json
import os
import signal
from pathlib import Path
from typing import Any

import pytest
import tiny_procedures
from test_runner import Run, codes, last_state, runs_in
from tiny_procedures import Plan

from bench.cli.compose import simulated
from bench.progress import PlainProgress
from bench.record.limits import Verdict
from bench.record.outcomes import Outcome
from bench.recording import Recording
from bench.rigfile import RigFile, load_rig
from bench.run import runner
from bench.run.job import Job
from bench.run.supervisor import Supervisor


@pytest.fixture(scope="module")
def rig() -> RigFile:
    return load_rig("tsbs12")


@pytest.fixture
def run(tmp_path: Path, rig: RigFile) -> Run:
    return runs_in(tmp_path / "runs", rig)


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


def test_a_signal_while_the_report_is_built_makes_the_run_aborted(run: Run) -> None:
    def slow(*_: Any) -> None:
        os.kill(os.getpid(), signal.SIGINT)

    result = run(report=slow)
    assert result.outcome is Outcome.ABORTED
    assert json.loads((result.directory / "record.json").read_text())["outcome"] == "ABORTED"
