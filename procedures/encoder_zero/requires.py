"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from procedures.encoder_zero import groups
from procedures.encoder_zero.groups import ALONG
from procedures.position_loops.motors import periods_of


def requires(rig: RigFile) -> Requires:
    """By the names that the rig has."""
    needed = ("force_currents", "loop_injection", "current_steps", "motion")
    can = rig.capabilities
    if not groups.zeros(rig) or can.loop_injection is None or not can.current_steps:
        return Requires(capabilities=needed, capture=())
    of = groups.groups(rig)
    across = [(m, groups.zeros(rig)[m].added) for g in of for m, way in g.stepped if way != ALONG]
    lacks = [
        f"capabilities.force_currents.{m}.added: found none; its loop drives other motors, too"
        for m, p in across
        if not p
    ]
    return Requires(
        channels=(STATE, *(groups.loop_of(rig, g.loop).channel for g in of)),
        sensors=tuple(c for m in groups.zeros(rig) for c in rig.motors[m].currents),
        machine=periods_of(rig, "machine", groups.zeros(rig)),
        geometry=periods_of(rig, "geometry", groups.zeros(rig)),
        capabilities=needed,
        capture=tuple(dict.fromkeys(c for g in of for c in groups.captured(rig, g))),
        lacks=tuple(lacks),
    )
