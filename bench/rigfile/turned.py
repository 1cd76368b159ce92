"""Whether something turns a rig's shaft."""

from __future__ import annotations

from bench.rigfile.model import RigFile

ROLES = frozenset({"rotation", "motion", "drive"})


def turned(rig: RigFile) -> bool:
    """Whether something may turn the shaft but a hand: a motor, a drive, a command that asks for it, or what counts its turns.
    Schema 1 could not say, so there it may. Motors of a shaft whose angle an encoder tells are no such thing: they turn it to
    an angle and hold it there, as others move it along. What moves along its encoders alone does not turn."""
    roles = {role for device in rig.devices.values() for role in device.roles}
    around = any(encoder.measures == "angle" for encoder in rig.encoders.values())
    spun = not around and any("torque" in motor.gives for motor in rig.motors.values())
    along = rig.encoders and not around
    stated = spun or rig.mark is not None or rig.written_in == 1 or roles & (ROLES - {"motion"} if along else ROLES)
    return bool(stated or "speed" in rig.channels or "SPIN" in rig.binding.commands)
