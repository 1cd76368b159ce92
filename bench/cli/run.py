"""`bench run`."""

from __future__ import annotations

import sys
from contextlib import suppress

from bench import runlog, runner, units
from bench.cli import reporting
from bench.cli.compose import Request, prepare
from bench.progress import shown_on
from bench.records import Outcome, Record
from bench.runner import RunResult
from bench.supervisor import Supervisor
from bench.uncertainty import stated

STATUS = {Outcome.PASS: 0, Outcome.FAIL: 1, Outcome.ERROR: 3, Outcome.ABORTED: 4, Outcome.INDETERMINATE: 5}


def execute(request: Request, supervisor: Supervisor | None = None) -> RunResult:
    """Run what was asked for, showing progress on standard error.

    Raises:
        ConfigError: nothing was started.
    """
    with (supervisor or Supervisor()).watching() as watching, shown_on(sys.stderr) as progress:
        with runlog.to_lines(progress.line):
            job, connect = prepare(request)
            report = reporting.build if request.report else None
            return runner.run(job, request.out, connect, watching, progress, report)


def run_command(request: Request) -> int:
    """Run, say the outcome on standard error and the run directory on standard output; the outcome's exit status."""
    result = execute(request)
    with suppress(OSError):  # nobody reads any more, or the terminal is closed; the outcome stands all the same
        sys.stderr.write(summary(result.record))
        sys.stdout.write(f"{result.directory}\n")
        sys.stdout.flush()
    return STATUS[result.outcome]


def summary(record: Record) -> str:
    """Results, findings and outcome as lines of text; the report is where digits and units are set with care."""
    lines = []
    widest = max((len(m.name) for m in record.measurements), default=0)
    for m in record.measurements:
        value = "missing"
        if m.value is not None and m.expanded_uncertainty is not None:
            symbol, one = units.habit(m.unit, max(abs(m.value), m.expanded_uncertainty))
            unit = "" if symbol == "1" else symbol
            value = f"{stated(m.value / one, m.expanded_uncertainty / one)} {unit}".rstrip()
        place = f" ({m.where})" if m.where else ""
        lines.append(f"  {m.name:{widest}} {value:32} {m.verdict.value}{place}")
    lines += [f"  {f.effect.value}: {f.code}{f' ({f.where})' if f.where else ''}: {f.text}" for f in record.findings]
    return "\n".join([*lines, f"outcome {record.outcome.value}"]) + "\n"
