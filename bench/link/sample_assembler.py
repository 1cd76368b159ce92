"""From telemetry frames to rows of values: one message a sample (CAN FD, serial), or several on classic CAN.

On classic CAN the first message (SYNC) carries sequence and tick, each other one the low bits of the sequence it belongs
to. A sample is complete when all its messages came; one that stays incomplete is lost and shows as a gap.

Low bits alone do not say which sample a message belongs to: after a loss of 16 samples a count of 4 bits is the same
again. So messages wait for the next SYNC, which says how far the sequence went on meanwhile. A count is then read as the
sample of that SYNC or one of a few before it, never one that is yet to come; the counts between are left out and
counted. So a row is never made of parts of different samples, as long as no message comes later than its count goes
round, less the sample that is due: 14 samples with 4 bits. What is later than that, no reader can tell from the count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from bench import units
from bench.link.codec import Decoder
from bench.link.frames import FrameBatch
from bench.rigfile import RigFile
from bench.rigfile.messages import Message

Values = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
KEPT = 8  # samples that may wait for a late message


@dataclass(frozen=True)
class Rows:
    """n samples in order of arrival: counters as they came, host times, SI values by channel."""

    sequence: Integers
    tick: Integers
    arrived: Integers
    columns: dict[str, Values]
    table: Values | None = None
    """The columns as (channels, n), where they are rows of one array."""

    def last(self) -> dict[str, float]:
        """The newest sample by channel."""
        if self.table is not None:  # one look for all of them
            return dict(zip(self.columns, self.table[:, -1].tolist(), strict=True))
        return {name: float(x[-1]) for name, x in self.columns.items()}

    def __len__(self) -> int:
        return len(self.sequence)


@dataclass(frozen=True)
class _Part:
    """One telemetry message: its decoder, and its channels with factors and offsets to SI (channels, 1)."""

    message: Message
    decoder: Decoder
    channels: tuple[str, ...]
    rows: list[int]  # of the channels' signals in the decoder's table
    factors: Values
    offsets: Values

    def si(self, table: Values) -> Values:
        """Values (channels, n) in SI of a table of the decoder."""
        if self.plain:  # it is SI already: nothing is copied
            return table[self.rows[0] : self.rows[-1] + 1]
        return table[self.rows] * self.factors + self.offsets

    @cached_property
    def plain(self) -> bool:
        """Whether the channels are neighbours in the table, in its order and in SI."""
        neighbours = bool(self.rows) and self.rows == list(range(self.rows[0], self.rows[0] + len(self.rows)))
        return neighbours and bool((self.factors == 1).all() and (self.offsets == 0).all())

    def integers(self, table: Values, signal: str) -> Integers:
        """A signal as it came."""
        out: Integers = table[self.decoder.names.index(signal)].astype(np.int64)
        return out


@dataclass
class _Sample:
    """What has come of one sample: raw counters and host time of its SYNC, SI values by part."""

    values: list[Values | None]
    sequence: int = 0
    tick: int = 0
    arrived: int = 0


@dataclass
class _Frames:
    """The frames of one part in a batch: what it counts by, ticks (SYNC only), SI values (n, channels), host times."""

    count: list[int]
    tick: list[int]
    values: Values
    arrived: list[int]


class Assembler:
    """Takes the telemetry of one rig apart; `wrong_length` and `misplaced` count frames that were left out."""

    def __init__(self, rig: RigFile) -> None:
        b = rig.binding
        self._binding = b
        self.wrong_length = 0
        self._parts = [_part(rig, rig.messages[name]) for name in b.telemetry]
        sync = self._parts[0].message
        self.sequence_bits = sync.signal(b.sequence).length
        self.tick_bits = sync.signal(b.tick).length
        self._joiner = Joiner(self.sequence_bits, [p.message.signal(b.counter).length for p in self._parts[1:]])

    @property
    def misplaced(self) -> int:
        """Messages too late or too early to tell their samples."""
        return self._joiner.misplaced

    def take(self, batch: FrameBatch) -> Rows:
        """The samples that a batch completes."""
        if len(self._parts) == 1:
            return self._single(batch)
        return self._several(batch)

    def _single(self, batch: FrameBatch) -> Rows:
        part, b = self._parts[0], self._binding
        frames, wrong = part.decoder.chosen(batch)
        self.wrong_length += wrong
        table = part.decoder.table(frames["data"])
        sequence, tick = (part.integers(table, name) for name in (b.sequence, b.tick))
        si = part.si(table)
        return Rows(sequence, tick, frames["t_ns"], dict(zip(part.channels, si, strict=True)), si)

    def _several(self, batch: FrameBatch) -> Rows:
        kind = np.full(len(batch), -1)
        frames = []
        for k, part in enumerate(self._parts):
            mine, wrong = part.decoder.chosen(batch)
            self.wrong_length += wrong
            kind[(batch["id"] == part.message.identifier) & (batch["length"] == part.message.length)] = k
            frames.append(self._frames(part, mine))
        done: list[_Sample] = []
        place = [0] * len(frames)
        for k in kind[kind >= 0].tolist():
            f, j = frames[k], place[k]
            place[k] += 1
            if k == 0:
                done += self._joiner.sync(f.count[j], f.tick[j], f.arrived[j], f.values[j])
            else:
                self._joiner.data(k, f.count[j], f.values[j])
        return self._rows(done)

    def _frames(self, part: _Part, mine: FrameBatch) -> _Frames:
        b, first = self._binding, part is self._parts[0]
        table = part.decoder.table(mine["data"])
        counts = part.integers(table, b.sequence if first else b.counter).tolist()
        ticks = part.integers(table, b.tick).tolist() if first else []
        return _Frames(counts, ticks, np.ascontiguousarray(part.si(table).T), mine["t_ns"].tolist())

    def _rows(self, done: list[_Sample]) -> Rows:
        names = [n for p in self._parts for n in p.channels]
        table = np.array([np.concatenate([v for v in s.values if v is not None]) for s in done])
        table = table.reshape(len(done), len(names))
        counters = np.array([(s.sequence, s.tick, s.arrived) for s in done], np.int64).reshape(len(done), 3)
        columns = dict(zip(names, np.ascontiguousarray(table.T), strict=True))
        return Rows(counters[:, 0], counters[:, 1], counters[:, 2], columns)


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
    _waiting: dict[int, _Sample] = field(default_factory=dict)

    def data(self, part: int, count: int, values: Values) -> None:
        """One message that is not SYNC; `part` counts from 1."""
        if self._newest is not None and len(self._pending) < 1 << 12:  # without SYNC nothing can be told
            self._pending.append((part, count, values))

    def sync(self, sequence: int, tick: int, arrived: int, values: Values) -> list[_Sample]:
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
        sample = self._waiting.setdefault(number, _Sample([None] * (len(self.count_bits) + 1)))
        if sample.values[0] is not None and sample.tick != tick:  # started anew while its numbers were still small
            self._pending.clear()
            self._waiting.clear()
            sample = self._waiting[number] = _Sample([None] * (len(self.count_bits) + 1))
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
            sample = self._waiting.setdefault(number, _Sample([None] * (len(self.count_bits) + 1)))
            sample.values[part] = values
        self._pending.clear()

    def _complete(self) -> list[_Sample]:
        assert self._newest is not None
        done = [n for n, s in self._waiting.items() if all(v is not None for v in s.values)]
        out = [self._waiting.pop(n) for n in sorted(done)]
        for number in [n for n in self._waiting if abs(self._newest - n) > KEPT]:
            del self._waiting[number]
        return out


def _part(rig: RigFile, message: Message) -> _Part:
    decoder = Decoder(message)
    paths = {name: channel.signal.split(".") for name, channel in rig.channels.items()}
    signals = {name: signal for name, (owner, signal) in paths.items() if owner == message.name}
    si = [units.UNITS[message.signal(s).unit] for s in signals.values()]
    rows = [decoder.names.index(s) for s in signals.values()]
    factors, offsets = np.array([(u.factor, u.offset) for u in si]).reshape(len(si), 2).T[:, :, None]
    return _Part(message, decoder, tuple(signals), rows, factors, offsets)
