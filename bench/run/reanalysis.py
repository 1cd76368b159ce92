"""`bench analyse`: a stored run analysed again from its recording. The original stays as it is."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from bench import rundir
from bench.errors import BenchError, ConfigError, RecordingError
from bench.procedure import Procedure
from bench.record.limits import Limit
from bench.record.records import Record, read_record, unfinished, write_record
from bench.record.setup import Setup, setup_of
from bench.record.sources import RecordingFile
from bench.recording import Recording
from bench.run.evaluation import Ending, evaluate
from bench.run.provenance import versions
from bench.run.runner import RunResult
from bench.rundir import RunDirectory

Procedures = Callable[[str], Procedure]


def analyse(path: Path, load_procedure: Procedures) -> RunResult:
    """Analyse the recording in a run directory and write `analyses/<UTC>/record.json`.

    Only the recording is an input; from the run's own record come, if it can be read, the times of a run whose
    recording was cut off before it could note them.

    Raises:
        ConfigError: no run directory, or a procedure that this version does not have.
        RecordingError: no recording, a foreign, newer or damaged one.
    """
    run = rundir.existing(path)
    if not run.recording.is_file():
        raise RecordingError(f"{run.path}: holds no recording.mcap; expected one. The run ended before it could record")
    recording: Recording[Any] = Recording.open(run.recording)
    procedure = load_procedure(recording.procedure)
    record = reanalysed(run, procedure, Recording.open(run.recording, procedure.plan), _original(run))
    folder = rundir.create_analysis(run, datetime.now(UTC))
    write_record(folder / "record.json", record)
    return RunResult(folder, record)


def reanalysed(run: RunDirectory, procedure: Procedure, recording: Recording[Any], original: Record | None) -> Record:
    """The record that the recording of a run gives today, judged by the limits in it. From the `original` come the times
    that a recording which was cut off does not have.

    Raises:
        RecordingError: the recording's end, limits or rig file cannot be read.
    """
    ending = Ending.read(recording)
    evaluation = evaluate(procedure, recording, stored_limits(recording), stopped=ending.stopped is not None)
    wall = recording.wall
    record = unfinished(
        run_id=wall.get("run_id") or run.run_id, procedure=procedure.name, rig=recording.rig.name,
        uut=recording.rig.uut.model_dump(), started=wall.get("started") or (original.started if original else ""),
        seed=recording.seed, visit=recording.visit or 0, plan=recording.plan_dict, versions=versions(procedure, recording.rig),
        calibrations=recording.calibrations, setup=_setup(procedure, recording),
    )  # fmt: skip
    ended = wall.get("ended") or (original.ended if original else None) or record.started
    file = RecordingFile(run.recording.name, recording.digest())
    return evaluation.finish(record, ending, ended, file)


def _setup(procedure: Procedure, recording: Recording[Any]) -> Setup | None:
    """None where this version's procedure cannot tell what it would set on that rig: its analysis then says why."""
    try:
        return setup_of(recording.rig, procedure.settings(recording.rig, recording.plan))
    except (BenchError, LookupError):
        return None


def stored_limits(recording: Recording[Any]) -> dict[str, Limit]:
    """The acceptance limits that the run was made with.

    Raises:
        RecordingError: they cannot be read.
    """
    try:
        stored = json.loads(recording.attachment("spec.json"))
        return {name: Limit(**limit) for name, limit in stored.items()}
    except (ValueError, TypeError, AttributeError, ConfigError) as error:
        raise RecordingError(f"{recording.path}: its limits (spec.json) cannot be read: {error}") from error


def _original(run: RunDirectory) -> Record | None:
    try:
        return read_record(run.record)
    except ConfigError:
        return None
