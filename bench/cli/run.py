"""`bench run`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import suppress

from bench import runlog, runner, units
from bench.cli import reporting
from bench.cli.compose import Request, prepare
from bench.limits import Verdict
from bench.outcomes import Outcome, outranking
from bench.progress import shown_on
from bench.records import Measurement, Record
from bench.runner import RunResult
from bench.supervisor import Supervisor
from bench.uncertainty import stated

STATUS = {Outcome.PASS: 0, Outcome.DONE: 0, Outcome.FAIL: 1, Outcome.ERROR: 3, Outcome.ABORTED: 4,
          Outcome.INDETERMINATE: 5}  # fmt: skip


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
    with suppress(BrokenPipeError):  # nobody reads any more; the outcome stands all the same
        sys.stderr.write(summary(result.record))
        sys.stdout.write(f"{result.directory}\n")
        sys.stdout.flush()
    return STATUS[result.outcome]


def summary(record: Record) -> str:
    """Results, findings and outcome as lines of text; the report is where digits and units are set with care."""
    widest = max((len(m.name) for m in record.measurements), default=0)
    first = sorted(record.measurements, key=lambda m: m.verdict is not Verdict.FAIL)
    lines = [_line(m, widest, outranking(m, record.findings)) for m in first]
    lines += [f"  {f.effect.value}: {f.code}{f' ({f.where})' if f.where else ''}: {f.text}" for f in record.findings]
    done = ": no acceptance limit was applied" if record.outcome is Outcome.DONE else ""
    return "\n".join([*lines, f"outcome {record.outcome.value}{done}"]) + "\n"


def _line(m: Measurement, widest: int, outranked: Sequence[str]) -> str:
    """A measurement; a verdict of fail that a finding outranks is told with it."""
    value = "missing"
    if m.value is not None and m.expanded_uncertainty is not None:
        symbol, one = units.habit(m.unit, max(abs(m.value), m.expanded_uncertainty))
        unit = "" if symbol == "1" else symbol
        value = f"{stated(m.value / one, m.expanded_uncertainty / one)} {unit}".rstrip()
    place = f" ({m.where})" if m.where else ""
    but = f", outranked by {', '.join(outranked)}" if outranked else ""
    return f"  {m.name:{widest}} {value:32} {m.verdict.value}{but}{place}"
