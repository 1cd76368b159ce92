"""`bench analyse` and `bench report`: a stored run analysed, or reported, again."""

from __future__ import annotations

import logging
import sys
from pathlib import Path
from typing import Any

from bench import rundir, runlog
from bench.cli import reporting
from bench.cli.loading import load_procedure
from bench.cli.run import STATUS
from bench.cli.summary import summary
from bench.errors import RecordingError
from bench.progress_text import columns
from bench.record.records import read_record
from bench.recording import Recording
from bench.run import reanalysis
from bench.run.supervisor import Supervisor

logger = logging.getLogger("bench.cli")


def _line(text: str) -> None:
    sys.stderr.write(text + "\n")


def analyse_command(run: Path, whole: bool = False) -> int:
    """Analyse again; the verdict's exit status, the analysis directory on standard output."""
    with Supervisor().watching(), runlog.to_lines(_line):
        result = reanalysis.analyse(run, load_procedure)
    sys.stderr.write(summary(result.record, result.directory, whole=whole, width=columns()))
    sys.stdout.write(f"{result.directory}\n")
    return STATUS[result.outcome]


def report_command(run: Path) -> int:
    """Build the report again from the stored record and recording."""
    directory = rundir.existing(run)
    record = read_record(directory.record)
    procedure = load_procedure(record.procedure)
    recording: Recording[Any] | None = None
    with Supervisor().watching(), runlog.to_lines(_line):
        try:
            recording = Recording.open(directory.recording, procedure.plan)
            procedure = procedure.on(recording.rig)
        except RecordingError as error:
            logger.warning("the report goes without its recording: %s", error)
        reporting.build(directory.path, record, procedure, recording)
    for name in ("report.html", "report.pdf"):
        sys.stdout.write(f"{directory.path / name}\n")
    return 0
