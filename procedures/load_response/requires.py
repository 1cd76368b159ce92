"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from procedures.load_response.sequence import INTEGRATORS
from procedures.stages.known_loads import loaded

NO_LOADS = (
    "hooks, levers: found none that load an axis both ways; expected hooks along the shaft to both ends, or levers on both "
    "sides"
)


def requires(rig: RigFile) -> Requires:
    """By the names that the rig has."""
    axes, wanted = loaded(rig), ("positioning", f"settings.{INTEGRATORS}")
    if rig.capabilities.positioning is None:
        return Requires(roles=("motion", "operator"), capabilities=wanted)
    lacks = [] if axes else [NO_LOADS]
    for axis in axes:
        bound = {"rate": axis.rate, "stiffness": axis.stiffness, "reference": axis.reference, "asked": axis.asked}
        if missing := [key for key, name in bound.items() if not name]:
            lacks.append(f"capabilities.positioning.axes.{axis.name}: found no {', '.join(missing)}")
    named = [c for a in axes for c in (a.channel, a.reference, a.asked, a.given) if c]
    return Requires(
        roles=("motion", "operator"),
        channels=(*dict.fromkeys(named), STATE),
        parameters=tuple(p for a in axes for p in (a.target, a.rate, a.stiffness, a.limit) if p),
        capabilities=wanted,
        masses=True,
        lacks=tuple(lacks),
    )
