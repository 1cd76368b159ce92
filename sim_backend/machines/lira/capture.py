"""The firmware's capture memory: rows of sixteen-bit counts by a mask of channels, a rate of 35, 140 or 280 kHz, a trigger."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np

from bench.wire.commandline import LARGEST, block
from sim_backend.core.plant import Array
from sim_backend.machines.lira.plant import WHOLE
from sim_backend.machines.lira.settings import MEASUREMENTS

MEMORY: Final = 32 << 20
FAST: Final = 16
"""Channels that a capture above 35 kHz may have."""
EVERY: Final = {35_000: 8, 140_000: 2, 280_000: 1}
"""Ticks from sample to sample, by rate in Hz."""
TRIGGERS: Final = ("now", "step", "level")


@dataclass
class Capture:
    """One capture: what was asked, and what has come.

    Attributes:
        number: tells one from the next.
        channels: by their numbers in the mask.
        every: ticks from sample to sample.
        length: samples.
        before: samples kept of those before the trigger.
        trigger: `now`, `step` (of a current's set point), or `level` (a channel rises through a value).
        channel: that is watched, its place in `channels`.
        level: in counts.
    """

    number: int
    channels: tuple[int, ...]
    every: int
    length: int
    before: int
    trigger: str
    channel: int = 0
    level: int = 0
    stepped: bool = False
    first_tick: int = 0
    samples: int = 0
    _kept: list[Array] = field(default_factory=list)
    _fired: int | None = None

    @property
    def size(self) -> int:
        """Bytes of the whole capture."""
        return 2 * len(self.channels) * self.length

    @property
    def full(self) -> bool:
        """Every sample has come."""
        return self._fired is not None and self.samples >= self._fired - min(self.before, self._fired) + self.length

    @property
    def state(self) -> str:
        """As `cap stat` says it."""
        return "done" if self.full else "armed" if self._fired is None else "running"

    @property
    def before_trigger(self) -> int:
        """Samples that it has of the time before the trigger."""
        return self.before if self._fired is None else min(self.before, self._fired)

    @property
    def data(self) -> bytes:
        """All of it, once it is full."""
        assert self._fired is not None
        first = self._fired - self.before_trigger
        return np.concatenate(self._kept)[first : first + self.length].tobytes()

    @cached_property
    def crc(self) -> int:
        """CRC-32 of its bytes."""
        return zlib.crc32(self.data)

    def take(self, rows: Array, tick: int) -> None:
        """Rows (n, len(WHOLE)) of the machine, every `every` ticks from a tick on."""
        if self.full or not len(rows):
            return
        columns = [WHOLE.index(MEASUREMENTS[k].column) for k in self.channels]
        lsb = np.array([MEASUREMENTS[k].lsb for k in self.channels])
        counts = np.clip(np.rint(np.nan_to_num(rows[:, columns]) / lsb), -(2**15), 2**15 - 1).astype("<i2")
        if self._fired is None:
            self._fired = self._found(counts)
            if self._fired is not None:
                skipped = self._fired - min(self.before, self._fired)
                self.first_tick = tick + (skipped - self.samples) * self.every
        self._kept.append(counts)
        self.samples += len(counts)

    def _found(self, counts: Array) -> int | None:
        """The sample at which it is triggered."""
        if self.trigger == "now" or (self.trigger == "step" and self.stepped):
            return self.samples
        if self.trigger == "level":
            last = (
                self._kept[-1][-1:, self.channel] if self._kept else counts[:1, self.channel]
            )  # a rise may lie between two calls
            watched = np.concatenate([last, counts[:, self.channel]])
            rises = np.flatnonzero((watched[1:] >= self.level) & (watched[:-1] < self.level))
            if len(rises):
                return self.samples + int(rises[0])
        return None

    def blocks(self, offset: int, length: int) -> Iterator[bytes]:
        """Blocks of a part of its bytes; nothing beyond its end."""
        data = self.data
        end = min(offset + length, len(data))
        for at in range(offset, end, LARGEST):
            yield block(self.number, at, data[at : min(at + LARGEST, end)])
