"""What a virtual rig truly does in a procedure of motion, where that follows from the plan and not from the machine alone.

The same machine runs without noise and rounding under the same settings; its quantities go by `name@where`, as a
campaign's table names them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from bench.errors import BenchError
from bench.findings import Finding
from bench.procedure import Measured
from bench.rigfile.aliases import known_as

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated
    from procedures.amb_rotor.machine import AmbRotor
    from sim_backend.motion import Whirl

MARGIN_POINTS = 20000
BEFORE_S = 1e-3  # that a state was there before telemetry tells it, in the mean
TOP_S, TOP_TIMES = 40.0, 12.0  # a speed is watched in each direction: so long, or so many times as long as in the run
Found = Iterator[tuple[str, str, float]]  # name, where, value in SI


def truth_of_motion(done: Simulated) -> dict[str, float]:
    """By `name@where`; nothing for a procedure whose quantities are the machine's, for a machine that does not tell what
    it does, and where a run gave nothing to compare."""
    of = TRUTHS.get(done.procedure.name)
    try:
        if of is None or not any(isinstance(r, Measured) for r in done.results):
            return {}
        aliases = done.recording.rig.aliases
        return {known_as(aliases, f"{name}@{where}" if where else name): value for name, where, value in of(done)}
    except BenchError:
        return {}


def _settings(done: Simulated, *more: Mapping[str, float]) -> dict[str, float]:
    """Every parameter of the controller: the rig file's defaults, then what a procedure writes."""
    rig = done.recording.rig
    known = {name: p.default for name, p in rig.parameters.items()}
    for changed in (done.procedure.settings(done.recording.rig, done.recording.plan), *more):
        known |= changed
    return known


def _step(done: Simulated) -> Found:
    from procedures.amb_rotor.conventions import conventions
    from procedures.step.procedure import list_settings, model, recorded_s, waited_s
    from procedures.step.steps import AT_REST_S, Case
    from sim_backend.motion import StepsAsked

    plan: Any = done.recording.plan
    rig, steps = done.recording.rig, done.drawn.machine.motions.steps
    if steps is None:
        return
    other_band = {r.where for r in done.results if isinstance(r, Finding) and r.code == "band-widened"}
    for setting, changed in list_settings(plan).items():
        settings = _settings(done, model(rig, plan), changed)
        for speed in plan.speeds_rad_s:
            window = 2 * math.pi / speed if speed else AT_REST_S
            for axis in plan.axes:
                asked = StepsAsked(
                    settings, axis, partial(conventions(rig).point, axis), plan.sizes_m, speed, plan.rest_s,
                    record_s=recorded_s(rig, plan), wait_s=waited_s(rig, plan, setting, axis),
                )  # fmt: skip
                small, shown = steps(rig, done.drawn, asked)
                cases = {key: Case(setting, speed, axis, *key) for key in shown}
                group = next(iter(cases.values())).group
                yield "damping", group, small.damping
                yield "natural_frequency", group, small.frequency
                for key, of in shown.items():
                    for name in ("overshoot", "rise_time", "steady_error", "bandwidth"):
                        yield name, cases[key].where, getattr(of, name)
                    if cases[key].where not in other_band:
                        yield "settling_time", cases[key].where, of.settling_time(plan.band, window)


def _tracking(done: Simulated) -> Found:
    from procedures.tracking.by_points import sizes
    from procedures.tracking.procedure import placed
    from procedures.tracking.steps import read_orbits
    from sim_backend.motion import OrbitAsked

    plan: Any = done.recording.plan
    rig, of = done.recording.rig, done.drawn.machine.motions.orbit
    half_y, half_z = sizes(rig, plan)
    for orbit in read_orbits(done.recording):
        if orbit.law in plan.judged and of is not None:
            settings, machine = _settings(done, orbit.machine.select(orbit.law)), orbit.machine
            asked = OrbitAsked(settings, plan.hz, half_y, half_z, plan.ratio, plan.speed_rad_s, plan.settle_s)
            if orbit.path.points is not None:
                at = partial(_at, machine)
                asked = replace(asked, hz=plan.points_hz, points=plan.points, at=at)
            found = of(rig, done.drawn, asked)
            yield from ((quantity.name, where, found[name]) for name, quantity, where in placed(orbit, found))


def _at(machine: AmbRotor, y: float, z: float) -> Mapping[str, float]:
    return machine.points({"y": y, "z": z})


def _vectors(axes: Iterable[str], shaft: Iterable[complex], where: str) -> Found:
    for axis, vector in zip(axes, shaft, strict=True):
        yield "vector_cos", f"{axis}, {where}", float(vector.real)
        yield "vector_sin", f"{axis}, {where}", float(-vector.imag)


def _distances(planes: Iterable[str], whirl: Whirl, where: str) -> Found:
    for plane, far, clearance in zip(planes, whirl.d_max, whirl.clearance, strict=True):
        yield "d_max", f"{plane}, {where}", far
        yield "d_max_share", f"{plane}, {where}", far / clearance


def _unbalance(done: Simulated) -> Found:
    from procedures.synchronous.dwells import DWELL, read_dwells

    plan: Any = done.recording.plan
    of = done.drawn.machine.motions.whirl
    for dwell in read_dwells(done.recording):
        if dwell.kind != DWELL or dwell.again or of is None:
            continue
        machine = dwell.machine
        law = {**(machine.poles if plan.observed else {}), **machine.select(plan.law)}
        settings = _settings(done, law, machine.variants[dwell.variant])
        true = of(done.recording.rig, done.drawn, settings, dwell.speed, machine.positions)
        yield from _vectors(machine.axes, true.shaft, dwell.where)
        yield from _distances(machine.planes, true, dwell.where)


def _balance(done: Simulated) -> Found:
    from procedures.balance.planes import names_of

    of = done.drawn.machine.motions.left
    if of is None:
        return
    names = names_of(done.recording.rig)
    own = of(done.recording.rig, done.drawn, done.recording.events("operator"), names)
    for name, values in (("unbalance", own[0]), ("residual", own[-1])):
        for side, value in zip(names, values, strict=True):
            yield f"{name}_cos", side, float(value.real)
            yield f"{name}_sin", side, float(value.imag)


def _passage(done: Simulated) -> Found:
    """Vectors, orbits and D_max where the speed stands; what is critical at the speeds where the run found it."""
    import numpy as np

    from procedures.amb_rotor.conventions import conventions

    plan: Any = done.recording.plan
    run, of = done.procedure.evaluated(done.recording).result, done.drawn.machine.motions
    if run is None or run.near is None or of.whirl is None:
        return
    rig, machine = done.recording.rig, conventions(done.recording.rig)
    settings = _settings(done, machine.variants["off"], plan.parameters, machine.select(plan.law))
    for result in run.near.dwells:
        true, where = of.whirl(rig, done.drawn, settings, result.dwell.speed, machine.positions), result.dwell.where
        yield from _vectors(machine.axes, true.shaft, where)
        yield from _distances(machine.planes, true, where)
        for plane, pair in machine.planes.items():
            looking = [machine.stations.probes[machine.positions[k]] for k in pair]
            a, b = np.linalg.solve([[p.sign * x for x in p.row[:2]] for p in looking], [true.shaft[k] for k in pair])
            yield "major_half_axis", f"{plane}, {where}", float(abs(a + 1j * b) + abs(a - 1j * b)) / 2
    peaks = [p for p in run.peaks if p.critical]
    if not peaks or of.passage is None:
        return
    ends = [x for p in run.peaks for x in (p.low, p.speed.value, p.high) if math.isfinite(x)]
    held = of.passage(rig, done.drawn, settings, 0.85 * min(ends), 1.1 * max(ends), machine.positions)
    for p in peaks:
        speed, amplitude, factor = held.critical(machine.axes.index(p.axis), p.speed.value)
        yield "critical_speed", p.where, speed
        yield "critical_amplitude", p.where, amplitude
        yield "amplification_factor", p.where, factor
        yield "separation", p.where, abs(speed - plan.running_rad_s) / plan.running_rad_s


def _sensitivity(done: Simulated) -> Found:
    import numpy as np

    from bench.units import RPM
    from procedures.amb_rotor.conventions import conventions
    from procedures.sensitivity.fitting import chosen_axes
    from procedures.sensitivity.margins import fall, phase, rise

    plan: Any = done.recording.plan
    rig, machine, of = done.recording.rig, conventions(done.recording.rig), done.drawn.machine.motions
    settings = _settings(done, machine.select(plan.law))
    for speed in plan.speeds_rad_s:
        if (of.peak if speed else of.loop) is None:
            continue
        loop = None if speed or of.loop is None else of.loop(rig, done.drawn, settings, machine.all_axes)
        for axis in chosen_axes(rig, plan):
            k, where = machine.all_axes.index(axis), f"{axis}, {f'{speed * RPM:.0f} r/min' if speed else 'at rest'}"
            if loop is not None:
                value, hz = loop.peak(k, plan.low_hz, plan.high_hz)
            else:
                assert of.peak is not None
                value, hz = of.peak(rig, done.drawn, settings, k, speed)
            yield "s_max", where, value
            yield "s_max_hz", where, hz
            if loop is not None:
                open_loop = 1 / loop.sensitivity(np.geomspace(plan.low_hz, plan.high_hz, MARGIN_POINTS))[:, k] - 1
                for name, margin in (("phase_margin", phase), ("gain_reduction", fall), ("gain_increase", rise)):
                    yield name, where, margin(open_loop)


def _spindown(done: Simulated) -> Found:
    from sim_backend.motion import DragAsked

    plan: Any = done.recording.plan
    of = done.drawn.machine.motions.drag
    asked = DragAsked(plan.bias_A, plan.bias_high_A, plan.motor_carries)
    yield from ((name, "", value) for name, value in (of(done.drawn, asked) if of is not None else {}).items())


def _derivative(done: Simulated) -> Found:
    from sim_backend.motion import BandAsked

    plan: Any = done.recording.plan
    band = done.drawn.machine.motions.band
    if band is None:
        return
    asked = BandAsked(_settings(done), plan.lines_hz, plan.limit, plan.at_hz)
    for (name, hz), value in band(done.recording.rig, done.drawn, asked).items():
        yield name, "" if hz is None else f"{hz:g} Hz", value


def _currents(done: Simulated) -> Found:
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


def _compare(done: Simulated) -> Found:
    from procedures.one_axis.conventions import conventions
    from sim_backend.motion import CompareAsked

    plan: Any = done.recording.plan
    compare, machine = done.drawn.machine.motions.compare, conventions(done.recording.rig)
    if compare is None:
        return
    engaged, loaded = ({e: machine.choose("estimator", e) for e in names} for names in (plan.engaged, plan.loaded))
    asked = CompareAsked(_settings(done), engaged, loaded, plan.load, plan.lead_s, plan.calm_s)
    for (name, where), value in compare(done.recording.rig, done.drawn, asked).items():
        yield name, where, value


def _circle(done: Simulated) -> Found:
    from procedures.load_balancing import inputs
    from procedures.load_balancing.estimates import FACTS_SEEN, LOADS_SEEN
    from procedures.load_balancing.procedure import ramp_s
    from procedures.load_balancing.steps import AFTER, BEFORE, of_way, read_around
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
            _settings(done, told), carried, circled,
            chosen(rig, "load_balancing", "on"), plan.radius_m, sign * plan.circle_hz, ramp_s(plan), plan.engage_rad,
            plan.gamma_slew_rad_s, plan.gamma_max_rad, [a.branch for a in of_way(around, way, AFTER)],
            wiring.written(rig),
        )  # fmt: skip
        for (name, when), value in of(rig, done.drawn, asked).items():
            if name == "predicted_reduction":
                yield from ((name, f"{source}, {way}", value) for source in (LOADS_SEEN, FACTS_SEEN))
            else:
                yield name, f"{when}, {way}" if when in (BEFORE, AFTER) else way, value


def _angle(done: Simulated) -> Found:
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
        _settings(done), named(rig, {"angle.ref": wiring.TURN_RAD, "angle.kp": hold.PROBE_GAIN}),
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


def _maximum_speed(done: Simulated) -> Found:
    from procedures.maximum_speed.plan import HALF, OP
    from procedures.maximum_speed.procedure import WORDS
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
    sharings = {s: chosen(rig, "sharing", s) for s in (HALF, OP)}
    begun: dict[int, list[int]] = {1: [], -1: []}
    for step in done.recording.steps(RUN):
        begun[int(step.labels["direction"])].append(step.start_ns - done.recording.start_ns)
    at_s = {way: 1e-9 * sum(found) / max(len(found), 1) for way, found in begun.items()}
    watched = max(TOP_S, TOP_TIMES * plan.repeats * plan.average_s)
    true = of.speeds(
        rig, done.drawn, SpeedsAsked(_settings(done), before, sharings, guard_of(rig, plan), watched, at_s)
    )
    for s, name in ((HALF, "half"), (OP, "op")):
        yield f"speed_{name}", "", true[s]["speed"]
        yield f"predicted_{name}", "", true[s]["speed"]
        yield "speed_sd", WORDS[name], true[s]["ripple"]
    yield "ratio", "", true[OP]["speed"] / true[HALF]["speed"]
    yield "ratio_predicted", "", true[OP]["bound"] / true[HALF]["bound"]
    yield "torque_slope", "", of.drag(done.drawn, DragAsked(plan.bias_A, plan.bias_A, True))["B"]


def _mission(done: Simulated) -> Found:
    from procedures.mission.estimates import gate_of, place_of, rest_of
    from procedures.mission.procedure import TURN_RATE, TURN_RISE
    from procedures.mission.steps import LIFT, motion
    from sim_backend.motion import MissionAsked

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
        _settings(done), on - zero, lifting - BEFORE_S - zero, lying, commands, flight.moves[-1].end - zero,
        [(a.begin - zero, b.end - zero) for a, b in zip(flight.moves[::2], flight.moves[1::2], strict=True)],
        [(*(t - zero for t in rest_of(m, plan)), m.there) for m in flight.moves],
        [place_of(plan, k) for k in (0, 1)], list(zip(plan.places_m, plan.angles_rad, strict=True)), gate_m, gate_s,
    )  # fmt: skip
    yield from ((name, where, value) for (name, where), value in of(rig, done.drawn, asked).items())


TRUTHS: Mapping[str, Callable[[Any], Found]] = {
    "step": _step,
    "tracking": _tracking,
    "unbalance": _unbalance,
    "compensation": _unbalance,
    "balance": _balance,
    "run-up": _passage,
    "coast-down": _passage,
    "sensitivity": _sensitivity,
    "spindown": _spindown,
    "angle-step": _angle,
    "maximum-speed": _maximum_speed,
    "derivative": _derivative,
    "load-balancing": _circle,
    "estimator-compare": _compare,
    "mission": _mission,
    "current-step": _currents,
}
