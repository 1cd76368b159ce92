"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from procedures.emf_constant.moves import windings
from procedures.position_loops.motors import periods_of


def requires(rig: RigFile) -> Requires:
    """By the names that the rig has."""
    wanted, of, can = ("force_currents", "coil_map", "current_steps", "motion"), windings(rig), rig.capabilities
    if can.motion is None or can.coil_map is None or not can.force_currents or not can.current_steps:
        return Requires(capabilities=wanted, capture=())
    if not of:
        return Requires(
            capabilities=wanted, capture=(), lacks=("capabilities.current_steps: found voltages of no motor's coils",)
        )
    channels = tuple(n for w in of.values() for n in (w.channel, *w.coils, *w.voltages.values()))
    return Requires(
        channels=(STATE,),
        sensors=tuple(n for w in of.values() for n in (*w.coils, *w.voltages.values())),
        machine=periods_of(rig, "machine", of),
        geometry=periods_of(rig, "geometry", of),
        capabilities=wanted,
        capture=tuple(dict.fromkeys(channels)),
    )
