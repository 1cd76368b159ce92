"""Before a loop is closed that a wrong wire would drive into the stops: does the motor turn and push the way it should?

The rotor is levitated by both AMBs and released. Each check moves it a little, records the movement as a step that the
analysis judges (`direction.of_probe`, `segments.of_nudges`, `leaning.of_leans`), and says whether to go on.
"""

from __future__ import annotations

import math

from bench.procedure.rig import Rig
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.roles import ANGLE
from procedures.servomotor import hold, leaning
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.servomotor.parameters import named, stated, write
from procedures.shared import first_look

NEEDED = ("motor.across", "motor.along")
NUDGE_A, NUDGE_S = 1.0, 0.3
TURN_RAD, TURN_S = 0.2, 0.12  # a third of a swing at that gain: it is still on its way
LEAST_RAD, LEAST_A = (
    0.03,
    0.05,
)  # what the analysis calls turned; a sixth of what a sound motor does to the outboard AMB
STEPS = 4  # that `sound` records, and those of `leaning` for a motor with a frame of its own


def channels(machine: Servomotor) -> tuple[str, ...]:
    """What the checks read."""
    return (ANGLE, *machine.coils_of("xo", "yo"))


def needs(rig: RigFile) -> tuple[str, ...]:
    """What the checks ask the controller for."""
    return (*NEEDED, *(leaning.NEEDED if leaning.applies(rig) else ()))


def steps(rig: RigFile) -> int:
    """How many steps they record."""
    return STEPS + (leaning.STEPS if leaning.applies(rig) else 0)


def sound(rig: Rig, record: Recorder) -> bool:
    """Turn the released rotor a little, take up its angle, then push it along and across its first segment against
    the AMBs; lean on a motor that has a frame of its own."""
    if _turned(rig, record) < LEAST_RAD:
        write(rig, {"angle.ref": 0.0})
        return False
    write(rig, {"angle.ref": 0.0})
    hold.hold(rig)
    rig.clock.sleep(1.0)
    rest = _nudged(rig, record, 0.0, 0.0)
    up = _nudged(rig, record, 0.0, NUDGE_A)
    right = _nudged(rig, record, NUDGE_A, 0.0)
    write(rig, dict.fromkeys(NEEDED, 0.0))
    rig.clock.sleep(_ramp_s(rig.file) + NUDGE_S)
    pushed = _along(up[1] - rest[1], up[0] - rest[0]) and _along(right[0] - rest[0], right[1] - rest[1])
    return pushed and (not leaning.applies(rig.file) or leaning.sound(rig, record))


def written(rig: RigFile) -> list[tuple[dict[str, float], float]]:
    """The parameters that `sound` writes, one after the other, and how long each stands, s: where within its encoder's count a
    rotor comes to rest is a matter of how it was turned last."""
    turned = ({"angle.ref": TURN_RAD, "angle.kp": hold.PROBE_GAIN}, TURN_S)
    held = ({"angle.ref": 0.0} | {key: stated(rig, key).default for key in hold.GAINS}, 1.0)
    stands = _ramp_s(rig) + NUDGE_S
    along = [
        (0.0, 0.0, stands + NUDGE_S),
        (0.0, NUDGE_A, stands + NUDGE_S),
        (NUDGE_A, 0.0, stands + NUDGE_S),
        (0.0, 0.0, stands),
    ]
    pushed = [({"motor.across": x, "motor.along": y}, seconds) for x, y, seconds in along]
    return [(named(rig, values), seconds) for values, seconds in (turned, held, *pushed)]


def _turned(rig: Rig, record: Recorder) -> float:
    """How far a weak proportional gain turns the released rotor towards a reference ahead of it, rad; it is let go again."""
    before = rig.levitation.reading(ANGLE)
    with record.step("probe", reference_rad=before + TURN_RAD):
        write(rig, {"angle.ref": before + TURN_RAD, "angle.kp": hold.PROBE_GAIN})
        rig.clock.sleep(TURN_S)
        moved = math.remainder(rig.levitation.reading(ANGLE) - before, 2 * math.pi)
    hold.release(rig)
    return moved


def _along(own: float, across: float) -> bool:
    """A push by the motor relieves the outboard AMB along its own axis, and along the other one hardly at all."""
    return own < -LEAST_A and abs(across) < 0.5 * abs(own)


def _nudged(rig: Rig, record: Recorder, i_x: float, i_y: float) -> tuple[float, float]:
    """The outboard AMB's control currents across and along the motor's first segment, A, with open-loop currents in it: means,
    for noise makes single readings of a sound motor look like a push the other way."""
    write(rig, {"motor.across": i_x, "motor.along": i_y})
    rig.clock.sleep(_ramp_s(rig.file) + NUDGE_S)
    machine = conventions(rig.file)
    with record.step("nudge", i_x_A=i_x, i_y_A=i_y):
        seen = first_look.watched(rig, record, machine.coils_of("xo", "yo"), NUDGE_S)
    return machine.pushed(machine.control("xo", seen.__getitem__), machine.control("yo", seen.__getitem__))


def _ramp_s(rig: RigFile) -> float:
    motor = rig.capabilities.motor
    return 2 * NUDGE_A / (stated(rig, "motor.ramp").default if motor.ramp else 2.0)
