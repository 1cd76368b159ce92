"""Which sample each message of several a sample belongs to.

Low bits alone do not say which sample a message belongs to: after a loss of 16 samples a count of 4 bits is the same
again. So messages wait for the next SYNC, which says how far the sequence went on meanwhile. A count is then read as the
sample of that SYNC or one of a few before it, never one that is yet to come; the counts between are left out and
counted. So a row is never made of parts of different samples, as long as no message comes later than its count goes
round, less the sample that is due: 14 samples with 4 bits. What is later than that, no reader can tell from the count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

Values = npt.NDArray[np.float64]
KEPT = 8  # samples that may wait for a late message


@dataclass
class Sample:
    """What has come of one sample: raw counters and host time of its SYNC, SI values by part."""

    values: list[Values | None]
    sequence: int = 0
    tick: int = 0
    arrived: int = 0


@dataclass
class Joiner:
    """Joins the messages of a sample. Inside, sequence numbers do not wrap.

    Args:
        sequence_bits: of the number in SYNC.
        count_bits: of the counts in the other messages.
    """

    sequence_bits: int
    count_bits: Sequence[int]
    misplaced: int = 0
    _newest: int | None = None
    _pending: list[tuple[int, int, Values]] = field(default_factory=list)  # part, count, values since the newest SYNC
    _waiting: dict[int, Sample] = field(default_factory=dict)

    @property
    def fresh(self) -> bool:
        """Nothing is there but the newest SYNC."""
        if self._pending or list(self._waiting) != [self._newest]:
            return False
        (sample,) = self._waiting.values()
        return sample.values[0] is not None and all(v is None for v in sample.values[1:])

    def go_on(self, count: int, newest: Sample) -> None:
        """So many samples were complete in between; `newest` is of the SYNC after them."""
        assert self._newest is not None
        self._newest += count
        self._waiting = {self._newest: newest}

    def data(self, part: int, count: int, values: Values) -> None:
        """One message that is not SYNC; `part` counts from 1."""
        if self._newest is not None and len(self._pending) < 1 << 12:  # without SYNC nothing can be told
            self._pending.append((part, count, values))

    def sync(self, sequence: int, tick: int, arrived: int, values: Values) -> list[Sample]:
        """One SYNC: settles where the messages since the one before belong; the samples that are complete by now."""
        half, size = 1 << (self.sequence_bits - 1), 1 << self.sequence_bits
        if self._newest is None:
            self._newest = sequence
        ahead = (sequence - self._newest + half) % size - half
        number = self._newest + ahead
        if ahead > 0:
            self._settle(ahead)
            self._newest = number
        elif ahead < -KEPT:  # the controller has started anew
            self._pending.clear()
            self._waiting.clear()
            self._newest = number
        sample = self._waiting.setdefault(number, Sample([None] * (len(self.count_bits) + 1)))
        if sample.values[0] is not None and sample.tick != tick:  # started anew while its numbers were still small
            self._pending.clear()
            self._waiting.clear()
            sample = self._waiting[number] = Sample([None] * (len(self.count_bits) + 1))
        sample.values[0], sample.sequence, sample.tick, sample.arrived = values, sequence, tick, arrived
        return self._complete()

    def _settle(self, ahead: int) -> None:
        """Give what waited its sequence numbers: up to that of the SYNC that came now, down to a few before."""
        assert self._newest is not None
        due = self._newest + ahead
        for part, count, values in self._pending:
            size = 1 << self.count_bits[part - 1]
            slack = (size - 1 - ahead) // 2  # samples that a message may be late; as many are left between
            if slack < max(1, size // 8):
                self.misplaced += 1  # too much is missing to tell which sample this belongs to
                continue
            low = self._newest - slack
            number = low + (count - low) % size
            if not due - KEPT <= number <= due:
                self.misplaced += 1
                continue
            sample = self._waiting.setdefault(number, Sample([None] * (len(self.count_bits) + 1)))
            sample.values[part] = values
        self._pending.clear()

    def _complete(self) -> list[Sample]:
        assert self._newest is not None
        done = [n for n, s in self._waiting.items() if all(v is not None for v in s.values)]
        out = [self._waiting.pop(n) for n in sorted(done)]
        for number in [n for n in self._waiting if abs(self._newest - n) > KEPT]:
            del self._waiting[number]
        return out
