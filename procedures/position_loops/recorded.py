"""What can be wrong with what was recorded of a machine whose position loops hold it, whatever was done then: it was not
captured, the loops did not hold it, samples are missing."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import Protocol

import numpy as np

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from procedures.shared import signals

LEVITATED = "LEVITATED"


class Placed(Protocol):
    """A step: `where` it was."""

    @property
    def where(self) -> str: ...


class Recorded(Placed, Protocol):
    """And how many of the `expected` samples are `lost`."""

    @property
    def lost(self) -> int: ...
    @property
    def expected(self) -> int: ...


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


def losses(taken: Sequence[Recorded], allowed: float) -> Iterator[Finding]:
    """As `procedures.shared.signals.losses`, of steps."""
    lost, expected = np.array([(t.lost, t.expected) for t in taken], dtype=float).T
    yield from signals.losses(lost, expected, allowed, lambda share: taken[int(np.argmax(share))].where)
