"""`bench run`."""

from __future__ import annotations

import shlex
import sys
from contextlib import suppress

from bench import runlog
from bench.cli import live, reporting
from bench.cli.compose import Request, prepare
from bench.cli.live import LivePage, PageRequest
from bench.cli.loading import load_procedure
from bench.cli.summary import summary
from bench.errors import ConfigError
from bench.progress import shown_on
from bench.progress_text import columns
from bench.record.outcomes import Outcome
from bench.run import runner, stopped
from bench.run.runner import RunResult
from bench.run.supervisor import Supervisor
from bench.rundir import RunDirectory

STATUS = {Outcome.PASS: 0, Outcome.DONE: 0, Outcome.FAIL: 1, Outcome.ERROR: 3, Outcome.ABORTED: 4,
          Outcome.INDETERMINATE: 5}  # fmt: skip


def execute(request: Request, supervisor: Supervisor | None = None, page: LivePage | None = None) -> RunResult:
    """Run what was asked for, showing progress on standard error, and on a page if there is one.

    Raises:
        ConfigError: nothing was started.
    """
    with (supervisor or Supervisor()).watching() as watching, shown_on(sys.stderr) as shown:
        progress = shown if page is None else page.progress(shown)
        with runlog.to_lines(progress.line):
            job, connect = prepare(request, progress.asking)
            if page is not None:
                connect = page.watched(job, connect)
                shown.line(page.announced)
            report = reporting.build if request.report else None
            return runner.run(job, request.out, connect, watching, progress, report)


def _going_on(result: RunResult) -> str:
    """How a run that was stopped is continued, where it can be: a line of the summary."""
    if result.outcome not in (Outcome.ABORTED, Outcome.ERROR):
        return ""
    with suppress(ConfigError):
        if stopped.can_continue(load_procedure(result.record.procedure), RunDirectory(result.directory)):
            return f"  go on    {shlex.join(['bench', 'run', '--continue', str(result.directory)])}\n"
    return ""


def run_command(request: Request, whole: bool = False, page: PageRequest | None = None) -> int:
    """Run, say the outcome on standard error and the run directory on standard output; the outcome's exit status. `whole` is
    for every result and finding; with `page` there is a live page.

    Raises:
        ConfigError: nothing was started.
    """
    if page is None:
        return _told(execute(request), whole)
    supervisor = Supervisor()
    with live.opened(page, supervisor.stop) as shown:
        result = execute(request, supervisor, shown)
        status = _told(result, whole)
        shown.end(result, status)
        shown.stay()
    return status


def _told(result: RunResult, whole: bool) -> int:
    with suppress(OSError):  # nobody reads any more, or the terminal is closed; the outcome stands all the same
        sys.stderr.write(summary(result.record, result.directory, whole=whole, width=columns()))
        sys.stderr.write(_going_on(result))
        sys.stdout.write(f"{result.directory}\n")
        sys.stdout.flush()
    return STATUS[result.outcome]
