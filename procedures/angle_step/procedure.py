"""Angle step while the motor carries the shaft: static against priority input transformation (thesis 6.7.1, Fig. 6.7).

Measurands, each as a mean over repeated steps both ways: the response of the angle (rise, overshoot, settling, final error),
and how far the rotor leaves the sensors' zero meanwhile. Static is T (6.9) with whatever the amplifiers cut; priority is
T (6.19) with (6.24): force first, and torque with what it leaves.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bench.figures import Figure
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from procedures.angle_step import bounds, response
from procedures.angle_step.plan import Plan
from procedures.angle_step.requires import requires
from procedures.angle_step.response import Loop
from procedures.angle_step.steps import STEP, Case, Done, cases, read_moves, readings_of
from procedures.servomotor import carrying, encoder, hold, segments, wiring
from procedures.servomotor.conventions import conventions
from procedures.servomotor.parameters import named, stated, write
from procedures.shared import assumptions

if TYPE_CHECKING:
    from procedures.angle_step.estimates import Result

RISE = Quantity("rise_time", "s", "10 to 90 % of the step of the angle")
OVERSHOOT = Quantity("overshoot", "1", "greatest angle beyond the step, as a share of it")
SETTLING = Quantity("settling_time", "s", "from the answer of the torque current until the angle stays in the band")
FINAL = Quantity("final_error", "rad", "how far beyond its reference the angle ends, in the direction of the step")
PEAK = Quantity("peak", "m", "greatest distance off centre during the step, at the sensor of a bearing or at the motor")
EXCESS = Quantity("excess", "m", "peak at the outboard sensor above that at standstill", title="excess over standstill")
SATURATED = Quantity("saturated", "s", "how long an amplifier of the motor cut its demand")
AMPLITUDE = Quantity("amplitude", "A", "greatest current of a segment, q and d together")
BOUND = Quantity("bound_excess", "A", "greatest torque current beyond what force leaves it, as the law asks for both")
CAPTURED = (AMPLITUDE, BOUND)
MEASURES = (RISE, OVERSHOOT, SETTLING, FINAL, PEAK, EXCESS, SATURATED, *CAPTURED)
TORQUE_CONSTANT = 2.87  # N m/A, T Table 6.2; for predictions before a run, and for nothing that is measured
UPLOAD_S = 0.6  # what the upload of a capture is given at least, by whatever link
LEAST = 11  # encoder counts of a step: the rotor may stand a count on, and 10 % of the step are beyond that
CODES = {"static": 0.0, "priority": 1.0}


def settings(rig: RigFile, _: Plan) -> dict[str, float]:
    """Lifted with the angle released: no loop is closed before the encoder's direction is known."""
    return named(rig, hold.RELEASED)


def planned(plan: Plan) -> list[Case]:
    """What is compared, in its order."""
    sizes: dict[str, tuple[float, ...]] = {
        a: plan.steps_static_rad if a == "static" and plan.steps_static_rad else plan.steps_rad
        for a in plan.allocations
    }
    return list(cases(sizes, plan.filters_hz))


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records, for the progress display."""
    return wiring.STEPS + 2 * plan.repeats * len(planned(plan))


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Step to and fro for every case; with the outboard AMB in charge again in the end."""
    if not wiring.sound(rig, record):
        return
    write(rig, carried(rig.file, plan))
    carrying.carry(rig, plan.settle_s)
    _begun(rig, plan)
    number = 0
    for case in planned(plan):
        write(rig, {"motor.allocation": CODES[case.allocation], "angle.low_pass_hz": case.filter_hz})
        rig.clock.sleep(plan.standstill_s)
        for repeat in range(2 * plan.repeats):
            step = case.size if repeat % 2 == 0 else -case.size
            target = case.size if repeat % 2 == 0 else 0.0
            with record.step(STEP, allocation=case.allocation, size_rad=case.size, filter_hz=case.filter_hz, step_rad=step,
                             target_rad=target, repeat=repeat, **_numbered(rig.file, number)):  # fmt: skip
                rig.clock.sleep(plan.standstill_s)
                _step(rig, target)
                rig.clock.sleep(plan.record_s)
            _uploaded(rig, number)
            number += 1
    carrying.give_back(rig, 0.2)
    write(rig, {"angle.slew": stated(rig.file, "angle.slew").default})


def _begun(rig: Rig, plan: Plan) -> None:
    """A step each way that is not recorded. The rotor stands at whichever edge of its encoder's count the hand-over has left it
    at, a count from where the steps leave it: the first would be another step than those that follow."""
    case = planned(plan)[0]
    write(rig, {"motor.allocation": CODES[case.allocation], "angle.low_pass_hz": case.filter_hz})
    for target in (case.size, 0.0):
        write(rig, {"angle.ref": target})
        rig.clock.sleep(plan.standstill_s + plan.record_s)


def carried(rig: RigFile, plan: Plan) -> dict[str, float]:
    """What the controller is told before the motor carries, by meaning."""
    gains = {"angle.kd": plan.kd_theta, "angle.kp": plan.kp_theta, "angle.ki": plan.ki_theta}
    return {**gains, "angle.derivative_on_error": 1.0, "angle.slew": stated(rig, "angle.slew").high}


def _numbered(rig: RigFile, number: int) -> dict[str, int]:
    """By which a move has its capture."""
    return {"number": number} if bounds.captured(rig) else {}


def _uploaded(rig: Rig, number: int) -> None:
    """The capture of a step, where there is one. The next begins as long after this one over a fast link as over a slow one,
    for the angle's integrator goes on learning."""
    if not bounds.captured(rig.file):
        return
    assert rig.capture is not None
    ended = rig.clock.now_ns()
    rig.capture.wait(5.0)
    rig.capture.upload(None, number=number)
    rig.clock.sleep(max(UPLOAD_S - 1e-9 * (rig.clock.now_ns() - ended), 0.0))


def _step(rig: Rig, target: float) -> None:
    """The step itself, captured where the controller can."""
    if names := bounds.captured(rig.file):
        assert rig.capture is not None
        rig.capture.arm(names, seconds=bounds.CAPTURED_S)
    write(rig, {"angle.ref": target})


@dataclass(frozen=True)
class Results:
    """What was recorded, move by move, and what each case makes of it; `places` are what the rig calls the outboard bearing and
    the motor."""

    moves: Sequence[Done]
    by_case: Mapping[Case, Result]
    places: tuple[str, str]


def evaluate(recording: Recording[Plan], findings: Findings) -> Results:
    """The response of each case."""
    from procedures.angle_step import checks, estimates

    findings.gate(segments.before_carrying(recording))
    plan, rig = recording.plan, recording.rig
    moves = read_moves(recording)
    findings.gate(checks.of_signals(moves, conventions(rig), plan), checks.FATAL)
    findings.gate(encoder.of_counts(readings_of(moves), plan.encoder_counts))
    by_case = estimates.by_case(moves, rig, plan.band, 2 * math.pi / plan.encoder_counts, plan.kp_theta)
    findings.add(checks.of_responses(by_case, plan, {c: _loop(rig, plan, c) for c in by_case}))
    findings.add(checks.compared(by_case))
    return Results(moves, by_case, (conventions(rig).bearings[1], next(iter(rig.motors), "motor")))


def measured(results: Results) -> Iterator[Measured]:
    """The quantities of each case."""
    for case, result in results.by_case.items():
        for quantity in MEASURES:
            if quantity is PEAK:
                for key, place in zip(("peak_outboard", "peak_motor"), results.places, strict=True):
                    yield PEAK.measured(result.estimates[key], f"{place}, {case.where}")
            elif quantity.name in result.estimates:
                yield quantity.measured(result.estimates[quantity.name], case.where)


def _loop(rig: RigFile, plan: Plan, case: Case) -> Loop:
    limit = stated(rig, "motor.segment_limit").high
    inertia = rig.machine["polar_inertia"].value
    return Loop(plan.kp_theta, plan.kd_theta, plan.ki_theta, case.filter_hz, inertia, TORQUE_CONSTANT, limit)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts, and speeds that the envelope does not allow."""
    if len(set(plan.allocations)) < len(plan.allocations) or len(set(plan.filters_hz)) < len(plan.filters_hz):
        yield "allocations, filters_hz: found one twice; expected each once"
    sizes = {case.size for case in planned(plan)}
    if any(not LEAST * math.tau / plan.encoder_counts <= s <= math.pi / 2 for s in sizes):
        least = LEAST * 360 / plan.encoder_counts
        yield f"steps_rad: found {min(sizes):g} to {max(sizes):g}; expected {LEAST} encoder counts " \
              f"({least:.2g} deg) to a quarter turn"  # fmt: skip
    else:
        yield from _too_fast(rig, plan)


def _too_fast(rig: RigFile, plan: Plan) -> Iterator[str]:
    case = Case("", max(case.size for case in planned(plan)), max(plan.filters_hz))
    speed = response.fastest(_loop(rig, plan, case), case.size)
    limit = carrying.MARGIN * rig.envelope.max_speed_rad_s
    if speed > limit:
        yield (f"steps_rad: a step of {math.degrees(case.size):.3g} deg turns at {speed:.3g} rad/s by prediction; the envelope "
               f"allows {rig.envelope.max_speed_rad_s:g} rad/s, of which {carrying.MARGIN:.0%} is planned with")  # fmt: skip


def figures(results: Results, recording: Recording[Plan]) -> Iterable[Figure]:
    """Orbits, angle and segment currents of the largest step, and peaks over the cases."""
    from procedures.angle_step import figures as drawn

    return drawn.all_figures(results.moves, results.by_case, recording.rig)


procedure = Procedure(
    name="angle-step",
    title="Angle step with the motor carrying the shaft: static and priority input transformation",
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
    untold=lambda rig: () if bounds.bounded(rig) else CAPTURED,
    left_out=lambda plan: () if "priority" in plan.allocations else (BOUND,),
    step_count=step_count,
    steps_on=lambda rig, plan: step_count(plan) - wiring.STEPS + wiring.steps(rig),
    reached=(
        "noise/*",
        "sampling/*",
        "raised/*",
        "ticks/*",
        "edges/*",
        "standing/*",
        "rounding/*",
    ),  # both are read from the recording itself
    assumes=assumptions.ANGLE_STEP,
    method=read_method(__file__),
)
