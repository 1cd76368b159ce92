"""One virtual rig through a run without its directory, record and report: for campaigns over many seeds, and for tests.

The run itself is `bench run`'s: the same opening, the same acquisition under a supervisor, the same analysis.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.acquisition import acquired
from bench.adoption import calibration_of
from bench.calibration import Calibration, Need, facts_of, settings_differ
from bench.cli import opening
from bench.cli.compose import load_procedure
from bench.errors import ConfigError
from bench.evaluation import yielded
from bench.findings import Finding
from bench.opened import Job
from bench.procedure import Measured, Procedure
from bench.progress import Silent
from bench.recording import Recording
from bench.rigfile import load_rig
from bench.supervisor import Supervisor
from sim_backend.truth import Truth, draw


@dataclass(frozen=True)
class Simulated:
    """One finished run on one virtual rig: what was drawn, and what its end and its analysis yield."""

    procedure: Procedure
    recording: Recording[Any]
    seed: int
    drawn: Truth
    results: list[Measured | Finding]

    @property
    def truth(self) -> Mapping[str, float]:
        """The true quantities."""
        return self.drawn.quantities

    def calibration(self) -> Calibration:
        """What `bench adopt` would make of this run; its run id and its date follow from the seed, so that a chain of
        such runs gives the same numbers each time. The file's digest is left out."""
        facts = facts_of(self.procedure, self.recording, self.results)
        run_id = f"{self.procedure.name}-sim-{self.seed}"
        return calibration_of(self.procedure, self.recording, facts, run_id=run_id)


def simulate(
    procedure: str,
    rig: str,
    seed: int,
    plan: Mapping[str, Any],
    path: Path,
    truth: Mapping[str, float] | None = None,
    calibrations: Mapping[str, Calibration] | None = None,
) -> tuple[Mapping[str, float], list[Measured | Finding]]:
    """Draw a rig, run a procedure on it into `path`, analyse the closed file.

    Returns:
        The true quantities, and what `analyse` yields.
    """
    done = simulated_run(procedure, rig, seed, plan, path, truth, calibrations)
    return done.truth, done.results


def simulated_run(
    procedure: str,
    rig: str,
    seed: int,
    plan: Mapping[str, Any],
    path: Path,
    truth: Mapping[str, float] | None = None,
    calibrations: Mapping[str, Calibration] | None = None,
    *,
    substeps: int = opening.SUBSTEPS,
    slice_s: float = opening.SLICE_S,
    plain: bool = True,
) -> Simulated:
    """As `simulate`; the result can also be adopted. `calibrations` are by procedure; those that are needed are used. What
    ends a run early is raised, after the machine was made safe.

    Args:
        substeps, slice_s, plain: what costs time; see `bench.cli.opening.of_truth` and `bench.recorder.Recorder`.

    Raises:
        ConfigError: a calibration that is needed is not given, or was made at other settings.
        BenchError: what ended the run early.
    """
    chosen = load_procedure(procedure)
    file = load_rig(rig)
    settings = chosen.plan.model_validate({**file.plans.get(procedure, {}), **plan})
    used = given(chosen.needs(settings), calibrations or {})
    drawn = draw(file, seed, truth, chosen.settings(settings))
    job = Job(chosen, file, settings, {}, "sim", seed, calibrations=tuple(used))
    supervisor = Supervisor()
    with opening.of_truth(file, drawn, "auto", substeps=substeps, slice_s=slice_s)(supervisor) as live:
        machine = acquired(job, path, live, supervisor, Silent(), plain=plain)
    if machine.cause is not None:
        raise machine.cause
    recording: Recording[Any] = Recording.open(path, chosen.plan)
    return Simulated(chosen, recording, seed, drawn, [*machine.ending.findings, *yielded(chosen, recording)])


def given(needs: Sequence[Need], calibrations: Mapping[str, Calibration]) -> list[Calibration]:
    """The calibrations that a run needs, out of those at hand.

    Raises:
        ConfigError: one is missing, or was made at other settings.
    """
    for need in needs:
        if need.procedure not in calibrations:
            if need.optional:
                continue
            raise ConfigError(f"calibrations: found no {need.procedure}; expected one among `calibrations`")
        differ = settings_differ(calibrations[need.procedure].settings, need.settings)
        if differ:
            raise ConfigError(f"calibration {need.procedure}: {'; '.join(differ)}")
    return [calibrations[need.procedure] for need in needs if need.procedure in calibrations]
