"""From telemetry frames to sample blocks on the sample clock, with every loss, duplicate and reordering counted."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from bench import units
from bench.assembly import Assembler, Rows
from bench.frames import ERROR, FrameBatch
from bench.hosttime import HostMap
from bench.rigfile import RigFile
from bench.samples import ChannelInfo, SampleBlock, StreamLayout

STREAM = "telemetry"
CODES = ("state", "fault", "flags")
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


@dataclass
class _Segment:
    """Since the controller started: offset of the sample clock, and the last sequence number and tick, unwrapped."""

    offset_ns: int
    sequence: int
    tick: int


@dataclass
class TelemetryDecoder:
    """Decodes the telemetry of a rig. Keeps `latest` by channel for drivers."""

    rig: RigFile
    counters: Counters = field(default_factory=Counters)
    latest: dict[str, float] = field(default_factory=dict)
    host: HostMap = field(default_factory=HostMap)

    def __post_init__(self) -> None:
        self._assembler = Assembler(self.rig)
        self._first = self.rig.messages[self.rig.binding.telemetry[0]]
        self._tick_ns = round(self.rig.devices["controller"].tick_s * 1e9)
        self._known = np.array(sorted(m.identifier for m in self.rig.messages.messages.values()))
        self._segment: _Segment | None = None
        self._index = 0
        self._stale, self._stale_tick = 0, 0  # samples in a row that were old, and the tick of the last
        self._missing: set[int] = set()  # sequence numbers that may still come late

    @property
    def layout(self) -> StreamLayout:
        """The stream as it is recorded."""
        return StreamLayout(
            STREAM,
            round(self._first.period_s * 1e9),
            tuple(
                ChannelInfo(name, units.UNITS[c.unit].si, "u2" if name in CODES else "f4")
                for name, c in self.rig.channels.items()
            ),
        )

    def start_counting(self) -> None:
        """The next sample is number 0 of the stream, and what was lost before it does not count."""
        self._index = 0
        self.counters.gaps = self.counters.lost = 0

    def decode(self, batch: FrameBatch) -> list[SampleBlock]:
        """Blocks of consecutive samples, in order; a gap starts a new block with `lost_before`."""
        good = batch[(batch["flags"] & ERROR) == 0] if (batch["flags"] & ERROR).any() else batch
        self.counters.unknown += int((~np.isin(good["id"], self._known)).sum())
        rows = self._assembler.take(good)
        self.counters.wrong_length = self._assembler.wrong_length
        return self._ordered(rows) if len(rows) else []

    def _ordered(self, rows: Rows) -> list[SampleBlock]:
        """Unwrap both counters, sort what came out of order, drop what came twice; a tick far in the past is a reboot."""
        restart = self._restart(rows)
        if restart:  # what came before it belongs to the segment that ends here
            before = self._ordered(_part(rows, slice(0, restart)))
            return before + self._ordered(_part(rows, slice(restart, None)))
        s = self._segment
        if s is None:
            offset = int(rows.arrived[0]) - int(rows.tick[0]) * self._tick_ns
            s = self._segment = _Segment(offset, int(rows.sequence[0]) - 1, int(rows.tick[0]) - 1)
        ticks = s.tick + _signed(rows.tick - s.tick, self._assembler.tick_bits)
        sequence = s.sequence + _signed(rows.sequence - s.sequence, self._assembler.sequence_bits)
        self.counters.reordered += int((np.diff(sequence) < 0).sum())
        unique, first = np.unique(sequence, return_index=True)
        fresh = unique > s.sequence
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
        self.host.take(s.offset_ns + ticks[keep] * self._tick_ns, rows.arrived[keep])
        return self._split(sequence[keep], ticks[keep], columns, int(rows.arrived.max()))

    def _all_old(self, rows: Rows) -> list[SampleBlock]:
        """Nothing but samples that are there already. Once or twice that is a repetition; time and again, with rising
        ticks, it is a controller that restarted so soon after power-on that its tick did not fall far enough to tell."""
        self._stale = self._stale + len(rows) if int(rows.tick[-1]) > self._stale_tick else 0
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
        if self._segment is None:
            return 0
        steps = _signed(np.diff(rows.tick, prepend=self._segment.tick & _mask(self._assembler.tick_bits)),
                        self._assembler.tick_bits)  # fmt: skip
        back = np.flatnonzero(steps * self._tick_ns < -REBOOT_S * 1e9)
        if not len(back):
            return 0
        if back[0] == 0:
            self._new_segment()
        return int(back[0])

    def _split(
        self,
        sequence: npt.NDArray[np.int64],
        ticks: npt.NDArray[np.int64],
        columns: dict[str, npt.NDArray[np.float64]],
        host_ns: int,
    ) -> list[SampleBlock]:
        assert self._segment is not None
        before = np.diff(sequence, prepend=self._segment.sequence) - 1
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
                    self._segment.offset_ns + ticks[part] * self._tick_ns,
                    host_ns,
                    lost,
                    {n: x[part] for n, x in columns.items()},
                )
            )
            self._index += int(b - a)
        self._segment.sequence, self._segment.tick = int(sequence[-1]), int(ticks[-1])
        return out


def _signed(difference: npt.NDArray[np.int64], bits: int) -> npt.NDArray[np.int64]:
    """A difference of counters of so many bits, taken the short way round."""
    half = np.int64(1) << (bits - 1)
    out: npt.NDArray[np.int64] = ((difference + half) & ((np.int64(1) << bits) - 1)) - half
    return out


def _mask(bits: int) -> int:
    return (1 << bits) - 1


def _part(rows: Rows, part: slice) -> Rows:
    columns = {name: x[part] for name, x in rows.columns.items()}
    return Rows(rows.sequence[part], rows.tick[part], rows.arrived[part], columns)
