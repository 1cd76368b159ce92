"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from procedures.unstable_pole.hold import ability, captured


def requires(rig: RigFile) -> Requires:
    """By the names that the rig has."""
    if rig.capabilities.hold is None:
        return Requires(capabilities=("hold",), capture=())
    named = {probe.channel for probe in rig.probes.values()}
    without = [c for axis in ability(rig).axes.values() for c in axis.positions if c not in named]
    lacks = (f"probes: found none of {', '.join(without)}; expected where they are along the shaft",) if without else ()
    return Requires(
        channels=(STATE,),
        capabilities=("hold",),
        capture=captured(rig),
        uses=("settings.observer", "motion"),
        lacks=lacks,
    )
