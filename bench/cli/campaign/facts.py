"""Where a campaign meets calibrations as facts: what a step needs, what it gives, and how they are handed over."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from bench.calibration import Calibration
from bench.campaign.directory import CampaignDirectory
from bench.cli.adopt import adopt as adopted_run
from bench.cli.campaign.tasks import RigTask, StepTask
from bench.cli.compose import Request
from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import flown
from bench.errors import BenchError, RecordingError, Unfit
from bench.findings import Finding
from bench.procedure import Measured

if TYPE_CHECKING:
    from bench.cli.campaign.asked import Asked
    from bench.cli.campaign.steps import Planned


NAMED_FAULTS = ("controller-fault", "drive-fault", "bearing-too-weak", "lift-lost")
"""Findings that say what is the matter with a machine that cannot do a run."""


@dataclass(frozen=True)
class StepResult:
    """One step on one virtual rig: the truth by `name` or `name@where`, what its end and its analysis yield, and what makes
    its calibration; `cannot` says why this machine cannot do it."""

    truth: Mapping[str, float]
    results: Sequence[Measured | Finding]
    calibration: Callable[[], Calibration] | None = None
    cannot: str = ""


def simulated_step(
    task: RigTask, step: StepTask, seed: int, path: Path, known: Mapping[str, Calibration]
) -> StepResult:  # fmt: skip
    """A step as `bench run` does it.

    Raises:
        AnalysisError: the data do not allow the numbers.
    """
    try:
        done = flown(step.procedure, task.rig, seed, step.plan, path, task.truth, known, visit=task.visit)
    except Unfit as error:  # a drawn machine that the campaign's plan is none for, as its own facts say
        return StepResult({}, [], cannot=error.why[0])
    cause = done.machine.cause
    if cause is not None and not isinstance(cause, BenchError):
        raise cause
    if cause is not None:
        found = list(done.machine.ending.findings)
        grounded = not done.machine.brought_up and not isinstance(cause, RecordingError)
        return StepResult({}, found, cannot=_named(found) or (str(cause) if grounded else ""))
    result = done.analysed()
    cannot = _named([r for r in result.results if isinstance(r, Finding)])
    return StepResult({**result.truth, **truth_of_motion(result)}, result.results, result.calibration, cannot)


def _named(findings: Sequence[Finding]) -> str:
    return next((f.text for f in findings if f.code in NAMED_FAULTS), "")


def request_of(asked: Asked, directory: CampaignDirectory, step: Planned) -> Request:
    """A step as `bench run` would be asked for it, with the campaign's own calibrations."""
    c, r = asked.campaign, asked.request
    live = c.backend == "live"
    return Request(
        procedure=step.procedure.name, rig=asked.rig.path, backend=c.backend, seed=None if live else c.seed or 0,
        visit=None if live else c.visit or 0, plan=step.assignments,
        truth=tuple(f"{key}={value!r}" for key, value in c.truth.items()), links=r.links,
        out=directory.runs, operator=r.operator, report=r.report, calibrations=directory.calibrations,
    )  # fmt: skip


def adopt(asked: Asked, directory: CampaignDirectory, run: Path) -> None:
    """Make a run's result a calibration of the campaign's own.

    Raises:
        BenchError: it cannot be adopted.
    """
    adopted_run(run, asked.rig.path, directory.calibrations)
