"""The runner: everything around a procedure, in the one order that a run has.

Lock the rig, open its links, make the run directory, write the record as unfinished, open the recording, bring the rig
to the procedure's state, acquire, make safe (always), close; then, from the closed file alone, analyse and judge, write the
record, the truth of a simulated rig, the report, and the line in the index.
"""

from __future__ import annotations

import json
import logging
import shlex
from collections.abc import Callable, Mapping
from contextlib import ExitStack, nullcontext, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from bench import rundir, runlog
from bench.errors import ConfigError, RecordingError, SignalAbort
from bench.findings import SIMULATED_CONTROLLER, Effect, Finding
from bench.procedure import Procedure
from bench.progress import Progress
from bench.record.outcomes import Outcome, outcome_of
from bench.record.records import Record, findings_of, unfinished, write_record
from bench.record.setup import setup_of
from bench.record.sources import RecordingFile
from bench.recording import Recording
from bench.recording.reserve import reserved
from bench.run import index, provenance, stopped
from bench.run.evaluation import Ending, Evaluation, evaluate
from bench.run.job import Connect, Job, OpenRig
from bench.run.machine_phase import Acquired, acquired, cause_of
from bench.run.supervisor import Supervisor
from bench.rundir import RunDirectory

logger = logging.getLogger("bench.run.runner")
Report = Callable[[Path, Record, Procedure, Recording[Any] | None], None]


@dataclass(frozen=True)
class RunResult:
    """A finished run or analysis: where it lies and its record."""

    directory: Path
    record: Record

    @property
    def outcome(self) -> Outcome:
        return self.record.outcome

    @property
    def stopped_by_signal(self) -> bool:
        return any(f.code == "signal" for f in self.record.findings)

    @property
    def reason(self) -> str:
        """The outcome's causes in one line."""
        verdicts = [
            f"{m.name} {m.verdict.value}" for m in self.record.measurements if m.verdict not in ("pass", "none")
        ]
        found = [f"{f.code}: {f.text}" for f in self.record.findings if f.effect is not Effect.NOTE]
        return "; ".join([*found, *verdicts])


def run(
    job: Job, out: Path, connect: Connect, supervisor: Supervisor, progress: Progress, report: Report | None
) -> RunResult:
    """Run a procedure; whatever goes wrong after the run directory exists ends in its record.

    Raises:
        ConfigError: the rig is in use or not the one of the rig file, a link cannot be opened, or the run directory
            cannot be made; nothing was started.
        LinkError: the controller does not talk; nothing was started.
    """
    started = datetime.now(UTC)
    with ExitStack() as stack:
        stack.enter_context(job.lock or nullcontext())
        stack.enter_context(supervisor.finishing())  # from here on a signal ends in the record, not in a traceback
        with connect(supervisor) as live:  # what is wrong with a link is said before anything exists
            _same_kind(job, live)
            if job.earlier is not None:
                stopped.require_same_controller(job.earlier, live.identity)
                stopped.require_later(job.earlier, live.rig.clock.now_ns())
            directory = rundir.create(out, job.procedure.name, started)
            release = stack.enter_context(reserved(directory.path))
            record = _unfinished(job, directory, started)
            write_record(directory.record, record)
            if job.asked is not None:
                _write_json(directory.asked, job.asked)
            stack.enter_context(runlog.to_file(directory.log))
            which = "" if job.seed is None else f", seed {job.seed}, visit {job.visit}"
            logger.info("run %s on rig %s, backend %s%s", directory.run_id, job.rig.name, job.backend, which)
            progress.stage(f"{job.procedure.name} on {job.rig.name} ({job.backend}), run {directory.run_id}")
            wall = partial(provenance.wall, directory, started, job.rig.path, job.procedure.origin)
            machine = acquired(job, directory.recording, live, supervisor, progress, wall=wall)
        release()  # a disk that is full by now still takes the record
        with progress.busy("analyse"):
            result, recording = _concluded(job, directory, record, machine, supervisor)
        progress.found(lambda: [Finding(f.code, f.text, f.where, f.effect) for f in result.record.findings])
        result = _written(directory, result)
        if machine.truth is not None:
            with suppress(OSError):  # what a simulated rig drew is drawn again from its seed
                _write_json(directory.truth, machine.truth)
        result = _reported(job, directory, result, recording, report, supervisor, progress)
        _indexed(directory)
        logger.info("outcome %s %s", result.outcome, result.reason)
    return result


def _same_kind(job: Job, live: OpenRig) -> None:
    """Only when it is connected does a live controller tell that it is a simulated one.

    Raises:
        ConfigError: a calibration of a real machine would be used for a simulated one, or the other way round.
    """
    served = any(f.code == SIMULATED_CONTROLLER for f in live.findings)
    for c in job.calibrations:
        if (c.backend == "served") != (served and job.backend == "live"):
            made, here = ("simulated", "real") if c.backend == "served" else ("real", "simulated")
            raise ConfigError(
                f"calibration {c.procedure} ({c.run_id}): made on a {made} controller, this is a {here} one; nothing was "
                f"started. Next: calibrate this one, with --calibrations DIR to keep the two apart"
            )


def _unfinished(job: Job, directory: RunDirectory, started: datetime) -> Record:
    return unfinished(
        run_id=directory.run_id, procedure=job.procedure.name, rig=job.rig.name, uut=job.rig.uut.model_dump(),
        started=started.isoformat(timespec="seconds"), seed=job.seed, visit=job.visit, plan=job.plan.model_dump(mode="json"),
        versions=provenance.versions(job.procedure, job.rig), calibrations=job.calibrations,
        setup=setup_of(job.rig, job.procedure.settings(job.rig, job.plan)),
    )  # fmt: skip


def _concluded(
    job: Job, directory: RunDirectory, record: Record, machine: Acquired, supervisor: Supervisor
) -> tuple[RunResult, Recording[Any] | None]:
    """Analyse and judge, from the closed file alone; and that file, where it can be read."""
    ending = machine.ending
    recording: Recording[Any] | None = None
    digest = None
    try:
        if directory.recording.is_file():
            recording = Recording.open(directory.recording, job.procedure.plan)
            digest = RecordingFile(directory.recording.name, recording.digest())
        with supervisor.interruptible():
            evaluation = _evaluated(job, recording, ending)
    except (RecordingError, SignalAbort) as error:
        stopped, finding = cause_of(error)
        finding = replace(finding, where="analyse")
        ending = replace(ending, stopped=ending.stopped or stopped, findings=(*ending.findings, finding))
        evaluation = _evaluated(job, None, ending)
    result = RunResult(directory.path, evaluation.finish(record, ending, machine.ended, digest))
    return result, recording if digest else None


def _written(directory: RunDirectory, result: RunResult) -> RunResult:
    """The result once its record is written. Where that cannot be, the one on the disk stays, and what comes back says so."""
    try:
        write_record(directory.record, result.record)
        return result
    except OSError as error:
        text = (f"{directory.record}: cannot be written: {error.strerror or error}; what stands there is older. Next: free "
                f"space there, then `bench analyse {shlex.quote(str(directory.path))}`")  # fmt: skip
        logger.error("%s", text)
        added = findings_of([Finding("record-not-written", text, "record", Effect.ERROR)])
        findings = (*result.record.findings, *added)
        outcome = outcome_of(result.record.measurements, findings, result.record.outcome)
        return replace(result, record=replace(result.record, findings=findings, outcome=outcome))


def _evaluated(job: Job, recording: Recording[Any] | None, ending: Ending) -> Evaluation:
    nothing = recording is None or ending.stopped is not None
    return evaluate(job.procedure, recording, job.limits, stopped=nothing)


def _reported(
    job: Job, directory: RunDirectory, result: RunResult, recording: Recording[Any] | None, report: Report | None,
    supervisor: Supervisor, progress: Progress,
) -> RunResult:  # fmt: skip
    """The report; one that fails is a finding and keeps the verdict, a signal makes the run ABORTED."""
    if report is None:
        return result
    try:
        with progress.busy("report"), supervisor.interruptible():
            report(directory.path, result.record, job.procedure, recording)
        return result
    except SignalAbort as error:
        code = cause_of(error)[1].code
        added = findings_of([Finding(code, f"{error} while the report was built", "report", Effect.ERROR)])
        record = replace(result.record, outcome=Outcome.ABORTED, findings=(*result.record.findings, *added))
    except Exception as error:
        logger.warning("the report failed: %s", error)
        logger.debug("traceback", exc_info=error)
        added = findings_of([Finding("report-failed", str(error) or type(error).__name__, "report")])
        record = replace(result.record, findings=(*result.record.findings, *added))
    return _written(directory, replace(result, record=record))


def _indexed(directory: RunDirectory) -> None:
    """The index can always be rebuilt, so a failure is only worth a line."""
    try:
        index.add(directory.path)
    except Exception as error:
        logger.warning("the run index was not updated (%s); `bench runs` rebuilds it", error)


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(content, indent=2, allow_nan=False) + "\n", encoding="utf-8")
