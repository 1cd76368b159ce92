"""The machine's part of a run: bring the rig to its state, acquire, and make safe, always."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

from bench import runlog
from bench.clock import Clock
from bench.display_units import of_labels
from bench.errors import (
    Aborted,
    AnotherHost,
    BenchError,
    BytesUnreadable,
    ClockWrong,
    DeviceFault,
    DeviceUnreadable,
    DriveFault,
    FrozenError,
    InterlockError,
    LinkError,
    NoReply,
    NotDischarged,
    OperatorAbort,
    OperatorRefused,
    OperatorSilent,
    ReadingsStand,
    RecordingError,
    Refused,
    RotorNotArrived,
    SignalAbort,
    SpeedContradicts,
    StateContradicts,
    StateNotReached,
    StopAsked,
)
from bench.findings import Effect, Finding
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.procedure.states import transition
from bench.progress import Progress
from bench.record.outcomes import Outcome
from bench.recording.earlier import Earlier
from bench.recording.recorder import Recorder
from bench.recording.takeover import taking_over
from bench.rigfile.registers import RegisterRefused
from bench.run import provenance
from bench.run.continued import IDENTITY
from bench.run.evaluation import Ending, of_calibrations
from bench.run.job import Job, OpenRig
from bench.run.supervisor import SafeStep, Supervisor

logger = logging.getLogger("bench.run.runner")
CODES: tuple[tuple[type[BaseException], str], ...] = (
    (StopAsked, "operator-stop"), (SignalAbort, "signal"), (OperatorAbort, "operator-stop"), (DriveFault, "drive-fault"),
    (DeviceFault, "controller-fault"), (AnotherHost, "another-host"), (NotDischarged, "not-discharged"),
    (InterlockError, "interlock"),
    (RegisterRefused, "device-refused"), (DeviceUnreadable, "device-unreadable"), (NoReply, "no-reply"),
    (BytesUnreadable, "bytes-unreadable"), (OperatorSilent, "operator-silent"), (FrozenError, "telemetry-frozen"),
    (ClockWrong, "clock-drift"),
    (ReadingsStand, "stuck-channel"), (StateContradicts, "state-contradicts"), (SpeedContradicts, "speed-and-angle-disagree"),
    (LinkError, "link-lost"), (StateNotReached, "state-not-reached"), (RotorNotArrived, "rotor-not-arrived"),
    (OperatorRefused, "operator-refused"), (Refused, "controller-refused"), (RecordingError, "recording-failed"),
    (BenchError, "run-failed"),
)  # fmt: skip
"""The finding of an error that ends a run: the first kind that it is."""
SLICE_S, MOST_WAITING = 0.02, 4  # while an earlier recording is taken over


@dataclass(frozen=True)
class Acquired:
    """The machine's part of a run: how and when it ended, the truth if the rig is simulated, what raised where it was
    stopped early, and whether the rig had come into the procedure's state."""

    ending: Ending
    ended: str
    truth: Mapping[str, Any] | None
    cause: BaseException | None
    brought_up: bool


def acquired(
    job: Job, path: Path, live: OpenRig, supervisor: Supervisor, progress: Progress, *, plain: bool = False,
    wall: Callable[[], Mapping[str, str]] = dict,
) -> Acquired:  # fmt: skip
    """Open the recording at `path`, move, make safe, close it. Raises nothing: what went wrong is in the ending.

    Args:
        plain: record without a thread and without the 100 Hz view (`bench.recording.recorder.Recorder`).
        wall: what the recording says of the wall clock, asked at its end.
    """
    ending: Ending | None = None
    cause: BaseException | None = None
    said, up = wall(), False
    try:
        recorder = Recorder(
            path, clock=live.rig.clock, streams=live.streams, header=provenance.header(job),
            live=job.backend == "live", plain=plain,
        )  # fmt: skip
        with recorder:
            cause, findings, up = _moved(job, live, recorder, supervisor, progress)
            ending = _ending(cause, findings, live, recorder)
            said = wall()
            recorder.wall |= said
            with suppress(RecordingError):  # closing raises the same failure again
                ending.write(recorder)
    except Exception as error:
        cause = cause or error
        stopped, finding = cause_of(error)
        before = ending or Ending()
        known = finding.code in [f.code for f in before.findings]  # a failed recorder raises again when it is closed
        findings = before.findings if known else (*before.findings, finding)
        ending = replace(before, stopped=before.stopped or stopped, findings=findings)
    assert ending is not None
    return Acquired(ending, said.get("ended", ""), live.truth, cause, up)


def _moved(
    job: Job, live: OpenRig, recorder: Recorder, supervisor: Supervisor, progress: Progress
) -> tuple[BaseException | None, tuple[Finding, ...], bool]:
    """Bring the rig to the procedure's state, acquire, make safe; what ended it early, what make-safe could not do, and
    whether the rig had come into its state."""
    cause: BaseException | None = None
    up = False
    rig, procedure = live.rig, job.procedure
    with runlog.warnings_to(lambda room, text: recorder.event("log", room=room, text=text)):
        try:
            with supervisor.moving():
                if job.earlier is not None:
                    _take_over(job, job.earlier, recorder, rig.clock, progress)
                live.attach(recorder)
                if live.identity:
                    recorder.event(IDENTITY, said=dict(live.identity))
                progress.stage(f"bring the rig to {procedure.state}")
                progress.found(lambda: (*live.findings, *of_calibrations(recorder.calibrations)))
                transition(rig, RigState.READY)
                rig.levitation.write(procedure.settings(job.rig, job.plan))
                up = _brought_up(job, rig, recorder)
                if up:
                    progress.stage("acquire")
                    progress.total(_steps_to_do(job))
                    steps = WatchedSteps(recorder, progress, live.catch_up, lambda: rig.health().findings())
                    procedure.acquire(rig, job.plan, cast(Recorder, steps))
        except BaseException as error:
            # Whatever it is, also SystemExit: the machine is made safe first.
            cause = error
        finally:
            with supervisor.finishing(), suppress(Exception):
                _told(cause, progress)
            live.unguard()
            findings = supervisor.make_safe([_recording_or_not(s, live) for s in live.safe_steps], rig.clock.now_ns)
            known = None if cause is None else cause_of(cause)[1].code
            findings += tuple(f for f in live.aftermath() if f.code != known)
    return cause, findings, up


def _brought_up(job: Job, rig: Rig, recorder: Recorder) -> bool:
    """Bring the rig from READY into the procedure's state; False where the procedure saw that it must not, or was not."""
    if job.procedure.bring_up is not None:
        return job.procedure.bring_up(rig, recorder)
    transition(rig, job.procedure.state)
    return True


def _steps_to_do(job: Job) -> int:
    """For the progress display, no less than there will be; what a stopped run completed of an operator's work is done, and the
    last of it is repeated, or a part of it. What comes before that work is done anew as far as a lift takes it away."""
    planned = job.procedure.steps(job.rig, job.plan)
    if job.earlier is None or not planned:
        return planned
    done = sum(s.kind == job.procedure.continues for s in job.earlier.steps)
    return planned - done + job.procedure.whole(job.rig, job.plan)


def _take_over(job: Job, earlier: Earlier, recorder: Recorder, clock: Clock, progress: Progress) -> None:
    """What a stopped run recorded, while the rig's clock runs: heartbeats go on, and nothing of this run is recorded yet."""
    progress.stage(f"take over {len(earlier.steps)} completed steps")
    for _ in taking_over(recorder, earlier):
        clock.sleep(SLICE_S)
        while job.backend == "live" and recorder.waiting > MOST_WAITING:  # else the writer is waited for by itself
            clock.sleep(SLICE_S)


def _told(cause: BaseException | None, progress: Progress) -> None:
    if cause is not None:
        logger.warning("stopped: %s", str(cause) or type(cause).__name__)
    progress.total(0)
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
    """The recorder as `acquire` sees it, with each step told to the progress display, and what is wrong with the link by then,
    and over only when telemetry has reached its end: what `acquire` commands next does not act within it."""

    def __init__(
        self, recorder: Recorder, progress: Progress, catch_up: Callable[[], None],
        troubles: Callable[[], Iterable[Finding]] = tuple,
    ) -> None:  # fmt: skip
        self._recorder, self._progress, self._catch_up, self._troubles = recorder, progress, catch_up, troubles

    @contextmanager
    def step(self, kind: str, **labels: Any) -> Iterator[None]:
        self._progress.step(f"{kind} {of_labels(labels)}".rstrip())
        with self._recorder.step(kind, **labels):
            yield
        self._catch_up()
        self._progress.found(self._troubles)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._recorder, name)


def _ending(cause: BaseException | None, findings: tuple[Finding, ...], live: OpenRig, recorder: Recorder) -> Ending:
    health = live.rig.health()
    link = health.counts(sum(recorder.integrity.frames.values()))
    findings, told = (*live.findings, *findings), tuple(health.findings())
    if cause is None:
        return Ending(None, (*findings, *told), link)
    stopped, finding = cause_of(cause)
    return Ending(stopped, (finding, *findings, *(f for f in told if f.code != finding.code)), link)


def cause_of(error: BaseException) -> tuple[Outcome, Finding]:
    """Outcome and finding of what ended a run early; an error nobody raised on purpose leaves its traceback in the log."""
    code = next((code for kind, code in CODES if isinstance(error, kind)), "exception")
    text = str(error)
    if code == "exception":
        text = f"{type(error).__name__}: {error}"
        logger.error("unexpected %s (traceback in run.log)", text, exc_info=error)
    stopped = Outcome.ABORTED if isinstance(error, Aborted | KeyboardInterrupt) else Outcome.ERROR
    return stopped, Finding(code, text, "acquire", Effect.ERROR)
