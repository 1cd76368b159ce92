"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.errors import Lacking
from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from procedures.bearing_constant.stand import captured, planes


def requires(rig: RigFile) -> Requires:
    """By the names that the rig has."""
    needed = ("coil_map", "loop_injection", "motion")
    lacks: list[str] = []
    if not rig.hooks:
        lacks.append("hooks: found none; expected where masses hang on the mover")
    if rig.capabilities.coil_map is None or rig.capabilities.motion is None or rig.capabilities.loop_injection is None:
        return Requires(
            roles=("levitation", "operator"), capabilities=needed, masses=True, capture=(), lacks=tuple(lacks)
        )
    try:
        two = planes(rig)
    except Lacking as error:
        two = ()
        lacks.append(str(error))
    if len(two) != 2:
        lacks.append(f"capabilities.coil_map: found {len(two)} systems that give a radial force; expected two")
    return Requires(
        roles=("levitation", "operator"),
        channels=(STATE,),
        sensors=tuple(coil for plane in two for coil in plane.system.coils),
        capabilities=needed,
        capture=captured(rig) if two else (),
        masses=True,
        uses=("hold",),
        lacks=tuple(lacks),
    )
