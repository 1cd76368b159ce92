"""Truths of procedures of the self-bearing servomotor."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from bench.cli.truths.settings import Found, settings_of

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated

TOP_S, TOP_TIMES = 40.0, 12.0  # a speed is watched in each direction: so long, or so many times as long as in the run


def spindown(done: Simulated) -> Found:
    from sim_backend.motion import DragAsked

    plan: Any = done.recording.plan
    of = done.drawn.machine.motions.drag
    asked = DragAsked(plan.bias_A, plan.bias_high_A, plan.motor_carries)
    yield from ((name, "", value) for name, value in (of(done.drawn, asked) if of is not None else {}).items())


def circle(done: Simulated) -> Found:
    from procedures.load_balancing import inputs
    from procedures.load_balancing.procedure import ramp_s
    from procedures.load_balancing.steps import AFTER, BEFORE, FACTS_SEEN, LOADS_SEEN, of_way, read_around
    from procedures.servomotor import wiring
    from procedures.servomotor.parameters import chosen, named
    from sim_backend.motion import CircleAsked

    plan: Any = done.recording.plan
    rig, of = done.recording.rig, done.drawn.machine.motions.circle
    if of is None:
        return
    around = read_around(done.recording)
    model = inputs.told(rig, plan, done.recording.calibrations)
    phase = {"motor.phase_slew": plan.gamma_slew_rad_s, "motor.phase_limit": plan.gamma_max_rad}
    told = {rig.capabilities.model[key]: value for key, value in model.items()}
    carried = {**named(rig, {**phase, "motor.share": 1.0}), **chosen(rig, "sharing", "priority")}
    for way, sign in plan.signs:
        circled = named(rig, {"motor.circle": plan.radius_m, "motor.circle_hz": sign * plan.circle_hz})
        asked = CircleAsked(
            settings_of(done, told), carried, circled,
            chosen(rig, "load_balancing", "on"), plan.radius_m, sign * plan.circle_hz, ramp_s(plan), plan.engage_rad,
            plan.gamma_slew_rad_s, plan.gamma_max_rad, [a.branch for a in of_way(around, way, AFTER)],
            wiring.written(rig),
        )  # fmt: skip
        for (name, when), value in of(rig, done.drawn, asked).items():
            if name == "predicted_reduction":
                yield from ((name, f"{source}, {way}", value) for source in (LOADS_SEEN, FACTS_SEEN))
            else:
                yield name, f"{when}, {way}" if when in (BEFORE, AFTER) else way, value


def angle(done: Simulated) -> Found:
    from procedures.angle_step.procedure import CODES, carried, planned
    from procedures.servomotor import hold, wiring
    from procedures.servomotor.conventions import conventions
    from procedures.servomotor.parameters import named, parameter, stated
    from sim_backend.motion import AngleAsked, AngleCase

    plan: Any = done.recording.plan
    rig, of = done.recording.rig, done.drawn.machine.motions.angle
    if of is None:
        return
    count = 2 * math.pi / plan.encoder_counts
    cases = {
        case.where: AngleCase(
            named(rig, {"motor.allocation": CODES[case.allocation], "angle.low_pass_hz": case.filter_hz}),
            case.size, max(plan.band * case.size, 2 * count), case.allocation == "priority",
        )
        for case in planned(plan)
    }  # fmt: skip
    asked = AngleAsked(
        settings_of(done), named(rig, {"angle.ref": wiring.TURN_RAD, "angle.kp": hold.PROBE_GAIN}),
        named(rig, {"angle.ref": 0.0} | {key: stated(rig, key).default for key in hold.GAINS}), named(rig, carried(rig, plan)),
        named(rig, {"motor.share": 1.0}), parameter(rig, "angle.ref"),
        stated(rig, "motor.segment_limit").default, cases, plan.repeats,
        1 / stated(rig, "motor.share_slew").default + plan.settle_s, *_lasted(done, parameter(rig, "angle.ref")), _idle(done),
    )  # fmt: skip
    outboard, motor = conventions(rig).bearings[1], next(iter(rig.motors), "motor")
    places = {"peak_outboard": outboard, "peak_motor": motor}
    for (name, where), value in of(rig, done.drawn, asked).items():
        yield ("peak", f"{places[name]}, {where}", value) if name in places else (name, where, value)


def _lasted(done: Simulated, reference: str) -> tuple[float, float]:
    """How long a step of the angle was recorded before and after its reference was written, s: by the plan, and what writing
    takes, for the angle's integrator learns meanwhile."""
    from procedures.angle_step.steps import STEP

    written = [e["t_ns"] for e in done.recording.events("parameter") if e["name"] == reference]
    whole = [(s, [t for t in written if s.start_ns <= t < s.end_ns]) for s in done.recording.steps(STEP)]
    before, after = zip(*((t[-1] - s.start_ns, s.end_ns - t[-1]) for s, t in whole if t), strict=True)
    return 1e-9 * sum(before) / len(before), 1e-9 * sum(after) / len(after)


def _idle(done: Simulated) -> list[float]:
    """How long nothing was recorded before each step of the angle, s: its writes, its standstill, the upload of a capture."""
    from procedures.angle_step.steps import STEP

    steps = done.recording.steps(STEP)
    return [0.0, *(1e-9 * (b.start_ns - a.end_ns) for a, b in pairwise(steps))]


def maximum_speed(done: Simulated) -> Found:
    from procedures.maximum_speed.plan import HALF, NAMES, OP, SHARINGS, WORDS
    from procedures.maximum_speed.running import guard_of, limit_of
    from procedures.maximum_speed.steps import RUN, SET_POINT
    from procedures.servomotor.hold import GAINS
    from procedures.servomotor.parameters import chosen, named, stated
    from sim_backend.motion import DragAsked, SpeedsAsked

    plan: Any = done.recording.plan
    rig, of = done.recording.rig, done.drawn.machine.motions
    held = done.recording.events(SET_POINT)
    if of.speeds is None or of.drag is None or not held:
        return
    before = (
        named(rig, {key: stated(rig, key).default for key in GAINS}),
        {**chosen(rig, "sharing", OP), **named(rig, {"motor.share": 1.0})},
        named(rig, {"motor.ref_along": float(held[0]["at"])}),
        {**chosen(rig, "commutation", plan.commutation), **named(rig, {"motor.segment_limit": limit_of(rig, plan)}),
         **chosen(rig, "torque", "limit")},
    )  # fmt: skip
    sharings = {s: chosen(rig, "sharing", s) for s in SHARINGS}
    begun: dict[int, list[int]] = {1: [], -1: []}
    for step in done.recording.steps(RUN):
        begun[int(step.labels["direction"])].append(step.start_ns - done.recording.start_ns)
    at_s = {way: 1e-9 * sum(found) / max(len(found), 1) for way, found in begun.items()}
    watched = max(TOP_S, TOP_TIMES * plan.repeats * plan.average_s)
    true = of.speeds(
        rig, done.drawn, SpeedsAsked(settings_of(done), before, sharings, guard_of(rig, plan), watched, at_s)
    )
    for s, name in NAMES.items():
        yield f"speed_{name}", "", true[s]["speed"]
        yield f"predicted_{name}", "", true[s]["speed"]
        yield "speed_sd", WORDS[s], true[s]["ripple"]
    yield "ratio", "", true[OP]["speed"] / true[HALF]["speed"]
    yield "ratio_predicted", "", true[OP]["bound"] / true[HALF]["bound"]
    yield "torque_slope", "", of.drag(done.drawn, DragAsked(plan.bias_A, plan.bias_A, True))["B"]
