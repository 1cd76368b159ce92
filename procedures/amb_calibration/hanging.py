"""What is hung on a hook, and in which order: the exercise, then every mass up and down at each angle."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from bench.errors import RotorNotArrived
from bench.procedure.rig import Rig
from bench.procedure.roles import NOTHING, Load
from bench.recording.recorder import Recorder
from procedures.amb_calibration import both_coils, checks, turns
from procedures.amb_calibration.plan import Plan
from procedures.amb_calibration.pulls import Pull, axes
from procedures.amb_calibration.steps import Hang, HangOn, hung
from procedures.shared import first_look
from procedures.shared.continued import Done
from procedures.shared.step_table import record_step

CLEAR_A = 0.1  # a change of a control current that is no noise


def sequence(plan: Plan) -> list[tuple[Load, int]]:
    """Loads at one angle with their branch: up and down, mirrored in time, so that linear drift cancels.

    The first zero was reached by unloading (at the previous angle, or by the exercise before the first).
    """
    up = [Load(label) for label in plan.masses]
    return plan.rounds_at_angle * [
        (NOTHING, -1),
        *((x, 1) for x in up),
        *((x, -1) for x in reversed(up[:-1])),
        (NOTHING, -1),
    ]


def exercised(rig: Rig, plan: Plan, record: Recorder, pull: Pull, hook: str) -> bool:
    """The first zero is then reached by unloading, like the others. False where the heaviest mass shows that wiring is wrong
    and
    nobody says to go on."""
    before = _controls(rig, pull)
    rig.operator.hang(Load(plan.masses[-1], hook))
    rig.clock.sleep(plan.settle_s)
    changes = {axis: after - before[axis] for axis, after in _controls(rig, pull).items()}
    rig.operator.hang(Load("", hook))
    seen = checks.wiring(pull, hung(rig.file, pull.hook), changes)
    if max(map(abs, changes.values())) > CLEAR_A and not first_look.goes_on(rig, seen):
        told: dict[str, Any] = {"changes": changes} | ({"hook": hook} if hook else {})
        record.event(checks.WIRED_WRONG, **told)
        return False  # an hour of hangings would say no more
    return True


def hung_up_and_down(rig: Rig, plan: Plan, record: Recorder, pull: Pull, hook: str, done: Done, first: int) -> bool:
    """False where a bearing pulls with one coil alone, which no hanging changes. `first` is the number of the first step on
    this hook. Of the steps `done` by a run that this one continues the last one is repeated, and none of the others."""
    each = len(sequence(plan))
    for turn in range(plan.angles):
        begin = first + turn * each
        if done.leaves_out(begin + each - 1):
            continue
        angle = _turned(rig, plan, turn, done, begin)
        for number, (load, branch) in enumerate(sequence(plan), begin):
            if done.leaves_out(number):
                continue
            if done.repeats(number):
                load = Load(str(done.labels[number]["load"]))  # what really hung
                _from_above(rig, plan, load, branch, hook)
            hanging = rig.operator.hang(replace(load, hook=hook))
            rig.clock.sleep(plan.settle_s)
            if number == first and (needed := both_coils.at_no_load(pull, rig.levitation.reading, plan.bias_A)):
                record.event(both_coils.ONE_SIDED, needed=needed)
                return False
            labels = HangOn(angle, hanging.label, branch, hook) if hook else Hang(angle, hanging.label, branch)
            with record_step(record, labels, again=done.repeats(number)):
                rig.clock.sleep(plan.average_s)
    return True


def _turned(rig: Rig, plan: Plan, turn: int, done: Done, first: int) -> float:
    """The shaft at an angle, whose first hanging has the number `first`; one at which hangings are done it must stand at again,
    as near as anybody reads it.

    Raises:
        RotorNotArrived: it stands elsewhere.
    """
    begun = first < len(done.labels)
    wanted = float(done.labels[first]["angle_rad"]) if begun else 2 * math.pi * turn / plan.angles
    angle = turns.turn(rig, wanted, plan.angles)
    if begun and angle != wanted:
        raise RotorNotArrived(
            f"the shaft stands at {math.degrees(angle):g}°; expected {math.degrees(wanted):g}°, where the hangings of the "
            "stopped run were done. Next: continue once more, and turn it there"
        )
    return angle


def _from_above(rig: Rig, plan: Plan, load: Load, branch: int, hook: str) -> None:
    """A load that was reached by unloading is reached so again: magnets remember from which side. The exercise before ends at
    nothing, so that all else is reached as it was."""
    if branch < 0 and load.label:
        rig.operator.hang(Load(plan.masses[-1], hook))
        rig.clock.sleep(plan.settle_s)


def _controls(rig: Rig, pull: Pull) -> dict[str, float]:
    """The control currents by axis as they are now, A."""
    read = rig.levitation.reading
    return {axis.name: (read(axis.coils[0]) - read(axis.coils[1])) / 2 for axis in axes(pull)}
