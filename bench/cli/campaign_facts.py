"""Where a campaign meets calibrations as facts: what a step needs, what it gives, and how they are handed over."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from bench.calibration import Calibration
from bench.campaign_directory import CampaignDirectory
from bench.cli.adopt import adopt as adopted_run
from bench.cli.campaign_job import RigTask, StepTask
from bench.cli.compose import Request
from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import simulated_run
from bench.findings import Finding
from bench.procedure import Measured

if TYPE_CHECKING:
    from bench.cli.campaign import Asked
    from bench.cli.campaign_steps import Planned


def simulated_step(
    task: RigTask, step: StepTask, seed: int, path: Path, known: Mapping[str, Calibration]
) -> tuple[Mapping[str, float], list[Measured | Finding], Callable[[], Calibration]]:
    """One step on one virtual rig: the truth by `name` or `name@where`, what `analyse` yields, and what makes its
    calibration."""
    done = simulated_run(step.procedure, task.rig, seed, step.plan, path, task.truth, known)
    return {**done.truth, **truth_of_motion(done)}, done.results, done.calibration


def request_of(asked: Asked, directory: CampaignDirectory, step: Planned) -> Request:
    """A step as `bench run` would be asked for it, with the campaign's own calibrations."""
    c, r = asked.campaign, asked.request
    live = c.backend == "live"
    return Request(
        procedure=step.procedure.name, rig=asked.rig.path, backend=c.backend, seed=None if live else c.seed or 0,
        plan=step.assignments, truth=tuple(f"{key}={value!r}" for key, value in c.truth.items()), links=r.links,
        out=directory.runs, operator=r.operator, report=r.report, calibrations=directory.calibrations,
    )  # fmt: skip


def adopt(asked: Asked, directory: CampaignDirectory, run: Path) -> None:
    """Make a run's result a calibration of the campaign's own.

    Raises:
        BenchError: it cannot be adopted.
    """
    adopted_run(run, asked.rig.path, directory.calibrations)
