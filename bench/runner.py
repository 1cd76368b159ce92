"""The runner: everything around a procedure, in the one order that a run has.

Lock the rig, make the run directory, write the record as unfinished, open the recording, bring the rig to the
procedure's state, acquire, make safe (always), close; then, from the closed file alone, analyse and judge, write the
record, the truth of a simulated rig, the report, and the line in the index.
"""

from __future__ import annotations

import json
import logging
import platform
import socket
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, cast

from bench import index, rundir, runlog
from bench.errors import (
    Aborted,
    BenchError,
    DeviceFault,
    InterlockError,
    LinkError,
    OperatorAbort,
    RecordingError,
    SignalAbort,
)
from bench.evaluation import Ending, Evaluation, evaluate
from bench.findings import Effect, Finding
from bench.limits import Limit
from bench.opened import OpenRig
from bench.procedure import BenchPlan, Procedure
from bench.progress import Progress
from bench.recorder import Recorder, RunHeader
from bench.recording import Recording
from bench.records import LinkCounts, Outcome, Record, RecordingFile, findings_of, unfinished, write_record
from bench.rigfile import RigFile
from bench.roles import RigState
from bench.rundir import RunDirectory
from bench.states import transition
from bench.supervisor import SafeStep, Supervisor

logger = logging.getLogger("bench.runner")
CODES: tuple[tuple[type[BaseException], str], ...] = (
    (SignalAbort, "signal"), (OperatorAbort, "operator-stop"), (DeviceFault, "controller-fault"),
    (InterlockError, "interlock"), (LinkError, "link-lost"), (RecordingError, "recording-failed"),
    (BenchError, "run-failed"),
)  # fmt: skip
NAMED_VERSIONS = ("levbench", "numpy", "scipy", "mcap", "cantools", "pydantic")


@dataclass(frozen=True)
class Job:
    """What is to be run. `seed` is None on a real rig; `lock` is what others must not share, None in simulation."""

    procedure: Procedure
    rig: RigFile
    plan: BenchPlan
    limits: Mapping[str, Limit]
    backend: str
    seed: int | None = None
    lock: AbstractContextManager[Any] | None = None


Connect = Callable[[Supervisor], AbstractContextManager[OpenRig]]
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
        ConfigError: the rig is in use or the run directory cannot be made; nothing was started.
        OSError: the record cannot be written (a full disk); the one that says unfinished stays.
    """
    started = datetime.now(UTC)
    with ExitStack() as stack:
        stack.enter_context(job.lock or nullcontext())
        directory = rundir.create(out, job.procedure.name, started)
        record = _unfinished(job, directory, started)
        write_record(directory.record, record)
        stack.enter_context(runlog.to_file(directory.log))
        logger.info("run %s on rig %s, backend %s, seed %s", directory.run_id, job.rig.name, job.backend, job.seed)
        progress.stage(f"{job.procedure.name} on {job.rig.name} ({job.backend}), run {directory.run_id}")
        ending, truth = _acquired(job, directory, started, connect, supervisor, progress)
        ended = _now()
        result = _concluded(job, directory, record, ending, ended, supervisor, progress)
        with supervisor.finishing():
            write_record(directory.record, result.record)
            if truth is not None:
                _write_json(directory.path / "truth.json", truth)
        result = _reported(job, directory, result, report, supervisor, progress)
        with supervisor.finishing():
            _indexed(directory)
        logger.info("outcome %s %s", result.outcome, result.reason)
    return result


def _unfinished(job: Job, directory: RunDirectory, started: datetime) -> Record:
    return unfinished(
        run_id=directory.run_id, procedure=job.procedure.name, rig=job.rig.name, uut=job.rig.uut.model_dump(),
        started=started.isoformat(timespec="seconds"), seed=job.seed, plan=job.plan.model_dump(mode="json"),
        versions=versions(),
    )  # fmt: skip


def versions() -> dict[str, str]:
    """Versions of Python and of what takes part in the numbers."""
    found = {"python": platform.python_version()}
    for name in NAMED_VERSIONS:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "unknown"
    return found


def _header(job: Job) -> RunHeader:
    seed = "" if job.seed is None else str(job.seed)
    limits = {name: asdict(limit) for name, limit in job.limits.items()}
    return RunHeader(
        metadata={
            "run": {"procedure": job.procedure.name, "rig": job.rig.name, "backend": job.backend, "seed": seed},
            "versions": versions(),
        },
        attachments={
            "rig.toml": job.rig.toml_text.encode(),
            "rig.dbc": job.rig.dbc_text.encode(),
            "plan.json": job.plan.model_dump_json().encode(),
            "spec.json": json.dumps(limits, sort_keys=True).encode(),
            "calibrations.json": b"[]",
        },
    )


def _acquired(
    job: Job, directory: RunDirectory, started: datetime, connect: Connect, supervisor: Supervisor, progress: Progress
) -> tuple[Ending, Mapping[str, Any] | None]:
    """Open, move, make safe and close; how it ended, and the truth if the rig is simulated."""
    truth: Mapping[str, Any] | None = None
    ending: Ending | None = None
    try:
        with connect(supervisor) as live:
            truth = live.truth
            recorder = Recorder(
                directory.recording, clock=live.rig.clock, streams=live.streams, header=_header(job),
                live=job.backend == "live",
            )  # fmt: skip
            with recorder:
                live.attach(recorder)
                cause, findings = _moved(job, live, recorder, supervisor, progress)
                ending = _ending(cause, findings, live, recorder)
                recorder.wall |= _wall(directory, started)
                with _failing_quietly():
                    ending.write(recorder)
    except Exception as error:
        late = _cause(error)
        if ending is None or ending.stopped is None:
            ending = Ending(late[0], (*(ending.findings if ending else ()), late[1]))
        else:
            ending = replace(ending, findings=(*ending.findings, late[1]))
    assert ending is not None
    return ending, truth


def _moved(
    job: Job, live: OpenRig, recorder: Recorder, supervisor: Supervisor, progress: Progress
) -> tuple[BaseException | None, tuple[Finding, ...]]:
    """Bring the rig to the procedure's state, acquire, make safe; what ended it early, and what make-safe could not do."""
    cause: BaseException | None = None
    rig, procedure = live.rig, job.procedure
    with runlog.warnings_to(lambda room, text: recorder.event("log", room=room, text=text)):
        try:
            with supervisor.moving():
                progress.stage(f"bring the rig to {procedure.state}")
                transition(rig, RigState.READY)
                for name, value in procedure.settings(job.plan).items():
                    rig.levitation.set(name, value)
                transition(rig, procedure.state)
                progress.stage("acquire")
                progress.total(procedure.step_count(job.plan))
                procedure.acquire(rig, job.plan, cast(Recorder, WatchedSteps(recorder, progress)))
        except BaseException as error:
            # Whatever it is, also SystemExit: the machine is made safe first.
            cause = error
        finally:
            with supervisor.finishing(), suppress(Exception):
                _told(cause, progress)
            live.unguard()
            findings = supervisor.make_safe([_recording_or_not(s, live) for s in live.safe_steps], rig.clock.now_ns)
    return cause, findings


def _told(cause: BaseException | None, progress: Progress) -> None:
    if cause is not None:
        logger.warning("stopped: %s", str(cause) or type(cause).__name__)
    progress.stage("make safe")


def _recording_or_not(step: SafeStep, live: OpenRig) -> SafeStep:
    """A recorder that fails (a full disk) must not keep the machine from being made safe."""

    def action() -> None:
        try:
            step.action()
        except RecordingError as error:
            live.attach(None)
            logger.error("recording stopped: %s", error)
            step.action()

    return SafeStep(step.name, action, step.timeout_s)


class WatchedSteps:
    """The recorder as `acquire` sees it, with each step told to the progress display."""

    def __init__(self, recorder: Recorder, progress: Progress) -> None:
        self._recorder, self._progress = recorder, progress

    @contextmanager
    def step(self, kind: str, **labels: Any) -> Iterator[None]:
        said = ", ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in labels.items() if v != "")
        self._progress.step(f"{kind} {said}")
        with self._recorder.step(kind, **labels):
            yield

    def __getattr__(self, name: str) -> Any:
        return getattr(self._recorder, name)


def _ending(cause: BaseException | None, findings: tuple[Finding, ...], live: OpenRig, recorder: Recorder) -> Ending:
    counters = live.rig.counters
    # Lost samples are gaps; everything else that a clean link does not do is an error.
    errors = counters.wrong_length + counters.duplicates + counters.reordered + counters.reboots
    link = LinkCounts(sum(recorder.integrity.frames.values()), counters.gaps, errors)
    if counters.lost:
        text = f"{counters.lost} samples were lost in {counters.gaps} gaps"
        findings = (*findings, Finding("samples-lost", text, "telemetry"))
    if cause is None:
        return Ending(None, findings, link)
    stopped, finding = _cause(cause)
    return Ending(stopped, (finding, *findings), link)


def _cause(error: BaseException) -> tuple[Outcome, Finding]:
    """Outcome and finding of what ended a run early; an error nobody raised on purpose leaves its traceback in the log."""
    code = next((code for kind, code in CODES if isinstance(error, kind)), "exception")
    text = str(error)
    if code == "exception":
        text = f"{type(error).__name__}: {error}"
        logger.error("unexpected %s (traceback in run.log)", text, exc_info=error)
    stopped = Outcome.ABORTED if isinstance(error, Aborted | KeyboardInterrupt) else Outcome.ERROR
    return stopped, Finding(code, text, "acquire", Effect.ERROR)


@contextmanager
def _failing_quietly() -> Iterator[None]:
    """The recorder raises the same failure again when it is closed."""
    try:
        yield
    except RecordingError as error:
        logger.debug("%s", error)


def _wall(directory: RunDirectory, started: datetime) -> dict[str, str]:
    """What differs between two runs of one seed: dates, names, durations."""
    took = (datetime.now(UTC) - started).total_seconds()
    return {
        "run_id": directory.run_id, "host": socket.gethostname(), "started": started.isoformat(timespec="seconds"),
        "ended": _now(), "duration_s": f"{took:.3f}",
    }  # fmt: skip


def _concluded(
    job: Job, directory: RunDirectory, record: Record, ending: Ending, ended: str, supervisor: Supervisor,
    progress: Progress,
) -> RunResult:  # fmt: skip
    """Analyse and judge, from the closed file alone."""
    progress.stage("analyse")
    recording: Recording[Any] | None = None
    digest = None
    try:
        if directory.recording.is_file():
            recording = Recording.open(directory.recording, job.procedure.plan)
            digest = RecordingFile(directory.recording.name, recording.digest())
        evaluation = _evaluated(job, recording, ending)
    except (RecordingError, SignalAbort) as error:
        stopped, finding = _cause(error)
        finding = replace(finding, where="analyse")
        ending = replace(ending, stopped=ending.stopped or stopped, findings=(*ending.findings, finding))
        evaluation = _evaluated(job, None, ending)
    return RunResult(directory.path, evaluation.finish(record, ending, ended, digest))


def _evaluated(job: Job, recording: Recording[Any] | None, ending: Ending) -> Evaluation:
    nothing = recording is None or ending.stopped is not None
    return evaluate(job.procedure, cast(Recording[Any], recording), job.limits, stopped=nothing)


def _reported(
    job: Job, directory: RunDirectory, result: RunResult, report: Report | None, supervisor: Supervisor,
    progress: Progress,
) -> RunResult:  # fmt: skip
    """The report; one that fails is a finding and keeps the verdict, a signal makes the run ABORTED."""
    if report is None:
        return result
    progress.stage("report")
    try:
        recording = Recording.open(directory.recording, job.procedure.plan) if result.record.recording else None
        report(directory.path, result.record, job.procedure, recording)
        return result
    except SignalAbort as error:
        added = findings_of([Finding("signal", f"{error} while the report was built", "report", Effect.ERROR)])
        record = replace(result.record, outcome=Outcome.ABORTED, findings=(*result.record.findings, *added))
    except Exception as error:
        logger.warning("the report failed: %s", error)
        logger.debug("traceback", exc_info=error)
        added = findings_of([Finding("report-failed", str(error) or type(error).__name__, "report")])
        record = replace(result.record, findings=(*result.record.findings, *added))
    with supervisor.finishing():
        write_record(directory.record, record)
    return replace(result, record=record)


def _indexed(directory: RunDirectory) -> None:
    """The index can always be rebuilt, so a failure is only worth a line."""
    try:
        index.add(directory.path)
    except Exception as error:
        logger.warning("the run index was not updated (%s); `bench runs` rebuilds it", error)


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(content, indent=2, allow_nan=False) + "\n", encoding="utf-8")


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
