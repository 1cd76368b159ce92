"""What can be wrong with what was recorded of a stage, whatever was done then: its axes were not held."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.rigfile.binding import STAGE_HELD


def not_held(told: Iterable[tuple[str, Collection[str]]], rig: RigFile) -> Finding | None:
    """The first of the steps, each by where it was and the states that the controller was in, in which it did not hold its
    axes."""
    for where, states in told:
        if other := [s for s in states if rig.binding.mode(s) not in STAGE_HELD]:
            text = f"the controller was in {', '.join(other)}: it did not hold the axes"
            return Finding("axis-not-held", text, where, Effect.ERROR)
    return None
