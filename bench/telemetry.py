"""From telemetry frames to sample blocks on the sample clock, with every loss, duplicate and reordering counted."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from bench import units
from bench.codec import Decoder
from bench.frames import FrameBatch
from bench.rigfile import RigFile
from bench.samples import ChannelInfo, SampleBlock, StreamLayout

TICK_NS = 100_000
STREAM = "telemetry"
CODES = ("state", "fault", "flags")


@dataclass
class Counters:
    """What went wrong on the way."""

    gaps: int = 0
    lost: int = 0
    duplicates: int = 0
    reordered: int = 0
    wrong_length: int = 0
    reboots: int = 0


@dataclass
class _Segment:
    """Since the controller started: offset of the sample clock, and the last sequence number and tick, unwrapped."""

    offset_ns: int
    sequence: int
    tick: int


@dataclass
class TelemetryDecoder:
    """Decodes the message `Telemetry` of a rig. Keeps `latest` by channel for drivers."""

    rig: RigFile
    counters: Counters = field(default_factory=Counters)
    latest: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._message = self.rig.messages["Telemetry"]
        self._decoder = Decoder(self._message)
        self._period_ticks = round(self._message.period_s * 1e9 / TICK_NS)
        self._signals = {name: c.signal.split(".")[1] for name, c in self.rig.channels.items()}
        self._segment: _Segment | None = None
        self._index = 0
        self._factors = {
            name: units.UNITS[self._message.signal(signal).unit].factor for name, signal in self._signals.items()
        }

    @property
    def layout(self) -> StreamLayout:
        """The stream as it is recorded."""
        return StreamLayout(
            STREAM,
            round(self._message.period_s * 1e9),
            tuple(
                ChannelInfo(name, units.UNITS[c.unit].si, "u2" if name in CODES else "f4")
                for name, c in self.rig.channels.items()
            ),
        )

    def decode(self, batch: FrameBatch) -> list[SampleBlock]:
        """Blocks of consecutive samples, in order; a gap starts a new block with `lost_before`."""
        mine = batch[batch["id"] == self._message.identifier]
        values, wrong = self._decoder.decode(batch)
        self.counters.wrong_length += wrong
        if not len(values["seq"]):
            return []
        arrived = mine[mine["length"] == self._message.length]["t_ns"]
        sequence, ticks, keep = self._order(values["seq"].astype(np.int64), values["tick"].astype(np.int64), arrived)
        columns = {name: values[signal][keep] * self._factors[name] for name, signal in self._signals.items()}
        if not len(keep):
            return []
        self.latest = {name: float(x[-1]) for name, x in columns.items()}
        return self._split(sequence, ticks, columns, int(arrived[-1]))

    def _order(
        self, sequence: npt.NDArray[np.int64], ticks: npt.NDArray[np.int64], arrived: npt.NDArray[np.int64]
    ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Unwrap both counters, sort what came out of order, drop what came twice; a tick far in the past is a reboot."""
        if self._segment is None:
            self._segment = _Segment(int(arrived[0]) - int(ticks[0]) * TICK_NS, int(sequence[0]) - 1, int(ticks[0]) - 1)
        s = self._segment
        ticks = s.tick + _signed(ticks - s.tick, 32)
        if (ticks < s.tick - 10_000).any():
            self.counters.reboots += 1
            self._segment = None
            return self._order(sequence, ticks & 0xFFFFFFFF, arrived)
        sequence = s.sequence + _signed(sequence - s.sequence, 16)
        self.counters.reordered += int((np.diff(sequence) < 0).sum())
        unique, first = np.unique(sequence, return_index=True)
        fresh = unique > s.sequence
        self.counters.duplicates += len(sequence) - int(fresh.sum())
        keep = first[fresh]
        return sequence[keep], ticks[keep], keep

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
            self._index += lost
            part = slice(int(a), int(b))
            out.append(
                SampleBlock(
                    STREAM,
                    self._index,
                    ticks[part].astype(np.uint64),
                    self._segment.offset_ns + ticks[part] * TICK_NS,
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
