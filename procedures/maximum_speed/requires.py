"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from procedures.maximum_speed.steps import captured, channels, coils
from procedures.servomotor import hold, wiring
from procedures.servomotor.conventions import conventions
from procedures.servomotor.parameters import BIASES, needed

NEEDED = ("motor.share", "motor.share_slew", "motor.segment_limit", "motor.ramp", "motor.ref_along", "angle.speed")


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
