"""Runs of decoupling from rows of the plant, without a bench: what telemetry would have of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from bench.rigfile import RigFile, load_rig
from bench.rigfile.stage import axes_of
from procedures.decoupling.estimates import Result, results
from procedures.decoupling.plan import Plan
from procedures.decoupling.steps import FAST, SLOW, Axis, Run
from procedures.stages.pairs import Pair, pairs
from sim_backend.machines.rlsrm.params import ControlParams, PlantParams
from sim_backend.machines.rlsrm.plant import AXES, TRACE, Plant
from sim_backend.machines.rlsrm.truth_decoupling import crossed
from sim_backend.stage_motion import DecouplingAsked

RIG: RigFile = load_rig("rlsrm")
PLAN = Plan()
GIVEN = ControlParams()
"""Sines are given, not sent, as while waves play."""
TELEMETRY_S = 1e-3
FORCES = ("force", "torque")


def _axis(rows: np.ndarray, k: int) -> Axis:
    names = (AXES[k], f"ref_{AXES[k]}", f"asked_{FORCES[k]}")
    return Axis(*(rows[:, TRACE.index(n)] for n in names))


def run(params: PlantParams, pair: Pair, turns: float, plan: Plan = PLAN, control: ControlParams = GIVEN) -> Run:
    """One step: loops closed at zero, waves, the first period left out."""
    m, h = AXES.index(pair.moved.name), AXES.index(pair.held.name)
    kind, size, period = [0.0, 0.0], [0.0, 0.0], [1.0, 1.0]
    kind[m], size[m], period[m] = 1.0, (plan.amplitude_m, plan.amplitude_rad)[m], plan.period_s
    if turns:
        kind[h], size[h], period[h] = 1.0, (plan.nudge_m, plan.nudge_rad)[h], plan.period_s / turns
    plant = Plant(params, replace(control, wave=tuple(kind), amplitude=tuple(size), period=tuple(period)))  # type: ignore[arg-type]
    plant.switch(on=True, x=True, angle=True)
    plant.run(plan.period_s, 0)
    rows = plant.run((plan.nudges if turns else plan.periods) * plan.period_s)
    t = np.arange(len(rows)) * TELEMETRY_S
    return Run(pair, turns, t, _axis(rows, m), _axis(rows, h), control.kp[h], ("MOVING",), 0, len(rows))


def analysed(params: PlantParams, plan: Plan = PLAN, control: ControlParams = GIVEN) -> list[Result]:
    """Every pair of a machine."""
    runs = [run(params, p, turns, plan, control) for p in pairs(RIG, plan.moved) for turns in (0.0, SLOW, FAST)]
    return results(runs, RIG, plan, TELEMETRY_S)


def truth(params: PlantParams, pair: Pair, plan: Plan = PLAN, control: ControlParams = GIVEN) -> Mapping[str, float]:
    size = plan.amplitude_m if pair.moved.unit == "m" else plan.amplitude_rad
    asked = DecouplingAsked(
        {}, pair.moved.name, pair.held.name, size, plan.period_s, plan.periods, plan.sliding, plan.smooth_hz
    )
    return crossed(params, control, asked)


def held(name: str) -> Pair:
    axes = axes_of(RIG)
    return next(p for p in pairs(RIG, "all") if p.held is axes[name] or p.held.name == name)
