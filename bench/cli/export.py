"""`bench export`: the recorded channels of a run, and what it found, as files for other tools."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal, cast

from bench import rundir
from bench.cli.made_by import procedure_of
from bench.cli.reporting import figures
from bench.errors import BenchError, ConfigError, RecordingError
from bench.figures import Shown
from bench.record.records import read_record
from bench.recording import Recording
from bench.run.export import Format, Tabular, export, whole_file
from bench.run.result_tables import products

Log = Literal["blf", "asc", "candump"]


def export_command(run: Path, to: Format | Log, procedure: str = "") -> int:
    """Write a run's streams and events, its results and its figures' data into `RUN/export` and say where; or its raw frames,
    as a log of CAN.

    Raises:
        ConfigError: it is no run directory.
        RecordingError: the recording cannot be read, or holds no frames where they are asked for.
        BenchError: a file cannot be written.
    """
    directory = rundir.existing(run)
    folder = _logs(directory, to) if to in ("blf", "asc", "candump") else export(run, cast(Format, to))[0].parent
    if Recording.open(directory.recording).truncated:
        sys.stderr.write("bench: the recording is truncated: the files hold what was written before it was cut off\n")
    if to in ("parquet", "csv"):
        _found(directory, folder, to, procedure)
    sys.stdout.write(f"{folder}\n")
    return 0


def _logs(directory: rundir.RunDirectory, to: Log) -> Path:
    """The raw frames of every link as a file of their own."""
    from drivers.canlog import SUFFIXES, write_log

    recording: Recording[Any] = Recording.open(directory.recording)
    if not recording.links:
        raise RecordingError(
            f"{recording.path}: holds no frames; expected those of a link. It was recorded without a bus"
        )
    folder = directory.path / "export"
    try:
        folder.mkdir(exist_ok=True)
        for link in recording.links:  # the frames are read as the file is written, one batch at a time
            frames = recording.frames(link)
            whole_file(folder / f"{link.replace('/', '-')}{SUFFIXES[to]}", lambda part: write_log(part, to, frames))  # noqa: B023
    except OSError as error:
        raise BenchError(f"{folder}: cannot be written: {error.strerror or error}; the run is untouched") from error
    return folder


def _found(directory: rundir.RunDirectory, folder: Path, to: Tabular, given: str) -> None:
    """Results and figures; a run that was killed has no record, and its streams alone."""
    if not directory.record.exists():
        return
    record = read_record(directory.record)
    shown: Iterable[Shown] = ()
    try:
        procedure = procedure_of(directory, record.procedure, given, "export")
        shown = figures(record, procedure, Recording.open(directory.recording, procedure.plan))
    except ConfigError as error:
        if given:
            raise
        sys.stderr.write(f"bench: figures are left out: {error}\n")
    try:
        for _ in products(folder, to, record.measurements, shown):
            pass
    except OSError as error:
        raise BenchError(f"{folder}: cannot be written: {error.strerror or error}; the run is untouched") from error
