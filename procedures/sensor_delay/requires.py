"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from procedures.position_loops.injection import FORCE
from procedures.sensor_delay.sines import captured, probes


def requires(rig: RigFile) -> Requires:
    """By the names that the rig has."""
    wanted, can, some = ("loop_injection", "hold"), rig.capabilities.loop_injection, probes(rig)
    if can is None or rig.capabilities.hold is None:
        return Requires(capabilities=wanted, capture=())
    lacks = [] if FORCE in can.places else ["capabilities.loop_injection.places: found no force"]
    lacks += [] if some else ["capabilities.loop_injection.loops: found none of a position of capabilities.hold.axes"]
    return Requires(channels=(STATE,), capabilities=wanted, capture=captured(rig), lacks=tuple(lacks))
