"""Truths of procedures of a linear-rotary machine."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bench.cli.truths.settings import Found, settings_of

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated

BEFORE_S = 1e-3  # that a state was there before telemetry tells it, in the mean


def currents(done: Simulated) -> Found:
    from procedures.current_step.steps import LARGE
    from sim_backend.motion import CurrentAsked

    plan: Any = done.recording.plan
    rig, currents = done.recording.rig, done.drawn.machine.motions.currents
    if currents is None:
        return
    stepped = {name: rig.capabilities.current_steps[name] for name in plan.steps_at}
    steps = {name: step.parameter.removeprefix("step_") for name, step in stepped.items()}
    gains = {name: rig.parameters[step.gain].default for name, step in stepped.items() if step.gain}
    encoder = next((e.channel for e in rig.encoders.values() if e.measures == "angle"), "")
    angle = next(iter(done.recording.steps(LARGE))).mean(encoder) if encoder else 0.0
    asked = CurrentAsked(steps, gains, plan.size_A, plan.small_A, plan.response_s, angle)
    for (name, where), value in currents(rig, done.drawn, asked).items():
        yield name, where, value


def mission(done: Simulated) -> Found:
    from procedures.mission.estimates import gate_of, place_of, rest_of
    from procedures.mission.procedure import TURN_RATE, TURN_RISE
    from procedures.mission.steps import LIFT
    from procedures.position_loops.movers import motion
    from sim_backend.mission_motion import MissionAsked

    plan: Any = done.recording.plan
    rig, of = done.recording.rig, done.drawn.machine.motions.mission
    run = done.procedure.evaluated(done.recording).result
    if of is None or run is None:
        return
    at, flight = motion(rig), run.flight
    first = done.recording.captures(part=LIFT)[0]
    start_ns = first.start_ns - round(first.first_tick * rig.devices["controller"].tick_s * 1e9)
    zero = 1e-9 * (start_ns - done.recording.start_ns)
    turn = {"z": (0.0, 0.0), "angle": (TURN_RATE, TURN_RISE)}
    rates = {"z": (plan.place_rate_m_s, plan.place_rise_m_s2), "angle": (plan.angle_rate_rad_s, plan.angle_rise_rad_s2)}
    axes = {at.place: "z", at.angle: "angle"}
    on, lifting, passed = (flight.since(mode) for mode in ("READY", "LIFTING", "LEVITATED"))
    commands = [
        (t - zero, axes[e["name"]], float(e["value"]), *(rates if t > passed else turn)[axes[e["name"]]])
        for e in done.recording.events("parameter")
        if e["name"] in axes and (t := 1e-9 * (e["t_ns"] - done.recording.start_ns)) > on
    ]
    before = flight.lift.t < lifting - 2 * BEFORE_S
    lying = {name: float(x[before].mean()) for name, x in flight.lift.columns.items()}
    gate_m, gate_s = gate_of(rig)
    asked = MissionAsked(
        settings_of(done), on - zero, lifting - BEFORE_S - zero, lying, commands, flight.moves[-1].end - zero,
        [(a.begin - zero, b.end - zero) for a, b in zip(flight.moves[::2], flight.moves[1::2], strict=True)],
        [(*(t - zero for t in rest_of(m, plan)), m.there) for m in flight.moves],
        [place_of(plan, k) for k in (0, 1)], list(zip(plan.places_m, plan.angles_rad, strict=True)), gate_m, gate_s,
    )  # fmt: skip
    yield from ((name, where, value) for (name, where), value in of(rig, done.drawn, asked).items())


def loops(done: Simulated) -> Found:
    from procedures.loop_response import ideal
    from procedures.loop_response.injection import ability, chosen, sensitive, settle_s
    from sim_backend.motion import LoopsAsked

    plan: Any = done.recording.plan
    rig, of = done.recording.rig, done.drawn.machine.motions.loops
    if of is None:
        return
    lines = {ability(rig).loops[axis].channel: axis for axis in chosen(rig, plan)}
    axes = {line: 2 * settle_s(rig, plan, axis) for line, axis in lines.items()}
    looked = [line for line, axis in lines.items() if axis in sensitive(rig, plan)]
    asked = LoopsAsked(settings_of(done, plan.parameters), plan.parameters, axes, looked, plan.low_hz, plan.high_hz)
    for (name, line), value in of(rig, done.drawn, asked).items():
        yield name, lines[line], value
    for axis in chosen(rig, plan):
        if (at := ideal.of_values(rig, plan, axis, done.drawn.values)) is not None:
            yield "bandwidth_ideal", axis, at
