"""`bench export`: the recorded channels of a run as files for other tools."""

from __future__ import annotations

import sys
from pathlib import Path

from bench import rundir
from bench.export import Format, export
from bench.recording import Recording


def export_command(run: Path, to: Format) -> int:
    """Write a run's streams and events into `RUN/export` and say where.

    Raises:
        ConfigError: it is no run directory.
        RecordingError: the recording cannot be read.
        BenchError: a file cannot be written.
    """
    written = export(run, to)
    if Recording.open(rundir.existing(run).recording).truncated:
        sys.stderr.write("bench: the recording is truncated: the files hold what was written before it was cut off\n")
    sys.stdout.write(f"{written[0].parent}\n")
    return 0
