"""How sequence and tick of the telemetry count from frame to frame, and how they would in the other byte order."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from bench.link.codec import Decoder
from bench.link.frames import FrameBatch
from bench.link.unwrapping import signed
from bench.rigfile import RigFile
from bench.rigfile.messages import Signal

KEPT = 400  # frames that are looked at
FEWEST = 20  # to say anything


class Counting:
    """Steps of both counters over the newest frames of the first message of a sample."""

    def __init__(self, rig: RigFile) -> None:
        b = rig.binding
        message = rig.messages[b.telemetry[0]]
        self._names = (b.sequence, b.tick)
        self._bits = {name: message.signal(name).length for name in self._names}
        self._decoder = Decoder(message)
        self._swapped = Decoder(replace(message, signals=tuple(_swapped(s) for s in message.signals if _whole(s))))
        self._data: npt.NDArray[np.uint8] = np.empty((0, 64), np.uint8)

    def take(self, batch: FrameBatch) -> None:
        """Keep the newest frames."""
        frames, _ = self._decoder.chosen(batch)
        if len(frames):
            self._data = np.concatenate([self._data, frames["data"]])[-KEPT:]

    @property
    def steps(self) -> Mapping[str, int]:
        """By which number each counter mostly goes on from frame to frame, by its signal; empty with too few frames."""
        return self._steps(self._decoder)

    @property
    def swapped_steps(self) -> Mapping[str, int]:
        """The same with the bytes of each counter the other way round, of those that stand at whole bytes."""
        return self._steps(self._swapped)

    def _steps(self, decoder: Decoder) -> dict[str, int]:
        if len(self._data) < FEWEST:
            return {}
        table = decoder.table(self._data)
        out = {}
        for name in self._names:
            if name in decoder.names:
                counts = table[decoder.names.index(name)].astype(np.int64)
                out[name] = int(np.median(signed(np.diff(counts), self._bits[name])))
        return out


def _whole(s: Signal) -> bool:
    """Whether it has several whole bytes of its own, so that there is another order of them."""
    at = s.start if s.little_endian else s.start + 1
    return s.length % 8 == 0 and s.length > 8 and at % 8 == 0 and not s.is_float


def _swapped(s: Signal) -> Signal:
    """The same bytes in the other order: a little-endian signal starts at its lowest bit, a big-endian one at its highest
    in the sawtooth numbering."""
    first = s.start // 8
    return replace(s, little_endian=not s.little_endian, start=8 * first + 7 if s.little_endian else 8 * first)
