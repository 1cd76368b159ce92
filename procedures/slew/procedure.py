"""Slewing: the rotor's angle follows a slow sine at several frequencies (thesis 8.2.2, Fig. 8.1).

Measurands: rms and peak of the tracking error, amplitude ratio and lag at each frequency, and the detent, the part of the
torque that goes with 16 times the angle, from the torque current at the slowest one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from bench.calibration import Need
from bench.figures import Figure
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from procedures.servomotor import carrying, hold, segments, wiring
from procedures.servomotor.parameters import named, stated, write
from procedures.shared import assumptions
from procedures.slew import fit, steps
from procedures.slew.fit import Gains
from procedures.slew.plan import Plan
from procedures.slew.requires import requires
from procedures.slew.steps import STARTED, STEP, read_swings

if TYPE_CHECKING:
    from procedures.slew.estimates import Result

RMS = Quantity("error_rms", "rad", "root mean square of the tracking error, free of the encoder's counts")
PEAK = Quantity("error_peak", "rad", "greatest tracking error")
RATIO = Quantity("amplitude_ratio", "1", "amplitude of the angle over that of the reference")
LAG = Quantity("lag", "s", "how much later than the reference the angle swings")
DETENT = Quantity("detent", "N m", "amplitude of the torque that goes with 16 times the angle")
FRICTION = Quantity("friction", "N m", "torque against the movement at the slowest frequency, mean over the swing")
MEASURES = (RMS, PEAK, RATIO, LAG, DETENT, FRICTION)
FADE = 20
DESIGN_NM_A = 2.87  # T Table 6.2; with a tenth of it either way where no calibration is used


def settings(rig: RigFile, _: Plan) -> dict[str, float]:
    """Lifted with the angle released: no loop is closed before the encoder's direction is known."""
    return named(rig, hold.RELEASED)


def needs(plan: Plan) -> tuple[Need, ...]:
    """The torque constant, where the plan asks for its calibration."""
    return (Need("torque-constant", facts=("alpha_tau",)),) if plan.torque_constant == "calibration" else ()


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records, for the progress display."""
    return wiring.STEPS + len(plan.frequencies_hz)


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Swing at each frequency, the slowest first; the reference rests in between, and moves by parts of an encoder count from
    period to period: else the counts would do the same in every one, and their scatter would tell nothing."""
    if not wiring.sound(rig, record):
        return
    write(rig, {"angle.derivative_on_error": 1.0, "angle.low_pass_hz": plan.angle_hz, "angle.kd": plan.kd_theta,
                "angle.kp": plan.kp_theta, "angle.ki": plan.ki_theta})  # fmt: skip
    if plan.motor_carries:
        write(rig, {"motor.allocation": 1.0})  # force first
        carrying.carry(rig, 1.0)
    for hz in sorted(plan.frequencies_hz):
        rig.clock.sleep(plan.settle_s)
        write(rig, {"motor.sine_hz": hz})
        with record.step(STEP, hz=hz, amplitude_rad=plan.amplitude_rad, periods=plan.periods):
            rig.clock.sleep(0.2)
            write(rig, {"motor.sine": plan.amplitude_rad})
            record.event(STARTED, hz=hz)  # after the answer: with the write itself it brackets the start
            for shift in fit.shifts(plan.periods, 2 * math.pi / plan.encoder_counts):
                write(rig, {"angle.ref": shift})
                rig.clock.sleep(1 / hz)
            rig.clock.sleep(0.02)
        for part in range(FADE - 1, -1, -1):  # a step of the whole would be an angle step
            write(rig, {"motor.sine": plan.amplitude_rad * part / FADE})
            rig.clock.sleep(0.02)
        write(rig, {"angle.ref": 0.0})
    rig.clock.sleep(plan.settle_s)  # it stops from full speed
    if plan.motor_carries:
        carrying.give_back(rig, 0.2)


def evaluate(recording: Recording[Plan], findings: Findings) -> Result:
    """The swings by frequency, and what the slowest says of the torque."""
    from procedures.slew import estimates

    findings.gate(segments.before_carrying(recording))
    findings.gate(steps.of_signals(recording), ("stuck-channel",))
    result = estimates.evaluate(recording, read_swings(recording), gains(recording.plan))
    findings.add(estimates.findings(result, recording.plan))
    return result


def measured(result: Result) -> Iterator[Measured]:
    """The quantities of each frequency, then those of the slowest."""
    for hz, found in result.tracking.items():
        for quantity in (RMS, PEAK, RATIO, LAG):
            yield quantity.measured(found[quantity.name], f"{hz:g} Hz")
    yield DETENT.measured(result.detent)
    yield FRICTION.measured(result.friction)


def gains(plan: Plan) -> Gains:
    """The controller's, as the plan sets them."""
    return Gains(plan.kp_theta, plan.kd_theta, plan.angle_hz)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts, and movements that the envelope or the torque do not allow."""
    if plan.amplitude_rad * plan.detent_order < math.pi:
        yield (f"amplitude_rad: found {plan.amplitude_rad:g}; expected {math.pi / plan.detent_order:.3g} or more: the swing "
               f"must cover one of {plan.detent_order} periods per turn")  # fmt: skip
    hz = max(plan.frequencies_hz)
    highest = stated(rig, "motor.sine_hz").high
    if min(plan.frequencies_hz) <= 0 or hz > highest:
        yield f"frequencies_hz: found {plan.frequencies_hz}; expected above 0, up to {stated(rig, 'motor.sine_hz').high:g} Hz"
    speed = 2 * math.pi * hz * plan.amplitude_rad
    if speed > carrying.MARGIN * rig.envelope.max_speed_rad_s:
        yield (f"frequencies_hz: {hz:g} Hz turns at up to {speed:.3g} rad/s; the envelope allows "
               f"{rig.envelope.max_speed_rad_s:g} rad/s")  # fmt: skip
    most = stated(rig, "motor.segment_limit").high - (4.0 if plan.motor_carries else 0.0)
    current = rig.machine["polar_inertia"].value * (2 * math.pi * hz) ** 2 * plan.amplitude_rad / DESIGN_NM_A
    if current > carrying.MARGIN * most:
        yield (f"frequencies_hz: {hz:g} Hz takes {current:.3g} A of torque current by prediction; {carrying.MARGIN:.0%} of "
               f"{most:g} A is planned with")  # fmt: skip


def figures(result: Result, recording: Recording[Plan]) -> Iterable[Figure]:
    """Angle and error over time and over angle, growth with frequency, torque current over angle, its orders."""
    from procedures.slew import figures as drawn

    return drawn.all_figures(result, recording.plan.detent_order)


procedure = Procedure(
    name="slew",
    title="Slewing: following a slow sine of the angle, with detent",
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
    steps_on=lambda rig, plan: step_count(plan) - wiring.STEPS + wiring.steps(rig),
    assumes=assumptions.SLEW,
    method=read_method(__file__),
    needs=needs,
)
