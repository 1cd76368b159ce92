"""Maximum speed of the motor with two ways of sharing its segments (thesis 6.7.1, Fig. 6.8), against a balance of torques.

Measurand: steady speed while the motor carries one end of the shaft and gives all the torque current that force leaves of the
segments' limit, with lambda 1/2 and with lambda of T (6.24); mean of both directions. Beside it what torque constant and drag,
taken in the same state of the AMBs, make of the torque currents that were recorded.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from bench.calibration import Calibration, Need
from bench.figures import Figure
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from procedures.maximum_speed import foresight
from procedures.maximum_speed.plan import NAMES, OP, SHARINGS, WORDS, Plan
from procedures.maximum_speed.requires import requires
from procedures.maximum_speed.running import carry_so_much, guard_of, limit_of, run_all
from procedures.maximum_speed.steps import read_windows, turned
from procedures.servomotor import carrying, encoder, hold, segments, wiring
from procedures.servomotor.conventions import conventions
from procedures.servomotor.direction import of_probe
from procedures.servomotor.parameters import BIASES, chosen, named, stated, write
from procedures.shared import assumptions

if TYPE_CHECKING:
    from procedures.maximum_speed.estimates import Result

SPEED_HALF = Quantity(
    "speed_half",
    "rad/s",
    "steady speed at the torque limit with λ = 1/2, mean of both directions",
    title="maximum speed, λ = 1/2",
)
SPEED_OP = Quantity(
    "speed_op",
    "rad/s",
    "steady speed at the torque limit with λ by T (6.24), mean of both directions",
    title="maximum speed, λ by (6.24)",
)
RATIO = Quantity("ratio", "1", "speed with λ by T (6.24) over that with λ = 1/2", title="ratio of the speeds")
RATIO_PREDICTED = Quantity(
    "ratio_predicted",
    "1",
    "ratio of the mean torque currents that the limit leaves beside the recorded |i_x|, |i_y|",
    title="ratio of the torque currents",
)
PREDICTED_HALF = Quantity(
    "predicted_half",
    "rad/s",
    "speed with λ = 1/2 by torque constant, drag and torque current",
    title="expected, λ = 1/2",
)
PREDICTED_OP = Quantity("predicted_op", "rad/s", "speed with λ by T (6.24) by the same", title="expected, λ by (6.24)")
SLOPE = Quantity(
    "torque_slope", "N m s/rad", "torque over speed from one sharing to the other", title="torque over speed"
)
SD = Quantity(
    "speed_sd", "rad/s", "rms of the speed about its mean within a turn, orders 1 to 4", title="ripple of the speed"
)
SINGLES = (SPEED_HALF, SPEED_OP, RATIO, RATIO_PREDICTED, PREDICTED_HALF, PREDICTED_OP, SLOPE)
MEASURES = (*SINGLES, SD)


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """Lifted with the angle released: no loop is closed before the encoder's direction is known."""
    return {**named(rig, {**dict.fromkeys(BIASES, plan.bias_A), **hold.RELEASED}), **hold.speed_held(rig)}


def needs(plan: Plan) -> tuple[Need, ...]:
    """The drag in the same state of the AMBs, and the torque constant."""
    del plan
    return (
        Need("spindown", {"motor_carries": 1.0}, facts=("B", "B_high", "T_c", "J_z")),
        Need("torque-constant", facts=("alpha_tau", "gamma_0t")),
    )


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records, for the progress display."""
    return wiring.STEPS + 4 * plan.repeats


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Let the motor carry, lower the limit of its segments, and turn with all that is left; the outboard AMB is in charge again
    in the end."""
    if not wiring.sound(rig, record):
        return
    rig.levitation.write(chosen(rig.file, "sharing", OP))
    carrying.carry(rig, plan.settle_s)
    if carry_so_much(rig, plan, record):
        limit = stated(rig.file, "motor.segment_limit")
        rig.levitation.write(chosen(rig.file, "commutation", plan.commutation))
        write(rig, {"motor.segment_limit": limit_of(rig.file, plan)})
        rig.clock.sleep(plan.settle_s)
        run_all(rig, plan, record)
        rig.rotation.stop()
        rig.levitation.write(chosen(rig.file, "torque", "held"))
        write(rig, {"motor.segment_limit": limit.default})
    write(rig, {"motor.ref_along": stated(rig.file, "motor.ref_along").default})
    rig.clock.sleep(plan.settle_s)
    carrying.give_back(rig, plan.settle_s)


def evaluate(recording: Recording[Plan], findings: Findings) -> Result:
    """Speeds, ratio, and what is expected of them."""
    from procedures.maximum_speed import checks, estimates

    findings.gate([*of_probe(recording), *segments.of_nudges(recording), *checks.of_events(recording)])
    plan, rig = recording.plan, recording.rig
    limit, machine = limit_of(rig, plan), conventions(rig)
    windows = read_windows(recording, limit)
    findings.add(checks.of_windows(windows, machine, plan))
    findings.gate(encoder.of_counts(turned(recording), plan.encoder_counts))
    findings.add(checks.of_law(windows, limit))
    facts = {name: recording.calibration(name) for name in ("spindown", "torque-constant")}
    result = estimates.evaluate(windows, plan, rig, facts)
    findings.add(checks.of_lag(result, plan))
    findings.add(checks.of_result(result, plan))
    return result


def measured(result: Result) -> Iterator[Measured]:
    """Speeds and ratio, then what is expected, and the ripple of each sharing."""
    for quantity in SINGLES:
        yield quantity.measured(result.estimates[quantity.name])
    for sharing, name in NAMES.items():
        yield SD.measured(result.estimates[f"ripple_{name}"], WORDS[sharing])


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    for kind, names in (("sharing", SHARINGS), ("torque", ("limit", "held")), ("commutation", (plan.commutation,))):
        found = rig.capabilities.settings.get(kind, {})
        if missing := [name for name in names if name not in found]:
            yield f"capabilities.settings.{kind}: found no {', '.join(missing)}"
    for key, name in (("limit_A", "motor.segment_limit"), ("guard_rad_s", "angle.speed")):
        p, value = stated(rig, name), getattr(plan, key)
        if value and not p.low <= value <= p.high:
            yield f"{key}: found {value:g} {p.unit}; the controller takes {p.low:g} to {p.high:g} {p.unit}"
    if not guard_of(rig, plan) < rig.envelope.max_speed_rad_s:
        yield (f"guard_rad_s: found {guard_of(rig, plan):g} rad/s; expected less than the envelope's "
               f"{rig.envelope.max_speed_rad_s:g} rad/s")  # fmt: skip
    if plan.capture_s > plan.average_s:
        yield f"capture_s: found {plan.capture_s:g} s; expected at most average_s, {plan.average_s:g} s"
    yield from foresight.reserve(rig, plan)


def foresees(rig: RigFile, plan: Plan, facts: Mapping[str, Calibration]) -> Iterable[str]:
    """Speeds that the rig does not allow, and windows too short for them, by the adopted torque constant and drag."""
    return foresight.of_facts(rig, plan, facts)


def figures(result: Result, recording: Recording[Plan]) -> Iterable[Figure]:
    """Speed over time, torque over speed, currents and bound within a turn."""
    from procedures.maximum_speed import figures as drawn

    return drawn.all_figures(result, recording, limit_of(recording.rig, recording.plan))


procedure = Procedure(
    name="maximum-speed",
    title="Maximum speed with two ways of sharing the segments",
    measures=MEASURES,
    state=RigState.LEVITATED,
    plan=Plan,
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    foresees=foresees,
    settings=settings,
    step_count=step_count,
    needs=needs,
    places=tuple(WORDS.values()),
    reached=("encoder/*",),  # read from the recording itself
    assumes=assumptions.MAXIMUM_SPEED,
    method=read_method(__file__),
)
