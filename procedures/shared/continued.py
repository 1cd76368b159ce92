"""A run that goes on with a stopped one: which of its steps are done, where its halves meet, and what drifted between them.

What a procedure gives so that its run can be continued:

- in `continues` of its `Procedure` the kind of the steps that are an operator's work;
- an `acquire` that numbers these steps from 0 in the order of its plan, and asks `Done` of each number whether it is left out,
  and whether it is the one that is repeated; what a lift takes away (references, exercises, looks at the wiring) it does anew;
- findings of its own that hold the repeated step against the one that it repeats, by the scatter of its data: `drifted`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding
from bench.recording import Recording
from bench.recording.earlier import CONTINUED
from bench.recording.recorder import Recorder

DRIFTED = "drift-between-halves"
CHANCE = 1e-3  # that a sound run tells a drift, of all its axes together
MATTERS = 0.5  # of a result's U, by which it would move
ANEW = "Next: run it anew, all in one"


@dataclass(frozen=True)
class Done:
    """The `labels` of the steps of a kind that a stopped run had completed, a beginning of what the plan asks for; none in a
    run of its own."""

    labels: tuple[Mapping[str, Any], ...]

    def leaves_out(self, number: int) -> bool:
        """Whether a step need not be done: neither it nor that it is repeated."""
        return number < len(self.labels) - 1

    def repeats(self, number: int) -> bool:
        """Whether it is the last one that was done, which is done again as a step of its own kind (`record_step`)."""
        return number == len(self.labels) - 1


def done(record: Recorder, kind: str) -> Done:
    """What a stopped run had completed that this one continues."""
    return Done(record.completed(kind))


def half_of(recording: Recording[Any], start_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """The number of the half, from 0, in which each of the steps began; halves without any of them are not counted."""
    seams = np.array([int(e["t_ns"]) for e in recording.events(CONTINUED)], np.int64)
    after = np.searchsorted(seams, start_ns)
    return np.unique(after, return_inverse=True)[1].reshape(after.shape).astype(np.int64)


def drifted(text: str, where: str, shares: float, suspects: str) -> Finding:
    """What is told of a drift: an indeterminate finding where results would move by more than MATTERS of their U, else a note.
    `shares`: by which they would move, of their U; `suspects`: what may have drifted."""
    if shares > MATTERS:
        more = f": something drifted between the halves, {suspects}. {ANEW}"
        return Finding(DRIFTED, text + more, where, Effect.INDETERMINATE)
    return Finding(DRIFTED, text, where, Effect.NOTE)
