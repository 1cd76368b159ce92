"""What the composition root hands to the runner: the job, how to open its rig, and what only the opener knows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any

from bench.calibration import Calibration
from bench.clock import Clock
from bench.findings import Finding
from bench.procedure import BenchPlan, Procedure
from bench.procedure.rig import Rig
from bench.record.limits import Limit
from bench.recording.earlier import Earlier
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.run.supervisor import SafeStep, Supervisor
from bench.samples import StreamLayout


@dataclass(frozen=True)
class Job:
    """What is to be run. `seed` is None on a real rig, where `visit` means nothing; `lock` is what others must not share,
    None in simulation; `calibrations` are those that the procedure needs, looked up and found fit. With `require_verdict` a
    run that judged nothing is an error. `earlier` is what a stopped run left that this one continues; `asked` how it can be
    asked for again, None where nobody will (`bench.run.continued`)."""

    procedure: Procedure
    rig: RigFile
    plan: BenchPlan
    limits: Mapping[str, Limit]
    backend: str
    seed: int | None = None
    lock: AbstractContextManager[Any] | None = None
    calibrations: tuple[Calibration, ...] = ()
    require_verdict: bool = False
    visit: int = 0
    earlier: Earlier | None = None
    asked: Mapping[str, Any] | None = None


@dataclass(frozen=True)
class OpenRig:
    """A rig whose links are open and on which nothing has moved yet.

    `attach` gives the recorder to everything that records (None takes it away), `unguard` ends interlocks and silence
    checks so that make-safe can talk to a machine that has tripped, `safe_steps` are the ordered make-safe. `truth` is
    what a simulated rig drew, for `truth.json`; `findings` are what was noticed while opening it. `catch_up` lets the
    clock run until telemetry has reached the present: at the end of each step, before anything else is commanded.
    `aftermath` tells what the machine did while it was made safe; `identity` is what the controller says that it is.
    """

    rig: Rig
    streams: Sequence[StreamLayout]
    attach: Callable[[Recorder | None], None]
    unguard: Callable[[], None]
    safe_steps: Sequence[SafeStep]
    truth: Mapping[str, Any] | None = field(default=None)
    findings: Sequence[Finding] = ()
    catch_up: Callable[[], None] = lambda: None
    aftermath: Callable[[], tuple[Finding, ...]] = tuple
    identity: Mapping[str, float] = field(default_factory=dict)


class WatchedClock:
    """A rig's own clock that renews the heartbeat's lease before each slice and asks the supervisor after it."""

    def __init__(self, base: Clock, renew: Callable[[], None], check: Callable[[int], None]) -> None:
        self._base, self._renew, self._check = base, renew, check
        self.renewing = True  # the last thing make-safe can do is to let the heartbeat end

    def now_ns(self) -> int:
        return self._base.now_ns()

    def sleep(self, seconds: float) -> None:
        if self.renewing:
            self._renew()
        self._base.sleep(seconds)
        self._check(self._base.now_ns())


Connect = Callable[[Supervisor], AbstractContextManager[OpenRig]]
"""Opens a rig for the block; its clock asks the given supervisor."""
