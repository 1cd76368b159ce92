"""What a run to the maximum speed does with the machine: where the motor carries its end, and runs at the torque limit."""

from __future__ import annotations

import math
from collections.abc import Iterator

from bench.errors import RotorNotArrived
from bench.procedure.rig import Rig
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.roles import SPEED, told_in
from procedures.maximum_speed.plan import HALF, OP, Plan
from procedures.maximum_speed.requires import captured
from procedures.maximum_speed.steps import CARRIED_A, GUARDED, NOT_CARRIED, RUN, SET_POINT, SHARED, UNSTEADY
from procedures.servomotor import carrying
from procedures.servomotor.conventions import conventions
from procedures.servomotor.parameters import chosen, stated, write
from procedures.shared import first_look

LOOK_S, LOOKS = 1.0, 20  # means of the speed over some whole turns in about so long, and how many at most
TRIES = 6  # for the i_y that was asked for
MORE = 1.25  # of it may be carried where the set point goes no further: that leaves less torque, and lower speeds
SPARE_S = 5.0  # for a capture, beyond its own time


def limit_of(rig: RigFile, plan: Plan) -> float:
    """Of each segment, A."""
    return plan.limit_A or stated(rig, "motor.segment_limit").default


def guard_of(rig: RigFile, plan: Plan) -> float:
    """Speed reference of a run, rad/s."""
    return plan.guard_rad_s or stated(rig, "angle.speed").high


def newtons_per_m(rig: RigFile) -> float:
    """By how much the load on the motor changes as its sensors' plane moves while the inboard AMB holds its own plane, N/m; by
    the rig file, for predictions."""
    inboard, motor, sensor = (
        rig.geometry[n].value for n in ("com_to_inboard_amb", "com_to_motor", "com_to_outboard_sensor")
    )
    return rig.geometry["motor_stiffness"].value * (inboard + motor) / (inboard + sensor)


def carry_so_much(rig: Rig, plan: Plan, record: Recorder) -> bool:
    """Move the motor's set point until it takes `carried_A` of i_y, if that is asked for; False where its range does not do."""
    reach, machine, at = stated(rig.file, "motor.ref_along"), conventions(rig.file), plan.set_point_m
    before, i_y = at, math.nan
    for _ in range(TRIES):
        write(rig, {"motor.ref_along": at})
        rig.clock.sleep(plan.settle_s)
        seen = first_look.watched(rig, record, machine.segments, LOOK_S / 2)
        i_y = (seen[machine.segments[0]] - seen[machine.segments[2]]) / 2
        before, at = at, at + (i_y - plan.carried_A) * carrying.newtons_per_A(rig.file) / newtons_per_m(rig.file)
        at = min(max(at, reach.low), reach.high)
        near = abs(i_y - plan.carried_A) < CARRIED_A
        if not plan.carried_A or near or (at == before and 1 < i_y / plan.carried_A < MORE):
            record.event(SET_POINT, at=before, i_y=i_y)
            return True
    record.event(NOT_CARRIED, at=before, found=i_y, wanted=plan.carried_A)
    return False


def order(plan: Plan, direction: int) -> Iterator[tuple[str, int]]:
    """Sharing and repeat of the runs in one direction, ABBA and so on, in the other direction BAAB: a drift that is even in
    time cancels."""
    first, second = (HALF, OP) if direction > 0 else (OP, HALF)
    for repeat in range(plan.repeats):
        pair = (first, second) if repeat % 2 == 0 else (second, first)
        yield from ((sharing, repeat) for sharing in pair)


def run_all(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Both sharings in turn in both directions, at the torque limit all the time; the rotor stands in the end."""
    number = 0
    for direction in (1, -1):
        for k, (sharing, repeat) in enumerate(order(plan, direction)):
            rig.levitation.write(chosen(rig.file, "sharing", sharing))
            record.event(SHARED, sharing=sharing, direction=direction)
            if k == 0 and _reaches(rig, plan, direction):
                record.event(GUARDED, guard=direction * guard_of(rig.file, plan), sharing=sharing)
                return
            rig.clock.sleep(plan.dwell_s)
            _wait_steady(rig, plan, record, sharing)
            with record.step(RUN, number=number, sharing=sharing, direction=direction, repeat=repeat):
                _window(rig, plan)
            assert rig.capture is not None
            rig.capture.upload(None, number=number)
            number += 1


def _reaches(rig: Rig, plan: Plan, direction: int) -> bool:
    """Turn towards the speed that guards the run, with all the torque that there is. At the torque limit the rotor does not get
    there, and `spin` ends when it comes no nearer."""
    rig.levitation.write(chosen(rig.file, "torque", "limit"))
    try:
        rig.rotation.spin(direction * guard_of(rig.file, plan))
    except RotorNotArrived:
        return False
    return True


def _wait_steady(rig: Rig, plan: Plan, record: Recorder, sharing: str) -> None:
    """Until the mean speed over whole turns changes little from one to the next, twice. Over a second, which ends anywhere in a
    turn, the mean of a speed with a ripple changes to and fro for ever (0.4 % at 3.5 turns)."""
    channel = told_in(rig.file, SPEED)
    before, quiet, change = 0.0, 0, 1.0
    for _ in range(LOOKS):
        turns = round(LOOK_S * abs(before) / math.tau)
        now = first_look.watched(rig, record, (channel,), turns * math.tau / abs(before) if turns else LOOK_S)[channel]
        change = abs(now - before) / max(abs(now), 1e-3)
        quiet, before = quiet + 1 if change < plan.max_change else 0, now
        if quiet == 2:
            return
    record.event(UNSTEADY, sharing=sharing, change=change, waited=LOOKS * LOOK_S)


def _window(rig: Rig, plan: Plan) -> None:
    assert rig.capture is not None
    rig.capture.arm(captured(conventions(rig.file)), seconds=plan.capture_s)
    rig.clock.sleep(plan.average_s)
    rig.capture.wait(plan.capture_s + SPARE_S)
