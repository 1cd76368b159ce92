"""The runner on the real simulated rig: order, settings, what the files say afterwards, and what a stored run gives again."""

from __future__ import annotations

import contextlib
import dataclasses
import io
import json
import logging
import os
import re
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
from bench.procedure import Procedure
from bench.progress import PlainProgress
from bench.record.limits import Limit
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


def runs_in(folder: Path, rig: RigFile) -> Run:
    """What starts runs of small procedures on the simulated rig."""

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
            return runner.run(job, folder, connect, supervisor, progress, report)

    return start


@pytest.fixture(scope="module")
def rig() -> RigFile:
    return load_rig("tsbs12")


@pytest.fixture
def run(tmp_path: Path, rig: RigFile) -> Run:
    return runs_in(tmp_path / "runs", rig)


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
