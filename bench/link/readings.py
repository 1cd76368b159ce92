"""What the channels of a rig read, frame by frame: newest value, range, and whether they move.

Each telemetry message is read by itself, so that a channel is seen also where samples cannot be put together: another
message of them never comes, or a counter does not count.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench import units
from bench.link.codec import Decoder
from bench.link.frames import ERROR, FrameBatch
from bench.link.stillness import CLOCKS, CODES
from bench.rigfile import RigFile
from bench.rigfile.binding import HELD
from bench.rigfile.envelope import Envelope
from bench.rigfile.messages import Message, Signal

Values = npt.NDArray[np.float64]
NARROW = 8  # bits: a signal of fewer is a code


@dataclass(frozen=True)
class Scale:
    """A channel's signal in SI: what a count is (0 where it is a floating-point number), ends of what its bits hold, and of the
    range that the DBC states, both opened by half a count; infinite where there are none."""

    unit: str
    count: float
    least: float
    greatest: float
    low: float
    high: float

    @classmethod
    def of(cls, signal: Signal, code: bool) -> Scale:
        """Of a signal; of a code neither end means anything."""
        u = units.UNITS[signal.unit]
        count = abs(signal.scale)
        low, high = (
            (-math.inf if signal.low is None else signal.low),
            (math.inf if signal.high is None else signal.high),
        )
        least, greatest = -math.inf, math.inf
        if not signal.is_float and signal.length >= NARROW:
            ends = ((-1 << signal.length - 1, (1 << signal.length - 1) - 1) if signal.signed
                    else (-math.inf, (1 << signal.length) - 1))  # fmt: skip
            least, greatest = sorted(end * signal.scale + signal.offset for end in ends)
        if code:
            low, least, high, greatest = -math.inf, -math.inf, math.inf, math.inf
        half = 0.5 * count
        told = (least + half, greatest - half, low - half, high + half)
        return cls(u.si, 0.0 if signal.is_float else count * u.factor, *(x * u.factor + u.offset for x in told))


@dataclass
class Reading:
    """One channel, SI: `value` is the newest; `ends` and `outside` count frames in which it stood at an end of what its
    bits hold, or outside of the DBC's range, `beyond` those outside of the envelope, `numberless` those without a number."""

    scale: Scale
    bounds: tuple[float, float, bool] = (-math.inf, math.inf, False)
    count: int = 0
    value: float = math.nan
    low: float = math.inf
    high: float = -math.inf
    ends: int = 0
    outside: int = 0
    beyond: int = 0
    numberless: int = 0

    @property
    def moves(self) -> bool:
        """Whether it has read more than one value."""
        return self.low < self.high

    def take(self, x: Values, held: bool) -> None:
        """The next readings; `held`: whether the rotor is."""
        self.count += len(x)
        self.value = float(x[-1])
        whole = np.isfinite(x)
        if not whole.all():
            self.numberless += int((~whole).sum())
            x = x[whole]
            if not len(x):
                return
        low, high, s = float(x.min()), float(x.max()), self.scale
        self.low, self.high = min(self.low, low), max(self.high, high)
        if low <= s.least or high >= s.greatest:
            self.ends += int(((x <= s.least) | (x >= s.greatest)).sum())
        if low < s.low or high > s.high:
            self.outside += int(((x < s.low) | (x > s.high)).sum())
        least, most, while_held = self.bounds
        if (low < least or high > most) and (held or not while_held):
            self.beyond += int(((x < least) | (x > most)).sum())


@dataclass(frozen=True)
class _Part:
    """A telemetry message: its decoder, its channels, their rows in the decoder's table, factors and offsets to SI."""

    decoder: Decoder
    channels: tuple[str, ...]
    rows: list[int]
    factors: Values
    offsets: Values


class Readings:
    """Of all channels of a rig, by name, in the order of the rig file."""

    def __init__(self, rig: RigFile) -> None:
        self._rig = rig
        bounds = Envelope(rig).bounds
        owners = {name: c.signal.split(".") for name, c in rig.channels.items()}
        signals = {name: rig.messages[m].signal(s) for name, (m, s) in owners.items()}
        unending = (*CODES, *CLOCKS)
        self.by_name: Mapping[str, Reading] = {
            name: Reading(Scale.of(s, name in unending), bounds.get(name, (-math.inf, math.inf, False)))
            for name, s in signals.items()
        }
        self._parts = [_part(rig.messages[m], signals, owners) for m in rig.binding.telemetry]
        codes = rig.choices("state") if "state" in rig.channels else {}
        self._held = {
            code for code, name in codes.items() if rig.binding.mode(name) in HELD
        }  # fmt: skip

    def take(self, batch: FrameBatch) -> None:
        """Read the frames of telemetry among them; those of a wrong length are left out."""
        batch = batch[batch["flags"] & ERROR == 0]
        before = self.held
        for part in self._parts:
            frames, _ = part.decoder.chosen(batch)
            if not len(frames):
                continue
            si = part.decoder.table(frames["data"])[part.rows] * part.factors + part.offsets
            for name, x in zip(part.channels, si, strict=True):
                self.by_name[name].take(x, before and self.held)

    @property
    def held(self) -> bool:
        """Whether the controller says that it holds the rotor."""
        value = self.by_name["state"].value if "state" in self.by_name else math.nan
        return math.isfinite(value) and int(value) in self._held

    def code(self, channel: str) -> str:
        """The name of a channel's newest code, `7 (no name in the DBC)` where it has none, "" before the first."""
        reading = self.by_name.get(channel)
        if reading is None or not reading.count or not math.isfinite(reading.value):
            return ""
        return self._rig.choices(channel).get(int(reading.value), f"{int(reading.value)} (no name in the DBC)")


def _part(message: Message, signals: Mapping[str, Signal], owners: Mapping[str, list[str]]) -> _Part:
    decoder = Decoder(message)
    names = tuple(name for name, (owner, _) in owners.items() if owner == message.name)
    si = [units.UNITS[signals[name].unit] for name in names]
    rows = [decoder.names.index(owners[name][1]) for name in names]
    factors, offsets = np.array([(u.factor, u.offset) for u in si]).reshape(len(si), 2).T[:, :, None]
    return _Part(decoder, names, rows, factors, offsets)
