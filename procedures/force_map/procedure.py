"""Force map on the rig: which terms of the static force-torque model the machine shows (thesis 5.3 and (5.25) with beta_4).

Measurands: the constants of the vertical rows of (5.25) at the rotor angles of the AMBs' calibration, rotor at rest. The motor
plane is moved by the AMBs' references, its currents i_x and i_y are open loop; the current i_theta appears only against a
torque, so a mass hangs from the lever for the terms that need it. `bench map` does the same to a table, without a rig.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from bench.calibration import Need
from bench.figures import Figure
from bench.findings import Effect, Finding, Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import NOTHING, Load, RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from procedures.force_map import estimates, steps
from procedures.force_map.estimates import Result
from procedures.force_map.fit import ABOUT, CROSS, UNITS
from procedures.force_map.plan import Plan
from procedures.force_map.requires import requires
from procedures.force_map.steps import AtPoint, MapData, read_points
from procedures.servomotor import carrying, hold, segments, wiring
from procedures.servomotor.conventions import conventions
from procedures.servomotor.facts import of_ends
from procedures.servomotor.parameters import BIASES, named, write
from procedures.shared import assumptions
from procedures.shared.step_table import record_step

CALIBRATION = "amb-calibration"
SHOWN = ("alpha_1", "alpha_2", "alpha_3", "alpha_4", "alpha_5", "alpha_6", "alpha_8", "alpha_9")
MEASURES = (
    *(Quantity(name, UNITS[name], ABOUT[name]) for name in SHOWN),
    Quantity(CROSS, "N/A", "vertical force of i_x, mean over an electrical period: the zero of the commutation"),
)
K_N_A, STIFFNESS_N_M = 74.4, 242.6e3  # T (6.12) and Table 6.2; for predictions before a run
LEAST_TORQUE_A = 0.2
EXCHANGED = 0.3  # cross over direct force; half a degree of encoder zero makes 8 %


@dataclass(frozen=True)
class Point:
    """One operating point, as commanded: currents A, references of the outboard AMB m."""

    i_y: float = 0.0
    i_x: float = 0.0
    y: float = 0.0
    x: float = 0.0


def points(plan: Plan) -> list[Point]:
    """At every angle without a load: each alone, and the pairs that the products in (5.25) need; mirrored by sign."""
    i, d = plan.current_A, plan.offset_m
    half = [Point(i_y=i), Point(i_x=i), Point(y=d), Point(x=d), Point(i_x=i, y=d), Point(i_y=i, x=d)]
    return [Point(), *half, Point(), *(Point(-p.i_y, -p.i_x, -p.y, -p.x) for p in half), Point()]


def loaded_points(plan: Plan) -> list[Point]:
    """With torque current, at the home angle."""
    i, d = plan.loaded_current_A, plan.loaded_offset_m
    half = [Point(i_y=i), Point(i_x=i), Point(y=d), Point(x=d)]
    return [Point(), *half, *(Point(-p.i_y, -p.i_x, -p.y, -p.x) for p in half), Point()]


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """Lifted at the calibration's bias with the angle released: no loop closes before the encoder's direction is known."""
    return named(rig, {**dict.fromkeys(BIASES, plan.bias_A), "motor.ramp": plan.ramp_A_s, **hold.RELEASED})


def needs(plan: Plan) -> tuple[Need, ...]:
    """The AMBs' calibration at this bias and at these angles."""
    return (Need(CALIBRATION, {"bias_A": plan.bias_A, "angles": float(plan.angles)}),)


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records, for the progress display."""
    return wiring.STEPS + plan.angles * len(points(plan)) + 2 * len(loaded_points(plan))


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Every point at every angle, then those with a mass on either end of the lever at home."""
    if not wiring.sound(rig, record):
        return
    for turn in range(plan.angles):
        rig.rotation.point(2 * math.pi * turn / plan.angles)
        _visit(rig, plan, record, points(plan), turn, "", NOTHING)
    rig.rotation.point(0.0)
    sides: tuple[Literal["left", "right"], ...] = ("left", "right")
    for side in sides:
        load = rig.operator.lever(side, Load(plan.mass))
        rig.clock.sleep(2 * plan.settle_s)
        _visit(rig, plan, record, loaded_points(plan), 0, side, load)
        rig.operator.lever(side, NOTHING)
        rig.clock.sleep(2 * plan.settle_s)


def _visit(rig: Rig, plan: Plan, record: Recorder, visited: list[Point], turn: int, side: str, load: Load) -> None:
    now = Point()
    for point in visited:
        write(rig, {"motor.along": point.i_y, "motor.across": point.i_x, "at.yo": point.y, "at.xo": point.x})
        rig.clock.sleep(max(abs(point.i_y - now.i_y), abs(point.i_x - now.i_x)) / plan.ramp_A_s + plan.settle_s)
        now = point
        labels = AtPoint(turn, side, load.label, point.i_y, point.i_x, point.y, point.x)
        with record_step(record, labels):
            rig.clock.sleep(plan.average_s)


def evaluate(recording: Recording[Plan], findings: Findings) -> tuple[MapData, Result]:
    """Points and terms."""
    findings.gate(segments.before_carrying(recording))
    plan, rig, data = recording.plan, recording.rig, read_points(recording)
    machine = conventions(rig)
    findings.gate(steps.of_signals(data, machine, plan), ("stuck-channel",))
    inputs = estimates.inputs_of(rig, of_ends(rig, recording.calibration(CALIBRATION).values), plan.angles)
    poles = 2 * round(rig.machine["pole_pairs"].value)
    result = estimates.evaluate(data, machine, inputs, plan.bias_A, plan.angles, poles)
    findings.add(steps.drifts(data, result.force, result.points.i_theta))
    findings.add([*_contradictions(result, plan), *_notes(result)])
    return data, result


def measured(found: tuple[MapData, Result]) -> Iterator[Measured]:
    """Every constant that the points can tell."""
    _, result = found
    for quantity in MEASURES:
        if quantity.name in result.estimates:
            yield quantity.measured(result.estimates[quantity.name])


def _contradictions(result: Result, plan: Plan) -> Iterator[Finding]:
    direct, pull = result.estimates["alpha_1"].value, result.estimates["alpha_5"].value
    cross = result.estimates[CROSS].value
    if direct < 0 and pull < 0:
        text = (f"i_y gives {direct:+.2f} N/A and the magnets {pull / 1e3:+.0f} N/mm, both the wrong way round: the inboard "
                "AMB's constants of the calibration have the wrong sign.")  # fmt: skip
        yield Finding("wrong-sign", text, "K_i", Effect.ERROR)
    elif direct < 0 or abs(cross) > EXCHANGED * abs(direct):
        text = f"i_y gives {direct:+.2f} N/A vertically and i_x {cross:+.2f} N/A: segments look exchanged."
        yield Finding("segments-exchanged", text, "alpha_1", Effect.ERROR)
    elif pull < 0:
        text = f"off centre the motor pushes back ({pull / 1e3:+.0f} N/mm) where magnets pull: a sign of the position sensors?"
        yield Finding("wrong-sign", text, "alpha_5", Effect.ERROR)
    rms = float(np.sqrt((result.residuals**2).mean()))
    if rms > plan.max_residual_N:
        text = (f"the model leaves {rms:.2f} N rms ({plan.max_residual_N:g} N allowed): the calibration is of another angle or "
                "rotor, or a point was disturbed.")  # fmt: skip
        yield Finding("misfit", text, "", Effect.INDETERMINATE)
    if np.ptp(result.points.i_theta) < LEAST_TORQUE_A:
        text = "the load on the lever made no torque current: was it hung, and does the lever hold?"
        yield Finding("no-torque-current", text, "i_theta", Effect.ERROR)


def _notes(result: Result) -> Iterator[Finding]:
    if "alpha_7" in result.told.unidentifiable:
        text = ("force term 7 needs torque current where sin(P θ) is not zero, and the lever is level at home only. Torque "
                "terms are not mapped: Coulomb friction hides them (beta_1 is torque-constant's).")  # fmt: skip
        yield Finding("term-not-identified", text, "alpha_7")
    chosen = result.selection.chosen
    if chosen is not None:
        left = ", ".join(n for n in result.terms if n not in chosen.terms) or "none"
        text = f"predicting points left out needs {', '.join(chosen.terms)}; not needed: {left}."
        yield Finding("terms-selected", text)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    if plan.mass not in rig.masses:
        yield f"mass: found {plan.mass}; the rig file certifies {', '.join(rig.masses)}"
    g = rig.geometry
    out = 1 + g["motor_to_outboard_amb"].value / g["amb_span"].value
    for i, d in ((plan.current_A, plan.offset_m), (plan.loaded_current_A, plan.loaded_offset_m)):
        push = carrying.newtons_per_A(rig) * i + STIFFNESS_N_M * d * out
        control = (carrying.weight_N(rig) + push * out) / K_N_A + plan.bias_A * d / g["amb_gap"].value
        if control > 0.95 * plan.bias_A:
            yield (f"current_A, offset_m: {i:g} A at {d * 1e6:g} um takes {control:.2f} A of control current in the outboard "
                   f"AMB by prediction; the bias of {plan.bias_A:g} A allows {0.95 * plan.bias_A:.2f} A")  # fmt: skip
    reach = max(plan.offset_m, plan.loaded_offset_m) * out
    if reach > rig.envelope.max_levitated_position_m:
        yield f"offset_m: the motor would be {reach * 1e6:.0f} um off centre; the envelope allows less"


def figures(found: tuple[MapData, Result], recording: Recording[Plan]) -> Iterable[Figure]:
    """The greatest terms, residuals and selection."""
    from procedures.force_map import figures as force_map_figures

    del recording
    return force_map_figures.rig_figures(*found)


procedure = Procedure(
    name="force-map",
    title="Force map of the motor by displacement, currents and load",
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
    assumes=assumptions.FORCE_MAP,
    method=read_method(__file__),
    needs=needs,
)
