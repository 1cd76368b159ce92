"""Between payload bytes and values, in batches: numpy extractors made once per message from its signals.

Bits are numbered as in a DBC: little-endian signals start at their least significant bit, big-endian ones at their
most significant bit in the sawtooth numbering. Neighbours of one aligned little-endian type are read by one view.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from itertools import groupby
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from bench.errors import ConfigError
from bench.link.frames import FrameBatch
from bench.link.windows import Places, fits, places, widened
from bench.rigfile.messages import Message, Signal

Array = npt.NDArray[np.float64]
Payloads = npt.NDArray[np.uint8]
Raw = npt.NDArray[Any]
Extractor = Callable[[Payloads], Raw]
FLOATS: Final = {16: "<e", 32: "<f", 64: "<d"}


class Decoder:
    """Decodes frames of one message. `names` are its signals in the order of the rows of a table."""

    def __init__(self, message: Message) -> None:
        self.message = message
        self._signals, groups, self._places = laid_out(message)
        self._extractors = [(row, *_extractor(group)) for row, group in groups]
        self.names = tuple(s.name for s in self._signals)
        self._scales = np.array([s.scale for s in self._signals])[:, None]
        self._offsets = np.array([s.offset for s in self._signals])[:, None]
        self._shifted = bool(self._offsets.any())
        # What decode_one needs of each signal, worked out once.
        self._single = [
            (s, s.little_endian, _shift(s, message.length), (1 << s.length) - 1,
             1 << (s.length - 1) if s.signed and not s.is_float else 0)
            for s in self._signals
        ]  # fmt: skip

    def decode(self, batch: FrameBatch) -> tuple[dict[str, Array], int]:
        """Values of every frame of this message in a batch.

        Returns:
            float64 arrays by signal, in order of arrival, and the number of frames of this identifier whose length is
            wrong; those are left out, never read.
        """
        frames, wrong = self.chosen(batch)
        return self.decode_payloads(frames["data"]), wrong

    def decode_payloads(self, payloads: Payloads) -> dict[str, Array]:
        """Values of payloads (n, at least message.length), one row a frame, by signal."""
        return dict(zip(self.names, self.table(payloads), strict=True))

    def chosen(self, batch: FrameBatch) -> tuple[FrameBatch, int]:
        """The frames of this message in a batch, and how many more have its identifier but another length."""
        mine = batch["id"] == self.message.identifier
        right = mine & (batch["length"] == self.message.length)
        count = int(np.count_nonzero(right))
        frames = batch if count == len(batch) else batch[right]  # whole batches are not copied
        return frames, int(np.count_nonzero(mine)) - count

    def table(self, payloads: Payloads) -> Array:
        """Values (signals, n) of such payloads."""
        out = np.empty((len(self.names), len(payloads)))
        for row, count, extract in self._extractors:
            out[row : row + count] = extract(payloads)
        if self._places:
            wide = widened(payloads[:, : self.message.length])
            for p in self._places:
                out[p.rows] = p.read(wide)
        out *= self._scales
        if self._shifted:
            out += self._offsets
        return out

    def decode_one(self, payload: bytes) -> dict[str, float]:
        """Values of a single payload of message.length bytes, the same as those of a batch, without its overhead."""
        words = int.from_bytes(payload, "big"), int.from_bytes(payload, "little")
        values = {}
        for s, little_endian, shift, mask, sign in self._single:
            raw = words[little_endian] >> shift & mask
            number = _float(s, raw) if s.is_float else float(raw - ((raw & sign) << 1))
            values[s.name] = number * s.scale + s.offset
        return values


def aligned_type(s: Signal) -> str:
    """numpy type of a signal that a view can read, or ""."""
    whole = s.start % 8 == (0 if s.little_endian else 7)  # a big-endian signal's place is that of its top bit
    if not whole or s.length not in (8, 16, 32, 64):
        return ""
    kind = "f" if s.is_float else "i" if s.signed else "u"
    return f"{'<' if s.little_endian else '>'}{kind}{s.length // 8}" if kind != "f" or s.length > 8 else ""


def grouped(message: Message) -> list[list[Signal]]:
    """Signals in payload order, with neighbours that one view can read together."""
    ordered = sorted(message.signals, key=lambda s: s.start)
    place = {s.name: s.start - k * s.length for k, s in enumerate(ordered)}
    return [
        list(g)
        for _, g in groupby(ordered, key=lambda s: (aligned_type(s) or s.name, place[s.name] if aligned_type(s) else 0))
    ]


def laid_out(message: Message) -> tuple[list[Signal], list[tuple[int, list[Signal]]], list[Places]]:
    """The signals of a message in the order of the rows of a table; of these the groups, with their first rows, that are read
    by a view or bit by bit; and the places of the others, which are read by their windows."""
    groups = grouped(message)
    rows = [sum(map(len, groups[:k])) for k in range(len(groups))]
    lone = [len(g) == 1 and fits(g[0], bytes_of) for g in groups]
    rest = [(row, g) for row, g, apart in zip(rows, groups, lone, strict=True) if not apart]
    windowed = [(row, g[0]) for row, g, apart in zip(rows, groups, lone, strict=True) if apart]
    return [s for g in groups for s in g], rest, list(places(windowed, bytes_of))


def _extractor(group: list[Signal]) -> tuple[int, Extractor]:
    """How many signals are read together, and what reads their raw values."""
    first, kind = group[0], aligned_type(group[0])
    if not kind:
        return 1, lambda payloads: bits_of(payloads, first)
    low = first.start // 8
    high = low + len(group) * first.length // 8
    return len(group), lambda payloads: payloads[:, low:high].view(kind).T


def bits_of(payloads: Payloads, s: Signal) -> Raw:
    """A signal at any place: its bytes are gathered into a 64-bit word (and a ninth byte where it straddles)."""
    first_bit, order = bytes_of(s)
    word = np.zeros(len(payloads), np.uint64)
    for k, byte in enumerate(order):  # least significant first
        shift = 8 * k - first_bit
        column = payloads[:, byte].astype(np.uint64)
        word |= column << np.uint64(shift) if shift >= 0 else column >> np.uint64(-shift)
    if s.length < 64:
        word &= np.uint64((1 << s.length) - 1)
    if s.is_float:
        kind = {16: np.float16, 32: np.float32, 64: np.float64}[s.length]
        return word.astype(f"<u{s.length // 8}").view(kind)
    if s.signed:
        up = np.uint64(64 - s.length)
        return (word << up).view(np.int64) >> np.int64(up)
    return word


def _shift(s: Signal, length: int) -> int:
    """How far a signal's least significant bit lies above that of a whole payload, read in the signal's byte order."""
    if s.little_endian:
        return s.start
    top = 8 * (s.start // 8) + 7 - s.start % 8  # position counted from the first byte's most significant bit
    return 8 * length - top - s.length


def _float(s: Signal, raw: int) -> float:
    """The floating-point number that a signal's bits are."""
    value: float = struct.unpack(FLOATS[s.length], raw.to_bytes(s.length // 8, "little"))[0]
    return value


def bytes_of(s: Signal) -> tuple[int, list[int]]:
    """Bit of the first byte where the signal's least significant bit lies, and its bytes, least significant first."""
    if s.little_endian:
        return s.start % 8, list(range(s.start // 8, (s.start + s.length - 1) // 8 + 1))
    top = 8 * (s.start // 8) + 7 - s.start % 8
    last = top + s.length - 1
    return 7 - last % 8, list(range(last // 8, top // 8 - 1, -1))


def places_of(s: Signal) -> tuple[int, ...]:
    """Places of a signal's bits in its message, the least significant first: place n is bit n % 8 of byte n // 8."""
    first_bit, order = bytes_of(s)
    return tuple(8 * order[n // 8] + n % 8 for n in range(first_bit, first_bit + s.length))


def encode(message: Message, values: Mapping[str, float]) -> bytes:
    """The payload of a message; signals that are not given are zero raw.

    Raises:
        ConfigError: an unknown signal, or a value that its bits cannot hold.
    """
    words = [0, 0]  # of the big-endian signals, and of the others
    for name, value in values.items():
        try:
            s = message.signal(name)
        except KeyError:
            known = ", ".join(x.name for x in message.signals)
            raise ConfigError(f"{message.name}: no signal {name!r}; expected one of {known}") from None
        words[s.little_endian] |= _raw(message, s, value) << _shift(s, message.length)
    swapped = int.from_bytes(words[0].to_bytes(message.length, "big"), "little")
    return (swapped | words[1]).to_bytes(message.length, "little")


def _raw(message: Message, s: Signal, value: float) -> int:
    scaled = (value - s.offset) / s.scale
    if s.is_float:
        try:
            packed = struct.pack(FLOATS[s.length], scaled)
        except OverflowError:
            raise ConfigError(f"{message.name}.{s.name}: {value:g} {s.unit} is too large for its float") from None
        return int.from_bytes(packed, "little")
    low, high = (-(1 << s.length - 1), (1 << s.length - 1) - 1) if s.signed else (0, (1 << s.length) - 1)
    if not low - 0.5 <= scaled <= high + 0.5:
        limits = sorted((low * s.scale + s.offset, high * s.scale + s.offset))
        raise ConfigError(
            f"{message.name}.{s.name}: {value:g} {s.unit} does not fit; expected {limits[0]:g} to {limits[1]:g}"
        )
    return min(max(round(scaled), low), high) & ((1 << s.length) - 1)
