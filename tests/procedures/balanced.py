"""A virtual rig balanced, what came of it, and what was really on its shaft."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench.calibration import Calibration
from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.recording import Recording
from bench.rigfile import load_rig
from bench.uncertainty import Estimate
from procedures.balance.estimates import Result
from procedures.balance.steps import Run
from sim_backend.machines.amb5dof import truth_balance
from sim_backend.truth import draw

RPM = math.pi / 30
SHORT = {"slow_s": 4.2, "dwell_s": 0.5, "capture_s": 0.3, "settle_s": 0.8}
ONE = {**SHORT, "speeds_rad_s": (10000 * RPM,), "repeat": False}
HEAVY = {"unbalance_i": 8e-6, "unbalance_o": 8e-6, "unbalance_phase_i": 0.0, "unbalance_phase_o": 0.0}
SEED = 1
RIG = load_rig("amb5dof")


@dataclass(frozen=True)
class Balancing:
    measured: dict[tuple[str, str], Estimate]
    findings: list[Finding]
    recording: Recording[Any]
    found: Result
    true: list[np.ndarray]
    truth: Mapping[str, float]

    @property
    def serious(self) -> set[str]:
        return {f.code for f in self.findings if f.effect is not Effect.NOTE}


def done(
    folder: Path,
    plan: Mapping[str, Any],
    truth: Mapping[str, float] | None = None,
    seed: int = SEED,
    rig: str = "amb5dof",
    known: Mapping[str, Calibration] | None = None,
) -> Balancing:
    """Balance a virtual rig; what was really on the shaft, at first and after each of the operator's events, beside it."""
    run = simulated_run("balance", rig, seed, plan, folder / "recording.mcap", truth, known)
    measured = {(m.quantity.name, m.where): m.estimate for m in run.results if isinstance(m, Measured)}
    findings = [f for f in run.results if isinstance(f, Finding)]
    file = load_rig(rig)
    true = truth_balance.left(file, draw(file, seed, truth), run.recording.events("operator"))
    return Balancing(
        measured, findings, run.recording, run.procedure.evaluated(run.recording).result, true, truth_of_motion(run)
    )


def runs_of(b: Balancing) -> dict[str, Run]:
    assert b.found.recorded is not None
    return {r.name: r for r in b.found.recorded.runs}
