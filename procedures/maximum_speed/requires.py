"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import ANGLE, SPEED, STATUS
from procedures.servomotor import hold, wiring
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.servomotor.parameters import BIASES, needed

TURNED, DEMANDS, GIVEN, BOUND, SHARE = "angle", ("demand_x", "demand_y"), "torque_given", "torque_bound", "lambda"
ACROSS = ("i_d1", "i_d2", "i_d3", "i_d4")
"""What a capture of the controller calls the angle, what its law asks for, gives and allows, and the segments' currents
across the field."""

NEEDED = ("motor.share", "motor.share_slew", "motor.segment_limit", "motor.ramp", "motor.ref_along", "angle.speed")


def coils(machine: Servomotor) -> tuple[str, ...]:
    """The radial AMBs' currents."""
    return machine.coils_of("xi", "yi", "xo", "yo")


def channels(machine: Servomotor) -> tuple[str, ...]:
    """What is read of a window."""
    return (ANGLE, SPEED, STATUS, *machine.segments, *coils(machine))


def captured(machine: Servomotor) -> tuple[str, ...]:
    """What is captured in it."""
    return (TURNED, *_of_law(machine))


def _of_law(machine: Servomotor) -> tuple[str, ...]:
    return (*DEMANDS, GIVEN, BOUND, SHARE, *machine.segments, *ACROSS)


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    machine = conventions(rig)
    return Requires(
        lacks=machine.lacks,
        roles=("levitation", "rotation"),
        channels=(*channels(machine), *wiring.channels(machine)),
        sensors=(*machine.segments, *coils(machine)),
        parameters=needed(rig, *hold.NEEDED, *wiring.NEEDED, *BIASES, *NEEDED),
        capabilities=("settings.sharing", "settings.torque", "settings.commutation"),
        capture=captured(machine),
        machine=("pole_pairs", "segment_gain", "torque_ripple"),
        geometry=("motor_stiffness", "com_to_inboard_amb", "com_to_motor", "com_to_outboard_sensor"),
    )
