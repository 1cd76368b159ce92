"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.recorded import AGE, COUNT
from bench.rigfile.roles import SPEED, STATUS
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.machine import AmbRotor
from procedures.amb_rotor.stations import NUDGES

LOOP = ("inject", "before", "after")


def telemetry_channels(machine: AmbRotor) -> tuple[str, ...]:
    """What is read of the telemetry."""
    return (*machine.stations.channels, *_axial(machine), STATUS, *((SPEED,) if machine.marked else ()))


def _axial(machine: AmbRotor) -> tuple[str, ...]:
    return (machine.position(machine.axial),) if machine.axial in machine.probes else ()


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    machine = conventions(rig)
    moves = machine.unmoved([c for c, _ in NUDGES])
    return Requires(
        lacks=(*machine.stations.lacks, *moves),
        channels=telemetry_channels(machine),
        capabilities=("set_points", "injection"),
        capture=(
            *LOOP,
            *((machine.pulsed or (COUNT, AGE)) if machine.marked else ()),
            *machine.all_currents,
        ),
        uses=("settings.law", "settings.lift", "injection.lines", "injection.step", "mark"),
    )
