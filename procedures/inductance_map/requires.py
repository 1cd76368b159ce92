"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from procedures.stages.stators import POLES, Phase, axis, lacks, phases


def requires(rig: RigFile) -> Requires:
    """By the names that the rig has."""
    wanted, some = ("positioning", "phase_test"), phases(rig)
    if rig.capabilities.phase_test is None or rig.capabilities.positioning is None:
        return Requires(roles=("motion",), capabilities=wanted, capture=())
    test = rig.capabilities.phase_test
    missing = [key for key in ("current", "pulse") if not getattr(test, key)]
    unread = [p.name for p in some if not p.voltage]
    return Requires(
        roles=("motion", "operator"),
        channels=(STATE, *(a.channel for a in (axis(rig, "stroke"), axis(rig, "angle")) if a is not None),
                  *(p.current for p in some)),
        sensors=tuple(c for p in some for c in (p.current, p.voltage) if c),
        machine=(POLES,),
        capabilities=wanted,
        capture=tuple(c for p in some for c in (p.current, p.voltage) if c),
        lacks=(*lacks(rig, 2), *(f"capabilities.phase_test: found no {key}" for key in missing), *(_six(some)),
               *((f"capabilities.phase_test.voltages: found none of {', '.join(unread)}",) if unread else ())),
        uses=("model",),
    )  # fmt: skip


def _six(some: tuple[Phase, ...]) -> tuple[str, ...]:
    return () if len(some) == 6 else (f"capabilities.phase_test.phases: found {len(some)} of known motors; expected 6",)
