"""From telemetry frames to sample blocks on the sample clock, with every loss, duplicate and reordering counted."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from bench import units
from bench.clock import TickClock
from bench.errors import LinkError
from bench.link.frames import ERROR, FrameBatch
from bench.link.hosttime import HostMap
from bench.link.sample_assembler import Assembler, Rows
from bench.link.stillness import CODES, Stillness
from bench.link.unwrapping import Unwrapping, signed
from bench.rigfile import RigFile, roles
from bench.samples import ChannelInfo, SampleBlock, StreamLayout
from bench.wire import sign

Integers = npt.NDArray[np.int64]
STREAM = "telemetry"
REMEMBERED = 2000
REBOOT_S = 1.0  # a tick so far in the past is a restart, not a late frame
STALE = 100  # old samples in a row that are no repetition any more


@dataclass
class Counters:
    """What went wrong on the way, as the telemetry's own counters show it."""

    gaps: int = 0
    lost: int = 0
    late: int = 0  # came after their successors had been taken; they stay lost
    duplicates: int = 0
    reordered: int = 0
    wrong_length: int = 0
    unknown: int = 0  # frames whose identifier is not in the DBC
    reboots: int = 0
    misplaced: int = 0  # messages on classic CAN too late or too early to tell their sample
    sequence_leaps: int = 0  # the sequence went further than its tick
    tick_leaps: int = 0  # the tick went further than its sequence


@dataclass
class _Segment:
    """Since the controller started: offset of the sample clock, and the last sequence number and tick, unwrapped, and
    that sequence number as it came."""

    offset_ns: int
    sequence: int
    tick: int
    raw: int


@dataclass
class TelemetryDecoder:
    """Decodes the telemetry of a rig. Keeps `latest` by channel for drivers."""

    rig: RigFile
    counters: Counters = field(default_factory=Counters)
    latest: dict[str, float] = field(default_factory=dict)
    host: HostMap = field(default_factory=HostMap)
    stillness: Stillness = field(default_factory=Stillness)

    def __post_init__(self) -> None:
        self._assembler = Assembler(self.rig)
        self._first = self.rig.messages[self.rig.binding.telemetry[0]]
        self._clock = TickClock(self.rig.devices["controller"].tick_s)
        self._ticks = self._clock.ticks(self._first.period_s)  # of a sample
        self._known = {sign.IDENTIFIER, *(m.identifier for m in self.rig.messages.messages.values())}
        self._segment: _Segment | None = None
        self._index = 0
        self._stale, self._stale_tick = 0, 0  # samples in a row that were old, and the tick of the last
        self._missing: set[int] = set()  # sequence numbers that may still come late

    @property
    def layout(self) -> StreamLayout:
        """The stream as it is recorded."""
        whole = roles.whole_channels(self.rig)
        return StreamLayout(
            STREAM,
            self.period_ns,
            tuple(
                ChannelInfo(name, units.UNITS[c.unit].si, "u2" if name in CODES else "f8" if name in whole else "f4")
                for name, c in self.rig.channels.items()
            ),
        )

    @property
    def newest_ns(self) -> int:
        """Time of the newest sample on the sample clock; 0 before the first."""
        s = self._segment
        return s.offset_ns + self._clock.ns(s.tick) if s is not None else 0

    def placed(self, tick: int) -> tuple[int, int]:
        """A tick of 32 bits that the controller named: as the telemetry counts it, and its time on the sample clock.

        Raises:
            LinkError: no telemetry has come.
        """
        s = self._segment
        if s is None:
            raise LinkError("no telemetry has come: a tick of the controller has no time yet")
        whole = s.tick + int(signed(np.array(tick - s.tick), 32))
        return whole, s.offset_ns + self._clock.ns(whole)

    @property
    def period_ns(self) -> int:
        """From one sample to the next."""
        return round(self._first.period_s * 1e9)

    def start_counting(self) -> None:
        """The next sample is number 0 of the stream, and what was lost before it does not count."""
        self._index = 0
        self.counters.gaps = self.counters.lost = self.counters.sequence_leaps = self.counters.tick_leaps = 0

    def decode(self, batch: FrameBatch) -> list[SampleBlock]:
        """Blocks of consecutive samples, in order; a gap starts a new block with `lost_before`."""
        destroyed = batch["flags"] & ERROR
        good = batch[destroyed == 0] if destroyed.any() else batch
        identifiers = good["id"].tolist()
        if not self._known.issuperset(identifiers):
            self.counters.unknown += sum(i not in self._known for i in identifiers)
        rows = self._assembler.take(good)
        self.counters.wrong_length = self._assembler.wrong_length
        self.counters.misplaced = self._assembler.misplaced
        if not len(rows):
            return []
        self.stillness.frames(rows.sequence, rows.tick, rows.arrived)
        blocks = self._ordered(rows)
        self.stillness.readings(self.latest)
        return blocks

    def _ordered(self, rows: Rows) -> list[SampleBlock]:
        """Unwrap both counters, sort what came out of order, drop what came twice; a tick far in the past is a reboot."""
        if self._regular(rows):
            return [self._next(rows)]
        restart = self._restart(rows)
        if restart:  # what came before it belongs to the segment that ends here
            before = self._ordered(_part(rows, slice(0, restart)))
            return before + self._ordered(_part(rows, slice(restart, None)))
        s = self._segment
        if s is None:
            raw, tick = int(rows.sequence[0]), int(rows.tick[0])
            offset = int(rows.arrived[0]) - self._clock.ns(tick)
            s = self._segment = _Segment(offset, raw, tick, raw)
            last = raw - 1
        else:
            last = s.sequence
        steps, went = self._unwrapping.advance(rows.sequence - s.raw, rows.tick - s.tick)
        sequence, ticks = s.sequence + steps, s.tick + went
        self.counters.reordered += int((np.diff(sequence) < 0).sum())
        unique, first = np.unique(sequence, return_index=True)
        fresh = unique > last
        late = [int(n) for n in unique[~fresh] if int(n) in self._missing]
        self._missing.difference_update(late)
        self.counters.late += len(late)
        self.counters.duplicates += len(sequence) - int(fresh.sum()) - len(late)
        keep = first[fresh]
        if not len(keep):
            return self._all_old(rows)
        self._stale = 0
        columns = {name: x[keep] for name, x in rows.columns.items()}
        self.latest = {name: float(x[-1]) for name, x in columns.items()}
        self.host.take(s.offset_ns + self._clock.all_ns(ticks[keep]), rows.arrived[keep])
        self._count_leaps(np.diff(rows.sequence[keep], prepend=s.raw), np.diff(ticks[keep], prepend=s.tick))
        s.raw, s.sequence, s.tick = int(rows.sequence[keep[-1]]), int(sequence[keep[-1]]), int(ticks[keep[-1]])
        return self._split(sequence[keep], last, ticks[keep], columns, int(rows.arrived.max()))

    @property
    def _unwrapping(self) -> Unwrapping:
        return Unwrapping(self._assembler.sequence_bits, self._assembler.tick_bits, self._ticks)

    def _count_leaps(self, sequence: Integers, tick: Integers) -> None:
        """From the differences of neighbouring samples that are kept."""
        sequences, ticks = self._unwrapping.leaps(sequence, tick)
        self.counters.sequence_leaps += sequences
        self.counters.tick_leaps += ticks

    def _regular(self, rows: Rows) -> bool:
        """Whether rows are nothing but the successors of the last sample, each by one sample and its ticks: so it is
        nearly always, and then there is nothing to sort out."""
        s, a = self._segment, self._assembler
        if s is None or 2 * len(rows) * max(1, self._ticks) >= 1 << min(a.sequence_bits, a.tick_bits):
            return False
        count = np.arange(1, len(rows) + 1)
        steps = (rows.sequence - s.raw) & ((1 << a.sequence_bits) - 1)
        went = (rows.tick - s.tick) & ((1 << a.tick_bits) - 1)
        return bool((steps == count).all() and (went == count * self._ticks).all())

    def _next(self, rows: Rows) -> SampleBlock:
        """The block of such rows."""
        s, n = self._segment, len(rows)
        assert s is not None
        ticks = s.tick + round(self._ticks) * np.arange(1, n + 1)
        t_ns = s.offset_ns + self._clock.all_ns(ticks)
        self._stale = 0
        self.latest = rows.last()
        self.host.take(t_ns, rows.arrived)
        s.raw, s.sequence, s.tick = int(rows.sequence[-1]), s.sequence + n, int(ticks[-1])
        self._index += n
        return SampleBlock(
            STREAM, self._index - n, ticks.astype(np.uint64), t_ns, int(rows.arrived.max()), 0, rows.columns, rows.table
        )

    def _all_old(self, rows: Rows) -> list[SampleBlock]:
        """Nothing but samples that are there already. Once or twice that is a repetition; time and again, with rising
        ticks, it is a controller that restarted so soon after power-on that its tick did not fall far enough to tell."""
        before = self._stale_tick if self._stale or len(rows) == 1 else int(rows.tick[0])
        self._stale = self._stale + len(rows) if int(rows.tick[-1]) > before else 0
        self._stale_tick = int(rows.tick[-1])
        if self._stale < STALE:
            return []
        self.counters.duplicates = max(0, self.counters.duplicates - self._stale)
        self._new_segment()
        return self._ordered(rows)

    def _new_segment(self) -> None:
        self.counters.reboots += 1
        self._segment, self._stale = None, 0
        self.host = HostMap(self.host.latest_ns)

    def _restart(self, rows: Rows) -> int:
        """Index of the first row after a restart of the controller, 0 if there is none (or it is the first row, which
        then starts a segment)."""
        s = self._segment
        if s is None:
            return 0
        _, went = self._unwrapping.shortest(np.diff(rows.sequence, prepend=s.raw), np.diff(rows.tick, prepend=s.tick))
        back = np.flatnonzero(went * self._clock.tick_ns < -REBOOT_S * 1e9)
        if not len(back):
            return 0
        if back[0] == 0:
            self._new_segment()
        return int(back[0])

    def _split(
        self,
        sequence: Integers,
        last: int,
        ticks: Integers,
        columns: dict[str, npt.NDArray[np.float64]],
        host_ns: int,
    ) -> list[SampleBlock]:
        assert self._segment is not None
        before = np.diff(sequence, prepend=last) - 1
        starts = np.flatnonzero(np.concatenate([[True], before[1:] > 0]))
        out = []
        for a, b in zip(starts, [*starts[1:], len(sequence)], strict=True):
            lost = int(before[a])
            self.counters.lost += lost
            self.counters.gaps += lost > 0
            if lost:
                self._missing = {n for n in self._missing if n > int(sequence[a]) - REMEMBERED}
                self._missing.update(range(int(sequence[a]) - min(lost, REMEMBERED), int(sequence[a])))
            self._index += lost
            part = slice(int(a), int(b))
            out.append(
                SampleBlock(
                    STREAM,
                    self._index,
                    ticks[part].astype(np.uint64),
                    self._segment.offset_ns + self._clock.all_ns(ticks[part]),
                    host_ns,
                    lost,
                    {n: x[part] for n, x in columns.items()},
                )
            )
            self._index += int(b - a)
        return out


def _part(rows: Rows, part: slice) -> Rows:
    columns = {name: x[part] for name, x in rows.columns.items()}
    return Rows(rows.sequence[part], rows.tick[part], rows.arrived[part], columns)
