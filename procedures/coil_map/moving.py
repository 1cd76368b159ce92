"""How the machine is moved: position loops let go, currents added and taken away again, the end where it goes too far."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any

from bench.errors import BenchError
from bench.findings import Effect
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.procedure.states import transition
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_coils import CoilMap
from procedures.coil_map import checks, estimates, winding
from procedures.coil_map.plan import Plan
from procedures.coil_map.steps import (
    PULSE,
    SLOWER,
    TOUR,
    WAYS,
    Pulse,
    ability,
    captured,
    points,
    pulse_of,
    pulses,
    radial,
)

FAR = "far"  # event: the mover went too far, and the run ended there
MORE = 4  # times what a capture has to spare that the next attempt has at least
OVER = 1.5  # times what an attempt took too long that the next one has


@contextmanager
def let_go(rig: Rig, can: CoilMap) -> Iterator[None]:
    """With no position held by the controller, which `settings` wrote; after it nothing flows, it is off, and its parameters
    are those of the rig file: off first, for loops that come back would pull a mover that lies elsewhere, and with wrong wiring
    away."""
    before = {name: rig.file.parameters[name].default for name in settings(rig.file, None)}
    try:
        yield
    except BaseException:
        with suppress(BenchError):
            _end(rig, can, before)
        raise
    _end(rig, can, before)


def _end(rig: Rig, can: CoilMap, before: Mapping[str, float]) -> None:
    for system in can.systems.values():  # first: what flows waits for nothing
        rig.levitation.write({system.d: 0.0, system.q: 0.0})
    if can.lasts:
        rig.levitation.write({can.lasts: 0.0})
    transition(rig, RigState.OFF)
    rig.levitation.write(before)


def settings(rig: RigFile, _: Any) -> dict[str, float]:
    """What lets every position go, written as soon as the current loops are on: held the wrong way it would run away."""
    can = rig.capabilities.coil_map
    return {} if can is None else {name: x for values in can.still.values() for name, x in values.items()}


def hold(rig: Rig, can: CoilMap) -> None:
    """Let the controller hold what torques turn, where it is now: a coil that is connected the other way round makes torque of
    the bearings' currents. What no torque turns stays let go."""
    turning = {s.axes[0] for s in can.systems.values() if s.gives == "torque"}
    names = [name for axis in can.still if axis in turning for name in can.still[axis]]
    transition(rig, RigState.OFF)
    rig.levitation.write({name: rig.file.parameters[name].default for name in names})
    transition(rig, RigState.READY)


def moved(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Pulses, then pushes turned around, where every current flows as it should; nothing more once the mover is too far from
    where it lay. Where torques along q turn the mover as they should it is held against turning meanwhile."""
    can = ability(rig.file)
    with let_go(rig, can):
        if can.lasts:
            rig.levitation.write({can.lasts: plan.hold_s})
        rig.clock.sleep(plan.settle_s)
        lay = {axis: rig.levitation.reading(axis) for axis in can.axes}
        seen: list[Pulse] = []
        spare_s, tries = plan.spare_s, plan.tries
        for number, (name, way, size, repeat) in enumerate(pulses(can, plan)):
            labels = {"number": number, "system": name, "way": way, "size_A": size, "repeat": repeat}
            one, spare_s = _pulse(rig, plan, record, labels, spare_s, tries)
            tries = plan.tries if one is not None else 1  # where no current flows, more time brings none
            seen += [] if one is None else [one]
            if _too_far(rig, plan, record, lay):
                return
        if not seen or any(
            f.effect is Effect.ERROR for f in checks.of_currents(estimates.evaluate(seen, {}, rig.file), plan)
        ):
            return
        if can.lasts:
            rig.levitation.write({can.lasts: 0.0})
        up, alone = turns_right(can, seen, plan)
        if up:
            hold(rig, can)
        for name in radial(can):
            if not _around(rig, plan, record, name, lay, up and alone):
                return


def turns_right(can: CoilMap, seen: Sequence[Pulse], plan: Plan) -> tuple[bool, bool]:
    """Whether each torque current along q turned the mover up, and whether none along d turned it as well."""
    torques = [name for name, system in can.systems.items() if system.gives == "torque"]
    turned = {(n, way): [p for p in seen if (p.system, p.way) == (n, way)] for n in torques for way in WAYS}
    by = {key: estimates.half(some, can.systems[key[0]].axes[0]) if some else 0.0 for key, some in turned.items()}
    up = all(by[n, "q"] > plan.min_turn_rad for n in torques)
    return up, all(abs(by[n, "d"]) <= checks.ALONG * abs(by[n, "q"]) for n in torques)


def _pulse(
    rig: Rig, plan: Plan, record: Recorder, labels: dict[str, Any], spare_s: float, tries: int
) -> tuple[Pulse | None, float]:
    """One pulse whole in one capture; taken again, with more to spare, where a slow host or line left part of it outside: by as
    much as it was late, for each attempt pushes the mover on. What it shows, and what the next one has to spare."""
    first_s = spare_s
    for attempt in range(tries):
        one, took_s = _captured(rig, plan, record, labels | {"attempt": attempt}, spare_s)
        if one is not None:
            return one, spare_s
        spare_s = max(MORE * spare_s, OVER * (took_s - 2 * plan.lead_s - plan.hold_s))
    return None, first_s


def _captured(
    rig: Rig, plan: Plan, record: Recorder, labels: dict[str, Any], spare_s: float
) -> tuple[Pulse | None, float]:
    """One pulse in one capture; what it shows, if all of it is there, and how long the host took for it, s. Its end is told as
    well where the controller knows it: that is late, and says that nothing is added any more."""
    assert rig.capture is not None
    can = ability(rig.file)
    name = str(labels["system"])
    system = can.systems[name]
    parameter = system.d if labels["way"] == "d" else system.q
    lasts = 2 * plan.lead_s + plan.hold_s + spare_s
    with record.step(PULSE, **labels):
        rig.capture.arm(captured(can, name, int(labels["repeat"])), seconds=lasts, rate_hz=rig.capture.rate_hz / SLOWER)
        begun = rig.clock.now_ns()
        rig.clock.sleep(plan.lead_s)
        rig.levitation.write({parameter: float(labels["size_A"])})
        rig.clock.sleep(plan.hold_s)
        rig.levitation.write({parameter: 0.0})
        took_s = (rig.clock.now_ns() - begun) * 1e-9
        rig.capture.wait(lasts + 5.0)
    data = rig.capture.upload(None, number=labels["number"], attempt=labels["attempt"])
    rig.clock.sleep(plan.calm_s)
    return pulse_of(rig.file, plan, labels, data.columns, data.rate_hz), took_s


def _around(rig: Rig, plan: Plan, record: Recorder, name: str, lay: Mapping[str, float], with_torque: bool) -> bool:
    """A push that grows, goes around and is taken back; whether the mover stayed where it may be."""
    can, write = ability(rig.file), rig.levitation.write
    system, other = can.systems[name], winding.beside(can, name) if with_torque else ""
    rises = [plan.around_A * k / plan.rise_steps for k in range(plan.rise_steps + 1)]
    for push in rises:
        write({system.d: push})
        rig.clock.sleep(plan.dwell_s)
    for number, d, q, beside in points(can, name, plan, with_torque):
        write({system.d: d, system.q: q} | ({can.systems[other].d: beside} if other else {}))
        with record.step(TOUR, system=name, number=number, d_A=d, q_A=q, beside_A=beside):
            rig.clock.sleep(plan.dwell_s)
        if _too_far(rig, plan, record, lay):
            return False
    write({system.q: 0.0} | ({can.systems[other].d: 0.0} if other else {}))
    for push in reversed(rises):
        write({system.d: push})
        rig.clock.sleep(plan.dwell_s)
    rig.clock.sleep(plan.calm_s)
    return not _too_far(rig, plan, record, lay)


def _too_far(rig: Rig, plan: Plan, record: Recorder, lay: Mapping[str, float]) -> bool:
    """Whether it went farther than rings and pulses of a right winding let it; it is told to the recording."""
    far = {axis: x for axis, x in where(rig, plan, lay).items() if abs(x[0]) > x[1]}
    for axis, (x, limit) in far.items():
        record.event(FAR, axis=axis, moved=x, limit=limit)
    return bool(far)


def where(rig: Rig, plan: Plan, lay: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """By axis how far it is, and how far it may be: around and along from where it lay, aside from the middle."""
    out = {}
    for system in ability(rig.file).systems.values():
        for axis in system.axes:
            x = rig.levitation.reading(axis)
            if system.gives == "radial force":
                out[axis] = x, plan.max_aside_m
            else:
                out[axis] = x - lay[axis], plan.max_turn_rad if system.gives == "torque" else plan.max_along_m
    return out
