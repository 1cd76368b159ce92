"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile


def requires(rig: RigFile) -> Requires:
    """The winding's table, what captures read of it, and sensors of its currents that have certificates."""
    can = rig.capabilities.coil_map
    if can is None:
        return Requires(capabilities=("coil_map",))
    systems = can.systems.values()
    read = [name for s in systems for name in (s.read_d, s.read_q, s.angle)]
    return Requires(
        channels=can.axes,
        sensors=can.coils,
        parameters=(*(name for s in systems for name in (s.d, s.q)), *((can.lasts,) if can.lasts else ())),
        capture=tuple(dict.fromkeys((*can.coils, *can.bridges.values(), *read, *can.axes))),
        capabilities=("coil_map",),
    )
