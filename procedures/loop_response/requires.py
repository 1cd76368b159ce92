"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from procedures.loop_response.injection import REFERENCE


def requires(rig: RigFile) -> Requires:
    """By the names that the rig has."""
    can = rig.capabilities.loop_injection
    if can is None:
        return Requires(capabilities=("loop_injection",), capture=())
    shown = tuple(dict.fromkeys(loop.channel for loop in can.loops.values()))
    return Requires(
        channels=(*shown, STATE),
        capabilities=("loop_injection",),
        capture=(*shown, *([can.wave] if can.wave else [])),
        lacks=() if REFERENCE in can.places else ("capabilities.loop_injection.places: found no reference",),
    )
