"""Calibrations that are stopped before a step, and go on: runs as `bench run` makes them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from bench.cli.compose import Request, prepare
from bench.errors import OperatorAbort
from bench.progress import Progress, Silent
from bench.run import runner
from bench.run.runner import RunResult
from bench.run.supervisor import Supervisor

SHORT = ("angles=1", "rounds=1", "settle_s=0.3", "average_s=0.2")
"""Nine hangings at one angle."""
CALIBRATION = Request("amb-calibration", "tsbs12", seed=1, plan=SHORT)


class Stopping(Silent):
    """Says stop when one more step than so many begins."""

    def __init__(self, after: int) -> None:
        self._left = after

    def step(self, text: str) -> None:
        self._left -= 1
        if self._left < 0:
            raise OperatorAbort(f"stopped before {text}")


def ran(request: Request, folder: Path, progress: Progress | None = None) -> RunResult:
    """A run as `bench run` has it, without its display and report."""
    with Supervisor().watching() as supervisor:
        job, connect = prepare(replace(request, out=folder))
        return runner.run(job, folder, connect, supervisor, progress or Silent(), None)


def stopped_after(steps: int, folder: Path, request: Request = CALIBRATION) -> RunResult:
    """A calibration that the operator stopped when so many steps were done."""
    return ran(request, folder, Stopping(steps))


def went_on(path: Path, folder: Path, **asked: Any) -> RunResult:
    """The run at `path`, continued to its end; no more is typed than what is `asked`."""
    progress = asked.pop("progress", None)
    return ran(Request("", "", backend="", continues=path, **asked), folder, progress)
