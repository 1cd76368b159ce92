"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import ANGLE, SPEED, STATUS, is_bound
from procedures.servomotor import hold
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.servomotor.parameters import BIASES, needed
from procedures.synchronous import mark


def coils(machine: Servomotor) -> tuple[str, ...]:
    """The radial AMBs' currents."""
    return machine.coils_of("xi", "xo", "yi", "yo")


def channels(machine: Servomotor) -> tuple[str, ...]:
    """What is recorded of a coast."""
    return (ANGLE, SPEED, STATUS, *machine.segments, *coils(machine))


def by_drive(rig: RigFile) -> bool:
    """Whether the controller has no motor of its own that turns the shaft."""
    return not any("rotation" in d.roles for d in rig.devices.values())


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    if by_drive(rig):
        return _of_drive(rig)
    machine = conventions(rig)
    return Requires(
        lacks=machine.lacks,
        roles=("levitation", "rotation"),
        channels=channels(machine),
        sensors=coils(machine),
        parameters=needed(rig, *hold.NEEDED, *BIASES, "angle.speed"),
    )


def _of_drive(rig: RigFile) -> Requires:
    """A drive, a mark, and the inertia; without a mark that counts, a motor would do as well."""
    inertia = "polar_inertia" in rig.machine or (rig.shaft is not None and rig.shaft.polar_inertia is not None)
    lacks = () if inertia else ("shaft.polar_inertia: found none; B is the decay rate times the inertia",)
    absent = ", ".join(role.partition(".")[2] for role in mark.needed(rig) if not is_bound(rig, role))
    if absent and any("drive" in d.roles for d in rig.devices.values()):
        none = f"devices: found none in the role rotation, and for a drive's run-downs the mark has no channel for {absent}"
        return Requires(lacks=(none, *lacks))
    return Requires(roles=("levitation", "drive"), channels=(*mark.needed(rig), STATUS), lacks=lacks)
