"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.places import channels
from procedures.amb_rotor.stations import COORDINATES
from procedures.bearing_model.inputs import as_printed, lacking


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    machine = conventions(rig)
    channels_of = (*machine.stations.channels, *machine.currents)
    moves = machine.unmoved(COORDINATES)
    return Requires(
        lacks=() if as_printed(rig) else (*lacking(rig), *moves),
        channels=channels(machine),
        sensors=channels_of,
        capabilities=("set_points",),
        uses=("bias", "settings.law", "settings.integrator", "current_limit"),
    )
