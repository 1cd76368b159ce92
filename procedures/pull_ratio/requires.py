"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from procedures.pull_ratio.planes import angles, currents, planes, positions


def requires(rig: RigFile) -> Requires:
    """By the names that the rig has."""
    wanted = ("coil_map", "loop_injection")
    if rig.capabilities.coil_map is None or rig.capabilities.loop_injection is None:
        return Requires(capabilities=wanted, capture=())
    found = planes(rig)
    lacks = []
    if len(found) != 2:
        lacks.append(f"capabilities.coil_map.systems: found {len(found)} that give a radial force; expected two")
    without = [c for p in found for c, loop in zip(p.system.axes, p.loops, strict=True) if not loop]
    if without:
        lacks.append(f"capabilities.loop_injection.loops: found no set_point of {', '.join(without)}")
    return Requires(
        channels=(*positions(rig), *angles(rig), STATE),
        sensors=(*positions(rig), *(coil for p in found for coil in p.system.coils)),
        capabilities=wanted,
        capture=(*positions(rig), *currents(rig), *angles(rig)),
        uses=("settings.observer", "motion", "hold", "force_currents"),
        lacks=tuple(lacks),
    )
