"""Before the AMB stand turns: how its shaft lies on the rings, its lift, and small nudges that show whose reading is whose.

What is recorded here is judged by `procedures.amb_rotor.wiring.before_orbits`; the nudges are judged here already.
"""

from __future__ import annotations

from collections.abc import Mapping

from bench.errors import DeviceFault, NotReached
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.procedure.states import transition
from bench.recording.recorder import Recorder
from procedures.amb_rotor import liftable, nudges, pushes, rings
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.nudges import PROBE, Nudge
from procedures.amb_rotor.stations import NUDGES
from procedures.shared import first_look

REST, LIFT = "rest", "lift"
LIFT_LOST, NO_SPEED = "lift-lost", "no-speed"
NEAR = 0.11  # of the least clearance, that a nudge moves the shaft by at a bearing, at most
STEPS = 2 + 2 * len(NUDGES)  # that `lift_and_nudge` records


def lift_and_nudge(rig: Rig, record: Recorder) -> bool:
    """Lift the shaft from its rings and nudge it; False where it must not or cannot be lifted, or where nudges show that it is
    wired wrong and nobody says to go on: the analysis tells."""
    machine = conventions(rig.file)
    with record.step(REST):
        rig.clock.sleep(0.3)
    if any(rings.of_readings({name: rig.levitation.reading(name) for name in machine.stations.channels}, rig.file)):
        return False  # it lies below, on its rings: a probe that says otherwise may close a loop the wrong way round
    if any(pushes.judge(pushes.ask(rig, record), rig.file)):
        return False  # the analysis tells
    if not first_look.passes(rig, record, liftable.judge(rig.file, record.calibrations)):
        return False  # its bearings cannot lift it
    if not _lift(rig, record):
        return False
    return first_look.passes(rig, record, nudges.judge(_nudge(rig, record), rig.file))


def write(rig: Rig, values: Mapping[str, float]) -> None:
    """Write parameters of the controller, in that order; those of one message in one message."""
    rig.levitation.write(values)


def bring_to_speed(rig: Rig, record: Recorder, rad_s: float, settle_s: float) -> bool:
    """Bring the shaft to a speed; False where it does not get there, which the analysis tells."""
    try:
        if rig.drive is None:
            raise NotReached("the rig has no drive")
        rig.drive.reach(rad_s)
    except NotReached as error:
        record.event(NO_SPEED, wanted=rad_s, why=str(error))
        return False
    rig.clock.sleep(settle_s)
    return True


def _lift(rig: Rig, record: Recorder) -> bool:
    with record.step(LIFT):
        try:
            transition(rig, RigState.LEVITATED)
            rig.clock.sleep(0.5)
        except DeviceFault as fault:
            record.event(LIFT_LOST, fault=str(fault))
            return False
    return True


def _nudge(rig: Rig, record: Recorder) -> list[Nudge]:
    machine, made = conventions(rig.file), []
    names = nudges.watched(machine, tuple(rig.file.channels))
    for coordinate, most in NUDGES:
        aside = min(most, NEAR * machine.clearance / max(map(abs, machine.stations.moved({coordinate: 1.0}).values())))
        points, read = machine.point(coordinate, 0.0), []
        name = next(iter(points)) if len(points) == 1 else coordinate  # as the recording has it
        for value in (0.0, aside):
            write(rig, machine.point(coordinate, value))
            rig.clock.sleep(0.5)
            with record.step(PROBE, name=name, value=value):
                read.append(first_look.watched(rig, record, names, 0.2))
        write(rig, points)
        made.append(Nudge(name, aside, *read))
    rig.clock.sleep(0.5)
    return made
