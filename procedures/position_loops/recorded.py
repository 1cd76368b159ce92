"""What can be wrong with what was recorded of a machine whose position loops hold it, whatever was done then: it was not
captured, or the loops did not hold it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Protocol

from bench.findings import Effect, Finding
from bench.rigfile import RigFile

LEVITATED = "LEVITATED"


class Placed(Protocol):
    """A step: `where` it was."""

    @property
    def where(self) -> str: ...


def not_captured(code: str, plural: str, missing: Sequence[Placed], many: int) -> Finding | None:
    """Of `many` steps those that are `missing` in captures."""
    if not missing:
        return None
    return Finding(code, f"{len(missing)} of {many} {plural} were not captured.", missing[0].where, Effect.ERROR)


def not_held(
    told: Iterable[tuple[str, Collection[str]]], rig: RigFile, code: str = "not-levitated", what: str = "shaft"
) -> Finding | None:
    """The first of the steps, each by where it was and the states that the controller was in, in which it did not levitate."""
    for where, states in told:
        if other := [s for s in states if rig.binding.mode(s) != LEVITATED]:
            text = f"the controller was in {', '.join(other)}: its loops did not hold the {what}."
            return Finding(code, text, where, Effect.ERROR)
    return None
