"""`bench export`: the recorded channels of a run, and what it found, as files for other tools."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from bench import rundir
from bench.cli.compose import load_procedure
from bench.cli.reporting import figures
from bench.errors import BenchError
from bench.export import Format, Tabular, export
from bench.products import products
from bench.recording import Recording
from bench.records import read_record


def export_command(run: Path, to: Format) -> int:
    """Write a run's streams and events, its results and its figures' data into `RUN/export` and say where.

    Raises:
        ConfigError: it is no run directory.
        RecordingError: the recording cannot be read.
        BenchError: a file cannot be written.
    """
    directory = rundir.existing(run)
    folder = export(run, to)[0].parent
    if Recording.open(directory.recording).truncated:
        sys.stderr.write("bench: the recording is truncated: the files hold what was written before it was cut off\n")
    if to != "mcap":
        _found(directory, folder, to)
    sys.stdout.write(f"{folder}\n")
    return 0


def _found(directory: rundir.RunDirectory, folder: Path, to: Tabular) -> None:
    """Results and figures; a run that was killed has no record, and its streams alone."""
    if not directory.record.exists():
        return
    record = read_record(directory.record)
    procedure = load_procedure(record.procedure)
    recording: Recording[Any] = Recording.open(directory.recording, procedure.plan)
    try:
        for _ in products(folder, to, record.measurements, figures(record, procedure, recording)):
            pass
    except OSError as error:
        raise BenchError(f"{folder}: cannot be written: {error.strerror or error}; the run is untouched") from error
