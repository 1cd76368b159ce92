"""Active load balancing of the motor on a circle (thesis 6.7.3): the field is turned so that i_x and i_y carry alike.

Measurands, each way round: the largest |i_y| without and with balancing (true, by means over `bin_s` of the circle's phase
and over the turns) and by how much it falls; the largest current of either axis; how unlike they are; the greatest phase
angle; the path's deviation. Beside them what the quasi-static formula predicts of the recorded loads and of the adopted
constants.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from bench.calibration import Calibration, Need
from bench.figures import Figure
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.procedure.states import transition
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from procedures.load_balancing import estimates, foresight, inputs
from procedures.load_balancing.estimates import Result
from procedures.load_balancing.plan import Plan
from procedures.load_balancing.requires import requires
from procedures.load_balancing.steps import AFTER, BEFORE, FACTS_SEEN, LOADS_SEEN, STEP, read_around
from procedures.servomotor import carrying, hold, segments, wiring
from procedures.servomotor.conventions import LOADS, PHASE, conventions
from procedures.servomotor.direction import of_probe
from procedures.servomotor.parameters import chosen, named, stated, write
from procedures.shared import assumptions

PEAK_Y = Quantity("peak_i_y", "A", "largest |i_y| around the circle, true current", title="largest i_y")
PEAK_ANY = Quantity(
    "peak_any", "A", "largest of |i_x| and |i_y| around the circle, true current", title="largest current"
)
REDUCTION = Quantity("reduction", "1", "largest |i_y| with balancing over that without, less 1")
PREDICTED = Quantity("predicted_reduction", "1", "the same by the quasi-static formula, before balancing begins")
UNBALANCE = Quantity("unbalance", "1", "rms of |i_x| - |i_y| over rms of |i_x| + |i_y|")
RATIO = Quantity("unbalance_ratio", "1", "unbalance with balancing over that without")
GAMMA = Quantity(
    "gamma_extreme", "rad", "greatest size of the phase angle while it balances", title="largest phase angle"
)
ERROR = Quantity(
    "error_radius",
    "m",
    "greatest deviation along the radius of the path from the circle that the probes should read",
    title="largest deviation from the circle",
)
MEASURES = (PEAK_Y, PEAK_ANY, REDUCTION, PREDICTED, UNBALANCE, RATIO, GAMMA, ERROR)
CIRCLE_M_S = 1e-4  # how fast the controller changes the circle's radius
RATE_HZ = 1000.0  # of the capture
REVERSED = math.pi / 2  # electrical: beyond it the motor's torque is reversed
KEPT = math.radians(
    10
)  # electrical, kept from it: one degree of gamma for the commutation's zero, a quarter for the rest


def settings(rig: RigFile, _: Plan) -> dict[str, float]:
    """Lifted with the angle released: no loop is closed before the encoder's direction is known."""
    return named(rig, hold.RELEASED)


def needs(_: Plan) -> tuple[Need, ...]:
    """The motor's constants: what the controller is told, and what the prediction is made of."""
    return tuple(Need(name, facts=facts) for name, facts in inputs.USED.items())


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records, for the progress display."""
    return wiring.STEPS + 2 * plan.repeats * len(plan.ways)


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Tell the controller its model at rest, lift, let the motor carry, and go around with and without balancing."""
    model = inputs.told(rig.file, plan, record.calibrations)
    rig.levitation.write({rig.file.capabilities.model[key]: value for key, value in model.items()})
    transition(rig, RigState.LEVITATED)
    if not wiring.sound(rig, record):
        return
    rig.levitation.write(chosen(rig.file, "sharing", "priority"))
    write(rig, {"motor.phase_slew": plan.gamma_slew_rad_s, "motor.phase_limit": plan.gamma_max_rad})
    carrying.carry(rig, plan.settle_s)
    for repeat in range(plan.repeats):
        for way, sign in plan.signs:
            _around(rig, plan, record, way, sign, repeat)
    carrying.give_back(rig, 0.2)


def ramp_s(plan: Plan) -> float:
    """Whole turns in which the circle grows."""
    return math.ceil(plan.radius_m / CIRCLE_M_S * plan.circle_hz) * plan.turn_s


def _around(rig: Rig, plan: Plan, record: Recorder, way: str, sign: int, repeat: int) -> None:
    assert rig.capture is not None
    turns_s = plan.turns * plan.turn_s
    write(rig, {"motor.circle_hz": sign * plan.circle_hz, "motor.circle": plan.radius_m})
    rig.clock.sleep(ramp_s(plan))
    with record.step(STEP, when=BEFORE, way=way, repeat=repeat):
        rig.clock.sleep(turns_s)
    rig.clock.sleep((sign * plan.engage_rad / (2 * math.pi)) % 1.0 * plan.turn_s)
    rig.levitation.write(chosen(rig.file, "load_balancing", "on"))
    rig.clock.sleep(plan.turn_s)
    rig.capture.arm((PHASE, *LOADS), seconds=turns_s + 2 / RATE_HZ, rate_hz=RATE_HZ)
    with record.step(STEP, when=AFTER, way=way, repeat=repeat):
        rig.clock.sleep(turns_s)
    rig.capture.wait(5.0)
    _field_back(rig, plan)
    write(rig, {"motor.circle": 0.0})
    rig.capture.upload(None, way=way, repeat=repeat)
    rig.clock.sleep(plan.radius_m / CIRCLE_M_S + 0.5)


def _field_back(rig: Rig, plan: Plan) -> None:
    """Back to a field that stands still. First gamma goes home while balancing still knows of it: the PID that takes over does
    not, and would push by M gamma in the wrong direction, 64 degrees at the bound."""
    write(rig, {"motor.phase_limit": 0.0})
    rig.clock.sleep(plan.gamma_max_rad / plan.gamma_slew_rad_s + 0.1)
    rig.levitation.write(chosen(rig.file, "load_balancing", "off"))
    write(rig, {"motor.phase_limit": plan.gamma_max_rad})


@dataclass(frozen=True)
class Analysis:
    """Results by way."""

    by_way: Mapping[str, Result]


def evaluate(recording: Recording[Plan], findings: Findings) -> Analysis:
    """Currents by the phase of the circle, and what was predicted of them."""
    from procedures.load_balancing import checks

    findings.gate([*of_probe(recording), *segments.of_nudges(recording)])
    plan, rig = recording.plan, recording.rig
    findings.gate(checks.of_losses(recording))
    around = read_around(recording)
    findings.gate(checks.of_parts(around, plan))
    findings.gate(checks.of_signals(around, conventions(rig), plan), checks.FATAL)
    results, given = estimates.evaluate(recording, around)
    model = inputs.told(rig, plan, recording.calibrations)
    findings.add(checks.of_law(around, plan, model, rig.machine["pole_pairs"].value))
    findings.add(checks.of_side(results, plan, model))
    findings.add(checks.of_results(results, given))
    return Analysis(results)


def measured(a: Analysis) -> Iterator[Measured]:
    """Every quantity, each way round."""
    for way, result in a.by_way.items():
        at = result.estimates
        for quantity in (PEAK_Y, PEAK_ANY, UNBALANCE, ERROR):
            for when in (BEFORE, AFTER):
                yield quantity.measured(at[f"{quantity.name}/{when}"], f"{when}, {way}")
        for quantity in (REDUCTION, RATIO, GAMMA):
            yield quantity.measured(at[quantity.name], way)
        for source in (LOADS_SEEN, FACTS_SEEN):
            yield PREDICTED.measured(at[f"predicted/{source}"], f"{source}, {way}")


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts: what envelope or torque do not allow, and parts of a turn that show no peak."""
    if len(set(plan.ways)) < len(plan.ways):
        yield f"ways: found {', '.join(plan.ways)}; expected each once"
    room = carrying.MARGIN * rig.envelope.max_levitated_position_m
    for limit, what in (
        (room, f"{carrying.MARGIN:.0%} of the envelope"),
        (stated(rig, "motor.circle").high, "the parameter"),
    ):
        if plan.radius_m > limit:
            yield f"radius_m: found {plan.radius_m * 1e6:.0f} µm; {what} allows {limit * 1e6:.0f} µm"  # fmt: skip
    yield from foresight.parts(plan, RATE_HZ)
    yield from _phase(rig, plan)


def _phase(rig: RigFile, plan: Plan) -> Iterator[str]:
    poles = rig.machine["pole_pairs"].value
    for key, value in (("gamma_max", plan.gamma_max_rad), ("gamma_slew", plan.gamma_slew_rad_s)):
        limit = stated(rig, "motor.phase_limit" if key == "gamma_max" else "motor.phase_slew").high
        if value > limit:
            yield f"{key}: found {math.degrees(value):.2f}°; the controller allows {math.degrees(limit):.2f}°"
    allowed = (REVERSED - KEPT) / poles
    if plan.gamma_max_rad > allowed and not plan.beyond_torque:
        left = math.cos(poles * plan.gamma_max_rad)
        yield (
            f"gamma_max_rad: found {math.degrees(plan.gamma_max_rad):.2f}°, where the motor has {left:.0%} of its torque; at "
            f"{math.degrees(REVERSED / poles):.2f}° it has none, and beyond it turns the rotor the other way. Expected at most "
            f"{math.degrees(allowed):.2f}°, or beyond_torque=true where that is meant"
        )


def foresees(rig: RigFile, plan: Plan, facts: Mapping[str, Calibration]) -> Iterable[str]:
    """A current that the motor has not, by the adopted constants."""
    return foresight.current(rig, plan, facts)


def figures(a: Analysis, recording: Recording[Plan]) -> Iterable[Figure]:
    """Loads as vectors, currents, phase angle and path around the circle."""
    from procedures.load_balancing import figures as drawn

    return drawn.all_figures(a.by_way, recording.plan)


procedure = Procedure(
    name="load-balancing",
    title="Active load balancing of the motor on a circle",
    measures=MEASURES,
    state=RigState.READY,
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
    places=(LOADS_SEEN, FACTS_SEEN, BEFORE, AFTER),
    assumes=assumptions.LOAD_BALANCING,
    method=read_method(__file__),
)
