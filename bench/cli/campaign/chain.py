"""One rig: every step through the normal runner, each result adopted before the step that needs it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.campaign.directory import CampaignDirectory
from bench.cli import reporting
from bench.cli.campaign.facts import adopt, request_of
from bench.cli.campaign.steps import Planned
from bench.cli.compose import prepare
from bench.errors import BenchError, ConfigError
from bench.findings import Finding
from bench.progress import Progress
from bench.question import Elsewhere, Question
from bench.record.outcomes import Outcome
from bench.run import runner
from bench.run.runner import RunResult
from bench.run.supervisor import Supervisor

if TYPE_CHECKING:
    from bench.cli.campaign.asked import Asked


@dataclass(frozen=True)
class Done:
    """A step as the journal has it. `run` is relative to the campaign's directory; no outcome: it was not run."""

    step: Planned
    outcome: Outcome | None
    run: str = ""
    reason: str = ""
    wall_s: float = 0.0
    adopted: bool = False

    @property
    def passed(self) -> bool:
        """PASS or DONE: the steps that need it may go on."""
        return self.outcome is not None and self.outcome.sound

    def entry(self) -> dict[str, Any]:
        """The journal's line."""
        return {
            "kind": "step", "step": self.step.number, "procedure": self.step.procedure.name,
            "outcome": None if self.outcome is None else self.outcome.value, "run": self.run, "reason": self.reason,
            "wall_s": self.wall_s, "adopted": self.adopted,
        }  # fmt: skip


@dataclass
class StepProgress:
    """One display for all steps: their parts are named, and the steps inside them counted, as one."""

    base: Progress
    title: str

    def stage(self, text: str) -> None:
        self.base.stage(f"{self.title} {text}")

    def total(self, steps: int) -> None:
        """The campaign's total stands."""

    def step(self, text: str) -> None:
        self.base.step(f"{self.title} {text}")

    def line(self, text: str) -> None:
        self.base.line(text)

    def busy(self, text: str) -> AbstractContextManager[None]:
        return self.base.busy(f"{self.title} {text}")

    def asking(self, question: Question) -> AbstractContextManager[Elsewhere | None]:
        return self.base.asking(question)

    def found(self, look: Callable[[], Iterable[Finding]]) -> None:
        self.base.found(look)


def run_chain(asked: Asked, directory: CampaignDirectory, progress: Progress) -> list[Done]:
    """Every step that has not passed yet, in order. The first that does not pass ends it, or with `--go-on` those
    that need it are left out.

    Raises:
        BenchError: nothing could be started in a step; the steps before it are noted.
        SignalAbort: between two steps.
    """
    passed = _passed(asked, directory)
    left = [s for s in asked.steps if s.number not in passed]
    counts = [s.procedure.steps(asked.rig, s.plan) for s in left]
    progress.total(sum(counts) if all(counts) else 0)
    found: list[Done] = []
    with Supervisor().watching() as supervisor:
        for step in asked.steps:
            done = passed.get(step.number)
            if done is None:
                done = _blocked(step, found) or _run(asked, directory, step, supervisor, progress)
                directory.journal.append(done.entry())
            found.append(done)
            if not done.passed and not (asked.request.go_on and done.outcome is not Outcome.ABORTED):
                break
    return found


def _passed(asked: Asked, directory: CampaignDirectory) -> dict[int, Done]:
    steps = {s.number: s for s in asked.steps}
    found = {}
    for e in directory.journal.entries():
        if e["kind"] != "step" or e["outcome"] is None or not (directory.path / e["run"]).is_dir():
            continue
        done = Done(steps[e["step"]], Outcome(e["outcome"]), e["run"], "", e["wall_s"], e["adopted"])
        if done.passed:
            found[e["step"]] = done
    return found


def _blocked(step: Planned, before: Sequence[Done]) -> Done | None:
    """The step left out, if one that it needs did not pass."""
    needed = {need.procedure for need in step.needs}
    bad = [d.step.procedure.name for d in before if not d.passed]
    bad = [name for name in bad if name in needed]
    return Done(step, None, reason=f"left out: needs {', '.join(bad)}, which did not pass") if bad else None


def _run(
    asked: Asked, directory: CampaignDirectory, step: Planned, supervisor: Supervisor, progress: Progress
) -> Done:  # fmt: skip
    began = time.monotonic()
    title = f"[{step.number}/{len(asked.steps)}]"
    try:
        job, connect = prepare(request_of(asked, directory, step), progress.asking)
        report = reporting.build if asked.request.report else None
        result = runner.run(job, directory.runs, connect, supervisor, StepProgress(progress, title), report)
    except ConfigError as error:
        if step.number == 1:
            raise
        return Done(step, Outcome.ERROR, reason=f"refused: {error}")
    done = _noted(directory, step, result, time.monotonic() - began)
    if not done.passed or not step.adopt:
        return done
    try:
        adopt(asked, directory, result.directory)
    except BenchError as error:
        return replace(done, outcome=Outcome.ERROR, reason=f"not adopted: {error}")
    return replace(done, adopted=True)


def _noted(directory: CampaignDirectory, step: Planned, result: RunResult, wall_s: float) -> Done:
    run = Path(result.directory).relative_to(directory.path)
    reason = "" if result.outcome.sound else result.reason
    return Done(step, result.outcome, run.as_posix(), reason, wall_s)


def outcome_of(done: Sequence[Done]) -> Outcome:
    """The strongest of the steps' outcomes."""
    outcomes = {d.outcome for d in done}
    return next((o for o in Outcome if o in outcomes), Outcome.DONE)


def text(done: Sequence[Done]) -> str:
    """The steps as lines."""
    lines = [
        f"  {d.step.number} {d.step.procedure.name:20} {d.outcome.value if d.outcome else 'LEFT OUT':13} {d.reason or d.run}"
        for d in done
    ]
    return "\n".join([*lines, f"outcome {outcome_of(done).value}"]) + "\n"
