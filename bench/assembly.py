"""From telemetry frames to rows of values: one message a sample (CAN FD, serial), or several on classic CAN.

On classic CAN the first message (SYNC) carries sequence and tick, each other one the low bits of the sequence it belongs
to. A sample is complete when all its messages came; one that stays incomplete is lost and shows as a gap.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from bench import units
from bench.codec import Decoder
from bench.frames import FrameBatch
from bench.messages import Message
from bench.rigfile import RigFile

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

    def __len__(self) -> int:
        return len(self.sequence)


@dataclass
class _Part:
    """One telemetry message: its decoder, its channels with their factors to SI, and what still waits for the rest."""

    message: Message
    decoder: Decoder
    channels: dict[str, tuple[str, float]]
    waiting: dict[int, list[float]] = field(default_factory=dict)


class Assembler:
    """Takes the telemetry of one rig apart; `wrong_length` counts frames that were left out."""

    def __init__(self, rig: RigFile) -> None:
        b = rig.binding
        self._binding = b
        self.wrong_length = 0
        self._parts = [_part(rig, rig.messages[name]) for name in b.telemetry]
        sync = self._parts[0].message
        self.sequence_bits = sync.signal(b.sequence).length
        self.tick_bits = sync.signal(b.tick).length
        self._arrived: dict[int, int] = {}  # host time of the SYNC of what waits
        self._newest = 0  # last sequence number that SYNC showed

    def take(self, batch: FrameBatch) -> Rows:
        """The samples that a batch completes."""
        if len(self._parts) == 1:
            return self._single(batch)
        return self._several(batch)

    def _single(self, batch: FrameBatch) -> Rows:
        part, b = self._parts[0], self._binding
        values, wrong = part.decoder.decode(batch)
        self.wrong_length += wrong
        mine = (batch["id"] == part.message.identifier) & (batch["length"] == part.message.length)
        columns = {name: values[signal] * factor for name, (signal, factor) in part.channels.items()}
        return Rows(values[b.sequence].astype(np.int64), values[b.tick].astype(np.int64), batch["t_ns"][mine], columns)

    def _several(self, batch: FrameBatch) -> Rows:
        for part in self._parts:
            self.wrong_length += part.decoder.decode(batch)[1]
        b = self._binding
        complete: list[list[float]] = []
        arrived: list[int] = []
        known = {p.message.identifier: p for p in self._parts}
        mine = batch[np.isin(batch["id"], list(known))]
        for one in mine:  # classic CAN brings some thousand frames a second at most
            part = known[int(one["id"])]
            if one["length"] != part.message.length:
                continue
            v = {k: float(x[0]) for k, x in part.decoder.decode_payloads(one["data"][None, :]).items()}
            si = [v[signal] * factor for signal, factor in part.channels.values()]
            if part is self._parts[0]:
                self._newest = number = int(v[b.sequence])
                self._arrived[number] = int(one["t_ns"])
                si = [float(number), v[b.tick], *si]
            else:
                number = self._belongs(int(v[b.counter]), part.message.signal(b.counter).length)
            part.waiting[number] = si
            if all(number in p.waiting for p in self._parts):
                complete.append([x for p in self._parts for x in p.waiting.pop(number)])
                arrived.append(self._arrived.pop(number))
        self._forget()
        return self._rows(complete, arrived)

    def _belongs(self, count: int, bits: int) -> int:
        """The sequence number near the newest one whose low bits are `count`."""
        half = 1 << (bits - 1)
        off = (count - self._newest + half) % (1 << bits) - half
        return (self._newest + off) % (1 << self.sequence_bits)

    def _forget(self) -> None:
        """What has waited too long stays incomplete; numbers just ahead of SYNC (it may be late) stay too."""
        size = 1 << self.sequence_bits
        stores: list[dict[int, Any]] = [self._arrived, *(p.waiting for p in self._parts)]
        for waiting in stores:
            for number in [n for n in waiting if KEPT < (self._newest - n) % size < size - KEPT]:
                del waiting[number]

    def _rows(self, complete: list[list[float]], arrived: list[int]) -> Rows:
        names = [n for p in self._parts for n in p.channels]
        table = np.array(complete).reshape(len(complete), len(names) + 2)
        columns = dict(zip(names, table.T[2:], strict=True))
        sequence, tick = (table[:, k].astype(np.int64) for k in range(2))
        return Rows(sequence, tick, np.array(arrived, np.int64), columns)


def _part(rig: RigFile, message: Message) -> _Part:
    channels = {
        name: (signal, units.UNITS[message.signal(signal).unit].factor)
        for name, (owner, _, signal) in ((n, c.signal.partition(".")) for n, c in rig.channels.items())
        if owner == message.name
    }
    return _Part(message, Decoder(message), channels)
