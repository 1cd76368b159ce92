"""The two values of the negative stiffness with their influences, from step means, calibrations and certificates."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from bench.recording import Recording
from bench.uncertainty import Estimate, Influence
from procedures.negative_stiffness import fit
from procedures.negative_stiffness.fit import AmbFit, ByAmbs, ByMotor, MotorFit
from procedures.negative_stiffness.plan import Plan
from procedures.negative_stiffness.steps import Displaced
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.servomotor.facts import of_ends
from procedures.shared.certificates import certified, certified_gain, certified_sensors
from procedures.shared.gradients import by_inputs
from procedures.shared.step_table import StepTable
from procedures.shared.type_a import scatter


@dataclass(frozen=True)
class Analysis:
    """Everything the measurements, findings and figures are made of."""

    motor: StepTable[Displaced]
    ambs: StepTable[Displaced]
    by_motor: MotorFit
    by_ambs: AmbFit
    estimates: dict[str, Estimate]


def evaluate(recording: Recording[Plan], motor: StepTable[Displaced], ambs: StepTable[Displaced]) -> Analysis:
    """Both fits with their influences; `estimates` motor, ambs, gap and difference."""
    inputs = fit_inputs(recording)
    one, two = measured(conventions(recording.rig), recording.plan, motor, ambs)

    def model(p: dict[str, float]) -> dict[str, float]:
        fitted = fit.by_ambs(two, p)
        return {"motor": fit.by_motor(one, p).stiffness, "ambs": fitted.stiffness, "gap": fitted.gap_m}

    values = {name: e.value for name, e in inputs.items()}
    by_motor, by_ambs = fit.by_motor(one, values), fit.by_ambs(two, values)
    estimates = by_inputs(model, inputs)
    share = by_motor.stiffness / float(by_motor.fit.terms[0])
    extra = scatter(by_motor.fit, {"motor": [share, 0, 0, 0, 0, 0]}, "motor", "scatter of the steps, motor")
    gradients = {"ambs": [share, 0, *[0] * 6], "gap": [0, -(by_ambs.gap_m**2), *[0] * 6]}
    extra |= scatter(by_ambs.fit, gradients, "ambs", "scatter of the steps, AMBs")
    turned = fit.by_ambs(turning_left_open(two), values)
    for name, shift in (("ambs", turned.stiffness - by_ambs.stiffness), ("gap", turned.gap_m - by_ambs.gap_m)):
        extra[name] = extra[name] + _turning_point(name, shift)
    estimates |= {name: estimates[name] + e for name, e in extra.items()}
    estimates["difference"] = estimates["motor"] - estimates["ambs"]
    return Analysis(motor, ambs, by_motor, by_ambs, estimates)


def measured(
    machine: Servomotor, plan: Plan, motor: StepTable[Displaced], ambs: StepTable[Displaced]
) -> tuple[ByMotor, ByAmbs]:
    """What the estimators get."""
    y, x = machine.positions_of("yi", "yo"), machine.positions_of("xi", "xo")
    which = (ambs.each(lambda step: step.bias_A) != plan.bias_A).astype(np.int64)
    biases, branch = (plan.bias_A, plan.bias_high_A), ambs.each(lambda step: step.branch)
    return (
        ByMotor(motor.stack(machine.segments), motor.stack(y), motor.stack(x), motor.time_s),
        ByAmbs(ambs.stack(machine.coils["yo"]), ambs.stack(y), which, branch, ambs.time_s, biases),
    )


def turning_left_open(d: ByAmbs) -> ByAmbs:
    """The same data with no branch given to the highest level, where up turns into down."""
    return replace(d, branch=np.where(d.y[1] > d.y[1].max() - 1e-6, 0.0, d.branch))


def _turning_point(name: str, shift: float) -> Estimate:
    """The highest level is where up turns into down: it counts as up, and at most half of that could be wrong."""
    influence = Influence(id=f"hysteresis/{name}", name="hysteresis at the turning point", u=abs(shift) / math.sqrt(3),
                          unit="1", kind="B", distribution="rectangular", source="highest level without a branch")  # fmt: skip
    return Estimate.of(0.0, influence) if shift else Estimate.exact(0.0)


def fit_inputs(recording: Recording[Plan]) -> dict[str, Estimate]:
    """What the fits need besides the steps: calibrations, and certificates of the rig file as influences by identity."""
    rig, g = recording.rig, recording.rig.geometry
    amb, motor = recording.calibration("amb-calibration"), recording.calibration("force-constant")
    known = of_ends(rig, amb.values)
    inputs = {
        "alpha_d": motor.values["alpha_d@0"],
        "chi": motor.values["alpha_dx"] / motor.values["alpha_d"],
        "K_o": known["K_o@0"],
        "K2_o": known["K2_o@0"],
        "bias_K": Estimate.exact(amb.settings["bias_A"]),
    }
    for key, name in (("l_is", "com_to_inboard_sensor"), ("l_os", "com_to_outboard_sensor"), ("z_oa", "com_to_outboard_amb"),
                      ("motor_to_outboard", "motor_to_outboard_amb"), ("amb_span", "amb_span")):  # fmt: skip
        inputs[key] = certified(f"geometry/{name}", g[name])
    inputs["amb_gap"] = Estimate.exact(g["amb_gap"].value)  # where the iteration starts, and nothing else
    machine = conventions(rig)
    for axis, channel in machine.positions.items():
        inputs[f"gain_{axis}"] = certified_gain(rig, channel)
    sensors = {f"m{k}": segment for k, segment in enumerate(machine.segments, 1)}
    sensors |= dict(zip(("op", "on"), machine.coils["yo"], strict=True))
    return inputs | certified_sensors(rig, sensors)
