"""From telemetry frames to rows of values: one message a sample (CAN FD, serial), or several on classic CAN.

On classic CAN the first message (SYNC) carries sequence and tick, each other one the low bits of the sequence it belongs
to. A sample is complete when all its messages came; one that stays incomplete is lost and shows as a gap
(`bench.link.joining`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from bench import units
from bench.link.beside import beside, name_in, width_of
from bench.link.codec import Decoder
from bench.link.frames import FrameBatch
from bench.link.joining import Joiner, Sample
from bench.rigfile import RigFile
from bench.rigfile.binding import Binding
from bench.rigfile.messages import Message

Values = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


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
class _Frames:
    """The frames of one part in a batch: what it counts by, ticks (SYNC only), SI values (n, channels), host times."""

    count: Integers
    tick: Integers
    values: Values
    arrived: Integers


class _Whole:
    """All messages of a sample as one long one, to read those of many samples at once where they follow each other in order."""

    def __init__(self, parts: list[_Part], binding: Binding) -> None:
        messages = [p.message for p in parts]
        self._lengths = np.array([m.length for m in messages])
        identifiers = np.array([m.identifier for m in messages], np.uint32)
        self._sorted = np.argsort(identifiers)
        self._identifiers = identifiers[self._sorted]
        self._width, self._decoder = width_of(messages), Decoder(beside(messages))
        row = {name: k for k, name in enumerate(self._decoder.names)}
        self._rows = [[row[name_in(p.message, p.decoder.names[k])] for k in p.rows] for p in parts]  # of the channels
        counts = [binding.sequence, *[binding.counter] * (len(parts) - 1)]
        self._counts = [row[name_in(m, name)] for m, name in zip(messages, counts, strict=True)]
        self._tick = row[name_in(messages[0], binding.tick)]
        self._parts = parts

    def kinds(self, batch: FrameBatch) -> tuple[Integers, int]:
        """Which message each frame is, -1 for none of them; and how many have an identifier of theirs but another length."""
        at = np.minimum(np.searchsorted(self._identifiers, batch["id"]), len(self._identifiers) - 1)
        mine, kinds = self._identifiers[at] == batch["id"], self._sorted[at]
        right = mine & (batch["length"] == self._lengths[kinds])
        return np.where(right, kinds, -1), int(np.count_nonzero(mine)) - int(np.count_nonzero(right))

    def in_order(self, kinds: Integers) -> bool:
        """Whether there are any, and they follow each other as they do in a sample, over and over."""
        return len(kinds) > 0 and bool(((kinds[0] + np.arange(len(kinds))) % len(self._parts) == kinds).all())

    def frames(self, chosen: FrameBatch, first: int) -> list[_Frames]:
        """The frames of each part, of some in order that begin with that part."""
        parts = len(self._parts)
        samples = -(-(first + len(chosen)) // parts)
        of_last = first + len(chosen) - (samples - 1) * parts  # parts that have a frame in the last sample
        payloads = np.zeros((samples * parts, self._width), np.uint8)
        payloads[first : first + len(chosen)] = chosen["data"][:, : self._width]
        table = self._decoder.table(payloads.reshape(samples, -1))
        out = []
        for k, part in enumerate(self._parts):
            mine = slice(int(k < first), samples - int(k >= of_last))
            values = table[self._rows[k], mine]
            if not part.plain:
                values = values * part.factors + part.offsets
            tick = table[self._tick, mine].astype(np.int64) if not k else np.empty(0, np.int64)
            arrived = chosen["t_ns"][(k - first) % parts :: parts]
            out.append(
                _Frames(table[self._counts[k], mine].astype(np.int64), tick, np.ascontiguousarray(values.T), arrived)
            )
        return out


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
        self._whole = _Whole(self._parts, b)

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
        kind, wrong = self._whole.kinds(batch)
        self.wrong_length += wrong
        mine = kind >= 0
        kinds, chosen = (kind, batch) if mine.all() else (kind[mine], batch[mine])
        if self._whole.in_order(kinds):
            frames = self._whole.frames(chosen, int(kinds[0]))
        else:
            frames = [self._frames(part, chosen[kinds == k]) for k, part in enumerate(self._parts)]
        place = [0] * len(frames)
        low = int(np.argmax(kinds == 0)) + 1 if (kinds == 0).any() else len(kinds)
        done = self._joined(kinds[:low], frames, place)
        cycles = self._regular(kinds[low:], frames, place) if self._joiner.fresh else 0
        between = self._at_once(frames, place, cycles)
        after = self._joined(kinds[low + cycles * len(frames) :], frames, place)
        return _chained(self._rows(done), between, self._rows(after))

    def _regular(self, kinds: Integers, frames: list[_Frames], place: list[int]) -> int:
        """How many samples follow a SYNC each whole and in one order, with its count, before the SYNC of the next number. These
        are most of any stream, and need no look at single messages."""
        parts = len(frames)
        rows = kinds[: len(kinds) // parts * parts].reshape(-1, parts)
        if not len(rows) or rows[0, -1] != 0 or len(set(rows[0].tolist())) != parts or min(self._joiner.count_bits) < 2:
            return 0
        count = len(rows)
        first = place[0] - 1
        numbers = frames[0].count[first : first + count + 1]
        fine = (rows == rows[0]).all(axis=1)
        fine[len(numbers) - 1 :] = False
        for k, bits in enumerate(self._joiner.count_bits, 1):
            theirs = frames[k].count[place[k] : place[k] + count]
            n = min(len(theirs), len(numbers) - 1)
            fine[:n] &= (theirs[:n] - numbers[:n]) % (1 << bits) == 0
            fine[n:] = False
        n = len(numbers) - 1
        fine[:n] &= np.diff(numbers) % (1 << self.sequence_bits) == 1
        return count if fine.all() else int(np.argmin(fine))

    def _joined(self, kinds: Integers, frames: list[_Frames], place: list[int]) -> list[Sample]:
        """The samples that messages of these kinds complete, one message after the other; `place` goes on with them."""
        done: list[Sample] = []
        for k in kinds.tolist():
            f, j = frames[k], place[k]
            place[k] += 1
            if k == 0:
                done += self._joiner.sync(int(f.count[j]), int(f.tick[j]), f.arrived[j], f.values[j])
            else:
                self._joiner.data(k, int(f.count[j]), f.values[j])
        return done

    def _at_once(self, frames: list[_Frames], place: list[int], cycles: int) -> Rows:
        """So many samples of `_regular`, from the newest SYNC on."""
        if not cycles:
            return self._rows([])
        sync, first = frames[0], place[0] - 1
        last = first + cycles
        starts = [first, *place[1:]]
        table = np.concatenate([f.values[at : at + cycles] for f, at in zip(frames, starts, strict=True)], axis=1)
        place[:] = [at + cycles for at in place]
        newest = Sample(
            [sync.values[last]] + [None] * (len(frames) - 1),
            int(sync.count[last]), int(sync.tick[last]), int(sync.arrived[last]),
        )  # fmt: skip
        self._joiner.go_on(cycles, newest)
        return self._table(table, sync.count[first:last], sync.tick[first:last], sync.arrived[first:last])

    def _frames(self, part: _Part, mine: FrameBatch) -> _Frames:
        b, first = self._binding, part is self._parts[0]
        table = part.decoder.table(mine["data"])
        counts = part.integers(table, b.sequence if first else b.counter)
        ticks = part.integers(table, b.tick) if first else np.empty(0, np.int64)
        return _Frames(counts, ticks, np.ascontiguousarray(part.si(table).T), mine["t_ns"])

    def _rows(self, done: list[Sample]) -> Rows:
        width = sum(len(p.channels) for p in self._parts)
        table = np.array([np.concatenate([v for v in s.values if v is not None]) for s in done]).reshape(
            len(done), width
        )
        counters = np.array([(s.sequence, s.tick, s.arrived) for s in done], np.int64).reshape(len(done), 3)
        return self._table(table, *counters.T)

    def _table(self, table: Values, sequence: Integers, tick: Integers, arrived: Integers) -> Rows:
        names = [n for p in self._parts for n in p.channels]
        return Rows(sequence, tick, arrived, dict(zip(names, np.ascontiguousarray(table.T), strict=True)))


def _chained(*blocks: Rows) -> Rows:
    """Rows one after the other, as one."""
    some = [b for b in blocks if len(b)]
    if len(some) < 2:
        return some[0] if some else blocks[0]
    sequence, tick, arrived = (np.concatenate([getattr(b, x) for b in some]) for x in ("sequence", "tick", "arrived"))
    return Rows(sequence, tick, arrived, {n: np.concatenate([b.columns[n] for b in some]) for n in some[0].columns})


def _part(rig: RigFile, message: Message) -> _Part:
    decoder = Decoder(message)
    paths = {name: channel.signal.split(".") for name, channel in rig.channels.items()}
    signals = {name: signal for name, (owner, signal) in paths.items() if owner == message.name}
    si = [units.UNITS[message.signal(s).unit] for s in signals.values()]
    rows = [decoder.names.index(s) for s in signals.values()]
    factors, offsets = np.array([(u.factor, u.offset) for u in si]).reshape(len(si), 2).T[:, :, None]
    return _Part(message, decoder, tuple(signals), rows, factors, offsets)
