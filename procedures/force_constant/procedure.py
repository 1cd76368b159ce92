"""The motor's direct force constant, with the calibrated AMBs as load cells (thesis 6.6.2; 6.14a with the corrected sign).

Measurand: change of the motor's force along an axis with that axis' current, as commutated at gamma = 0, mean over a full
turn, rotor at rest at the sensors' zero: alpha_d vertically (dF_y/di_y) and alpha_dx horizontally (dF_x/di_x). The AMBs'
forces come from the calibration's F(i) at the same rotor angles. The horizontal one rests on K_x = K_y within a stated
asymmetry.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from bench.calibration import Need
from bench.figures import Figure
from bench.findings import Effect, Finding, Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.uncertainty import Estimate
from procedures.force_constant import first_angle, load_at_rest
from procedures.force_constant.first_angle import CALIBRATION
from procedures.force_constant.fitting import check
from procedures.force_constant.plan import Plan
from procedures.force_constant.requires import channels, requires
from procedures.force_constant.steps import AtLevel, RampData, read_ramps
from procedures.servomotor.conventions import conventions
from procedures.servomotor.facts import of_ends
from procedures.servomotor.parameters import BIASES, CURRENTS, named, write
from procedures.shared import assumptions, first_look
from procedures.shared.step_table import record_step

if TYPE_CHECKING:
    from procedures.force_constant.estimates import AxisResult

Array = npt.NDArray[np.float64]

ALPHA_D = Quantity("alpha_d", "N/A", "motor: dF_y/di_y at gamma = 0, mean over a turn")
ALPHA_DX = Quantity("alpha_dx", "N/A", "motor: dF_x/di_x at gamma = 0, mean over a turn, with K_x = K_y of the AMBs")
MEASURES = (ALPHA_D, ALPHA_DX)


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """Controller parameters that the runner writes before levitation."""
    return named(rig, {**dict.fromkeys(BIASES, plan.bias_A), "motor.ramp": plan.ramp_A_s})


def needs(plan: Plan) -> tuple[Need, ...]:
    """The AMBs' calibration at this bias and at these angles."""
    return (Need(CALIBRATION, {"bias_A": plan.bias_A, "angles": float(plan.angles)}),)


@dataclass(frozen=True)
class Level:
    """Both currents of a step in A, and whether each was reached by raising it (+1) or lowering it (-1)."""

    i_y: float
    i_x: float
    branch_y: int
    branch_x: int


def sequence(plan: Plan) -> list[Level]:
    """The levels at one angle: i_y from its least to its greatest and back, i_x a quarter of that period ahead.

    i_y is mirrored in time, so that linear drift does not touch it, and i_x goes through all its levels between, so that
    the two are orthogonal and one sequence gives both.
    """
    up = list(plan.levels_A)
    triangle = up + up[-2:0:-1]
    period, lead = len(triangle), (len(up) - 1) // 2

    def step(k: int) -> tuple[float, int]:
        now, before = triangle[k % period], triangle[(k - 1) % period]
        return now, 1 if now > before else -1

    return [Level(y, x, by, bx) for k in range(period + 1) for (y, by), (x, bx) in [(step(k), step(k + lead))]]


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records, for the progress display."""
    return plan.angles * len(sequence(plan))


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Ramp both currents through their levels at each angle; between the angles the motor gives no force."""
    now = {"i_x": 0.0, "i_y": 0.0}

    def ramp(**currents: float) -> None:
        way = max(abs(value - now[name]) for name, value in currents.items())
        write(rig, {CURRENTS[name]: value for name, value in currents.items()})
        now.update(currents)
        rig.clock.sleep(way / plan.ramp_A_s)

    for turn in range(plan.angles):
        angle = 2 * math.pi * turn / plan.angles
        rig.rotation.point(angle)
        seen: list[tuple[AtLevel, dict[str, Array], int]] = []
        for level in sequence(plan):
            ramp(i_y=level.i_y, i_x=level.i_x)
            rig.clock.sleep(plan.settle_s)
            labels = AtLevel(angle, level.i_y, level.i_x, level.branch_y, level.branch_x)
            with record_step(record, labels):
                read = first_look.samples(rig, record, channels(conventions(rig.file)), plan.average_s)
            seen.append((labels, read, rig.clock.now_ns()))
        ramp(i_y=0.0, i_x=0.0)
        if turn == 0 and not first_angle.passes(rig, plan, record, seen):
            return


@dataclass(frozen=True)
class Analysis:
    """Everything the measurements, findings and figures are made of. `alone`: the vertical result as if the calibration
    had passed on nothing but values and uncertainties."""

    data: RampData
    inputs: Mapping[str, Estimate]
    y: AxisResult
    x: AxisResult
    alone: AxisResult


def evaluate(recording: Recording[Plan], findings: Findings) -> Analysis:
    """Both axes with their influences."""
    from procedures.force_constant import checks, estimates

    plan, rig, data = recording.plan, recording.rig, read_ramps(recording)
    facts = of_ends(rig, recording.calibration(CALIBRATION).values)
    first_look.gate(recording, findings, first_angle.judge(data, rig, facts, plan))
    signals = list(checks.of_signals(data, conventions(rig), plan))
    findings.gate(signals, checks.FATAL)
    count = len(data.vertical.angles)
    shared = estimates.fact_inputs(facts, count)
    y_inputs = {**estimates.rig_inputs(rig, "y"), **shared}
    x_inputs = {**estimates.rig_inputs(rig, "x"), **shared}
    y = estimates.axis_result(data.vertical, y_inputs, plan.bias_A)
    x = estimates.axis_result(data.horizontal, x_inputs, plan.bias_A)
    unshared = {**y_inputs, **estimates.taken_alone(facts, count)}
    a = Analysis(data, y_inputs, y, x, estimates.axis_result(data.vertical, unshared, plan.bias_A))
    if not any(f.code == "unsettled" for f in signals):  # or the fit would be blamed for what moves
        findings.add(contradictions(recording, a))
    findings.add([*_ripple(rig, plan), *_notes(rig, a)])
    return a


def measured(a: Analysis) -> Iterator[Measured]:
    """Both constants."""
    yield ALPHA_D.measured(a.y.mean)
    yield ALPHA_DX.measured(a.x.mean)


def contradictions(recording: Recording[Plan], a: Analysis) -> Iterator[Finding]:
    """Checks of the fits: the load at rest, wires, rows, levels, drift, axes."""
    from procedures.force_constant import checks

    plan, known = recording.plan, of_ends(recording.rig, recording.calibration(CALIBRATION).values)
    rest = load_at_rest.compared(a.data.vertical, a.inputs, known, recording.rig, a.y.weight, plan.bias_A)
    yield from checks.load_moved(rest, 2 * a.y.mean.u)
    vertical: list[Finding] = []
    for axis, result in (("y", a.y), ("x", a.x)):
        wrong = list(checks.exchanged(axis, result.fit.terms)) or list(_fits(axis, result, a, plan))
        drift = list(checks.wander(axis, *_drift(result), a.data, plan))
        yield from drift
        if axis == "y" or not vertical:  # the horizontal constants rest on the vertical ones
            yield from wrong
        vertical = vertical or wrong
    yield from checks.axes_disagree(a.y.mean, a.x.mean)


def _fits(axis: str, result: AxisResult, a: Analysis, plan: Plan) -> Iterator[Finding]:
    from procedures.force_constant import checks, estimates, fit

    parts, dof = estimates.differences(result), fit.scatter(result.fit)[1]
    hint = estimates.suspect(a.data.vertical, a.inputs, plan.bias_A, result) if axis == "y" else ""
    mean, rows = estimates.mean_of(parts), tuple(e.value for e in result.row_means)
    apart = checks.beyond(estimates.chi_squared(parts), len(parts), dof)
    yield from checks.rows_disagree(axis, (rows[0], rows[1]), mean.value / mean.u, apart, hint)
    bent = checks.beyond(estimates.chi_squared(result.bends), len(result.bends), dof)
    yield from checks.lack_of_fit(axis, bent, max(abs(e.value) for e in result.bends), hint)


def _drift(result: AxisResult) -> tuple[Array, Array]:
    """Drift of both rows in N/s, mean over the angles, with its standard uncertainty."""
    from procedures.force_constant import fit
    from procedures.force_constant.fit import TIME

    steps, _ = fit.scatter(result.fit)
    spread = np.sqrt((result.fit.solvers[:, TIME] ** 2).sum()) / len(result.fit.solvers)
    return result.fit.terms[:, :, TIME].mean(axis=1), np.sqrt(np.diag(steps)) * spread


def _ripple(rig: RigFile, plan: Plan) -> Iterator[Finding]:
    from procedures.force_constant import fit

    pairs = round(rig.machine["pole_pairs"].value)
    if fit.aliased(plan.angles, pairs):
        yield Finding(
            "ripple-unresolved",
            f"{plan.angles} equally spaced angles all stand at one electrical phase of the force ripple (order {2 * pairs}): "
            "what was measured is alpha_d at that phase, not its mean over a turn, and no data of this run says how far "
            "apart they are. Calibrate and measure at nine angles.",
            "alpha_d", Effect.INDETERMINATE,
        )  # fmt: skip


def _notes(rig: RigFile, a: Analysis) -> Iterator[Finding]:
    with_, without = a.y.mean, a.alone.mean
    yield Finding(
        "shared-influences",
        f"u(alpha_d) is {with_.u:.4f} N/A ({with_.u / with_.value:.3%}); had the calibration passed on its values and "
        f"uncertainties alone, it would be {without.u:.4f} N/A ({without.u / without.value:.3%}). What both runs share "
        "(current sensors, spans, masses, gravity) largely cancels.",
        "alpha_d",
    )
    stated = rig.machine["amb_asymmetry"]
    yield Finding(
        "horizontal-assumed",
        f"the AMBs' horizontal constants were not measured: K_x = K_y, with {stated.standard_uncertainty:.2%} of standard "
        f"uncertainty for each AMB ({stated.source}).",
        "alpha_dx",
    )


def facts(a: Analysis) -> dict[str, Estimate]:
    """What later procedures use: both constants, the vertical one at each angle, and at home (0) the force across."""
    found = {"alpha_d": a.y.mean, "alpha_dx": a.x.mean, "alpha_cross@0": a.y.cross}
    found |= {f"alpha_d@{k}": e for k, e in enumerate(a.y.angles)}
    return {name: replace(e, unit=ALPHA_D.unit) for name, e in found.items()}


def figures(a: Analysis, recording: Recording[Plan]) -> Iterable[Figure]:
    """Forces, residuals, constants over the angle, and the budgets."""
    from procedures.force_constant import figures as drawn

    del recording
    return drawn.all_figures(a.data, a.y, a.x, a.alone)


procedure = Procedure(
    name="force-constant",
    title="Direct force constant of the motor, by the AMBs as load cells",
    measures=MEASURES,
    state=RigState.LEVITATED,
    plan=Plan,
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    settings=settings,
    step_count=step_count,
    assumes=assumptions.FORCE_CONSTANT,
    method=read_method(__file__),
    needs=needs,
    facts=facts,
)
