"""Whether something turns a rig's shaft."""

from __future__ import annotations

from bench.rigfile.model import RigFile

ROLES = frozenset({"rotation", "motion", "drive"})


def turned(rig: RigFile) -> bool:
    """Whether something may turn the shaft but a hand: a motor, a drive, a command that asks for it, or what counts its turns.
    Schema 1 could not say, so there it may."""
    roles = {role for device in rig.devices.values() for role in device.roles}
    stated = rig.motors or rig.mark is not None or rig.written_in == 1 or roles & ROLES
    return bool(stated or "speed" in rig.channels or "SPIN" in rig.binding.commands)
