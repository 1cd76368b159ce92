"""One virtual rig through a run without its directory, record and report: for campaigns over many seeds, and for tests.

The run itself is `bench run`'s: the same opening, the same acquisition under a supervisor, the same analysis.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.calibration import Calibration, Need, settings_differ
from bench.cli import opening
from bench.cli.continuing import switched_on_ns
from bench.cli.loading import load_procedure
from bench.errors import ConfigError
from bench.findings import Finding
from bench.procedure import Measured, Procedure
from bench.progress import Progress, Silent
from bench.recording import Recording
from bench.recording.earlier import Earlier
from bench.rigfile import load_rig
from bench.run.adoption import calibration_of
from bench.run.evaluation import yielded
from bench.run.job import Job
from bench.run.machine_phase import Acquired, acquired
from bench.run.supervisor import Supervisor
from sim_backend.machine import Truth
from sim_backend.truth import draw


@dataclass(frozen=True)
class Knobs:
    """What costs time in a run, as `bench run` has it: see `opening.of_truth` and `recorder.Recorder`."""

    substeps: int = opening.SUBSTEPS
    slice_s: float = opening.SLICE_S
    plain: bool = False


QUICK = Knobs(plain=True)
"""What may be saved without moving a result by a tenth of its standard uncertainty."""


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
        """What `bench adopt` would make of this run; its run id and its date follow from seed and visit, so that a chain of
        such runs gives the same numbers each time. The file's digest is left out."""
        facts = self.procedure.stated(self.recording)
        run_id = f"{self.procedure.name}-sim-{self.seed}" + (f"-{self.drawn.visit}" if self.drawn.visit else "")
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


@dataclass(frozen=True)
class Flown:
    """The machine's part of a run on one virtual rig, its recording closed."""

    job: Job
    drawn: Truth
    machine: Acquired
    path: Path

    def analysed(self) -> Simulated:
        """What the recording says, after what the end of the run says."""
        procedure, seed = self.job.procedure, self.drawn.seed
        recording: Recording[Any] = Recording.open(self.path, procedure.plan)
        found = [*self.machine.ending.findings, *yielded(procedure, recording)]
        return Simulated(procedure, recording, seed, self.drawn, found)


def flown(
    procedure: str,
    rig: str,
    seed: int,
    plan: Mapping[str, Any],
    path: Path,
    truth: Mapping[str, float] | None = None,
    calibrations: Mapping[str, Calibration] | None = None,
    knobs: Knobs = QUICK,
    *,
    visit: int = 0,
    progress: Progress | None = None,
    earlier: Earlier | None = None,
) -> Flown:
    """Draw a rig and take it through the machine's part of a run, or on with what is left of an `earlier` one; what ended that
    early is in it.

    Raises:
        ConfigError: a calibration that is needed is not given, was made at other settings, or rules the plan out.
    """
    chosen, file = load_procedure(procedure), load_rig(rig)
    settings = chosen.plan.model_validate({**chosen.defaults(file)[1], **plan})
    used = given(chosen.needs(settings), calibrations or {})
    chosen.refuse_by(file, settings, used)
    stretch, start_ns = (0, None) if earlier is None else (earlier.stretch, switched_on_ns(earlier))
    drawn = draw(file, seed, truth, chosen.settings(file, settings), visit=visit, stretch=stretch)
    job = Job(chosen.on(file), file, settings, {}, "sim", seed, calibrations=tuple(used), visit=visit, earlier=earlier)
    supervisor = Supervisor()
    connect = opening.of_truth(file, drawn, "auto", substeps=knobs.substeps, slice_s=knobs.slice_s, start_ns=start_ns)
    with connect(supervisor) as live:
        machine = acquired(job, path, live, supervisor, progress or Silent(), plain=knobs.plain)
    return Flown(job, drawn, machine, path)


def simulated_run(
    procedure: str,
    rig: str,
    seed: int,
    plan: Mapping[str, Any],
    path: Path,
    truth: Mapping[str, float] | None = None,
    calibrations: Mapping[str, Calibration] | None = None,
    knobs: Knobs = QUICK,
    *,
    visit: int = 0,
) -> Simulated:
    """As `simulate`; the result can also be adopted. `calibrations` are by procedure; those that are needed are used. What
    ends a run early is raised, after the machine was made safe.

    Raises:
        ConfigError: a calibration that is needed is not given, or was made at other settings.
        BenchError: what ended the run early.
    """
    done = flown(procedure, rig, seed, plan, path, truth, calibrations, knobs, visit=visit)
    if done.machine.cause is not None:
        raise done.machine.cause
    return done.analysed()


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
