"""Codec: payload bytes to physical values and back, over batches, from the message map alone.

Extraction plans are made once per message. Same-typed, byte-aligned little-endian neighbours are read through one numpy
view; other signals come out of an eight-byte window by shift and mask; the rare signal that spans nine bytes is put
together byte by byte.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from bench.frames import ERROR, FrameBatch
from bench.messages import Message, Signal

Floats = npt.NDArray[np.float64]
Payloads = npt.NDArray[np.uint8]
_EXACT: Final = 2.0**53
_INT_TYPES: Final = {8: "1", 16: "2", 32: "4", 64: "8"}
_FLOAT_FORMATS: Final = {16: "<e", 32: "<f", 64: "<d"}


@dataclass(frozen=True)
class Decoded:
    """Values of one message from a batch.

    `columns` holds float64 arrays of equal length by signal name, physical units of the message map; `rows` the
    positions in the batch they came from; `wrong_length` how many frames of this message were left out because
    their length was not the message's.
    """

    columns: dict[str, Floats]
    rows: npt.NDArray[np.intp]
    wrong_length: int

    def __getitem__(self, name: str) -> Floats:
        return self.columns[name]

    def __len__(self) -> int:
        return len(self.rows)


class Decoder:
    """Decodes the frames of one message. Made once; holds no data."""

    def __init__(self, message: Message) -> None:
        self.message = message
        self._width = max(message.length, 8)  # the data field is 64 wide, so an eight-byte window always exists
        groups, single = _neighbours(message)
        self._groups = tuple(_Group(members) for members in groups)
        self._single = tuple((signal, _reader(signal, self._width)) for signal in single)

    def decode(self, batch: FrameBatch) -> Decoded:
        """Every good frame of this message in the batch, in order of arrival. Other messages are passed over."""
        mine = (batch["id"] == self.message.id) & ((batch["flags"] & ERROR) == 0)
        good = mine & (batch["length"] == self.message.length)
        rows = np.flatnonzero(good)
        data = batch["data"][:, : self._width]
        chosen = data if len(rows) == len(batch) else data[rows]
        columns = self.decode_payloads(np.ascontiguousarray(chosen))
        return Decoded(columns, rows, int(np.count_nonzero(mine)) - len(rows))

    def decode_payloads(self, data: Payloads) -> dict[str, Floats]:
        """Decode an array of shape (n, max(length, 8)); short messages are padded to eight columns."""
        columns: dict[str, Floats] = {}
        for group in self._groups:
            columns.update(group.read(data))
        for signal, read in self._single:
            columns[signal.name] = _physical(signal, read(data))
        return {signal.name: columns[signal.name] for signal in self.message.signals}

    def decode_one(self, payload: bytes) -> dict[str, float]:
        """Decode a single payload.

        Raises:
            ValueError: its length is not the message's.
        """
        if len(payload) != self.message.length:
            name, length = self.message.name, self.message.length
            raise ValueError(f"{name}: payload of {len(payload)} bytes; expected {length}")
        data = np.zeros((1, self._width), np.uint8)
        data[0, : len(payload)] = np.frombuffer(payload, np.uint8)
        return {name: float(column[0]) for name, column in self.decode_payloads(data).items()}


def decode_one(message: Message, payload: bytes) -> dict[str, float]:
    """Decode one payload of a message; keep a `Decoder` where it happens often (raises ValueError on its length)."""
    return Decoder(message).decode_one(payload)


class _Group:
    """Aligned neighbours of one type: one view, one multiplication."""

    def __init__(self, members: list[Signal]) -> None:
        first = members[0]
        self._names = [signal.name for signal in members]
        self._first = first.start // 8
        self._stop = self._first + len(members) * first.length // 8
        self._dtype = np.dtype(_type_of(first))
        self._scale = np.array([[float(signal.scale)] for signal in members])
        self._offset = np.array([[float(signal.offset)] for signal in members])
        self._plain = bool(np.all(self._scale == 1.0) and np.all(self._offset == 0.0))
        self._shifted = bool(np.any(self._offset != 0.0))

    def read(self, data: Payloads) -> dict[str, Floats]:
        raw = data[:, self._first : self._stop].view(self._dtype)
        values = np.ascontiguousarray(raw.T).astype(np.float64)
        if not self._plain:
            values *= self._scale
            if self._shifted:
                values += self._offset
        return dict(zip(self._names, values, strict=True))


def _type_of(signal: Signal) -> str:
    kind = "f" if signal.is_float else "i" if signal.signed else "u"
    return f"<{kind}{_INT_TYPES[signal.length]}"


def _groupable(signal: Signal) -> bool:
    aligned = signal.length in _INT_TYPES and not signal.big_endian and signal.start % 8 == 0
    return aligned and not _needs_integers(signal) and not (signal.is_float and signal.length == 8)


def _neighbours(message: Message) -> tuple[list[list[Signal]], list[Signal]]:
    groups: list[list[Signal]] = []
    single: list[Signal] = []
    for signal in sorted(message.signals, key=lambda item: item.start):
        if not _groupable(signal):
            single.append(signal)
            continue
        last = groups[-1][-1] if groups else None
        if last and last.start + last.length == signal.start and _type_of(last) == _type_of(signal):
            groups[-1].append(signal)
        else:
            groups.append([signal])
    return groups, single


def _reader(signal: Signal, width: int) -> Callable[[Payloads], npt.NDArray[np.uint64]]:
    """A function from payloads to raw numbers as unsigned 64-bit, not yet masked."""
    if signal.big_endian:
        top = signal.start - signal.start % 8 + 7 - signal.start % 8
        first, last = top // 8, (top + signal.length - 1) // 8
        base = max(0, min(last, width - 1) - 7)
        shift = 8 * (base + 8) - (top + signal.length)
        order, inside = ">u8", base <= first
        pieces = [
            (byte, 8 * (last - byte) - (8 * (last + 1) - (top + signal.length))) for byte in range(first, last + 1)
        ]
    else:
        first, last = signal.start // 8, (signal.start + signal.length - 1) // 8
        base = min(first, width - 8)
        shift = signal.start - 8 * base
        order, inside = "<u8", shift + signal.length <= 64
        pieces = [(byte, 8 * byte - signal.start) for byte in range(first, last + 1)]
    if inside:
        return lambda data: data[:, base : base + 8].view(order)[:, 0] >> np.uint64(shift)
    return lambda data: _assembled(data, pieces)


def _assembled(data: Payloads, pieces: list[tuple[int, int]]) -> npt.NDArray[np.uint64]:
    raw = np.zeros(len(data), np.uint64)
    for byte, position in pieces:
        part = data[:, byte].astype(np.uint64)
        raw |= part << np.uint64(position) if position >= 0 else part >> np.uint64(-position)
    return raw


def _needs_integers(signal: Signal) -> bool:
    """Whether whole-number scaling could leave the 53 bits a float64 holds; such a signal is scaled in integers."""
    if signal.is_float or (signal.scale == 1 and signal.offset == 0):
        return False
    whole = float(signal.scale).is_integer() and float(signal.offset).is_integer()
    return whole and abs(signal.scale) * 2.0**signal.length + abs(signal.offset) > _EXACT


def _physical(signal: Signal, raw: npt.NDArray[np.uint64]) -> Floats:
    room = np.uint64(64 - signal.length)
    number: npt.NDArray[Any]
    if signal.is_float:
        number = (raw << room >> room).astype(f"u{signal.length // 8}").view(f"f{signal.length // 8}")
    elif signal.signed:
        number = (raw << room).view(np.int64) >> np.int64(64 - signal.length)
    else:
        number = raw << room >> room
    if _needs_integers(signal):
        scale, offset = int(signal.scale), int(signal.offset)
        return np.array([float(value * scale + offset) for value in number.tolist()], np.float64)
    values = number.astype(np.float64)
    if signal.scale != 1.0:
        values *= float(signal.scale)
    if signal.offset != 0.0:
        values += float(signal.offset)
    return values


def encode(message: Message, values: Mapping[str, float]) -> bytes:
    """The payload of one message. Bits without a signal are zero.

    Args:
        message: its layout.
        values: one physical value per signal.

    Raises:
        ValueError: a signal is missing or unknown, or a value is not finite, outside the signal's range or does not
            fit its bits. Nothing is clipped.
    """
    unknown, missing = values.keys() - message.by_name.keys(), message.by_name.keys() - values.keys()
    if unknown or missing:
        found = ", ".join(sorted(values))
        raise ValueError(f"{message.name}: found values for {found}; expected {', '.join(message.by_name)}")
    total = 0
    for signal in message.signals:
        total |= _placed(signal, _raw(message, signal, values[signal.name]), message.length)
    return total.to_bytes(message.length, "little")


def _raw(message: Message, signal: Signal, value: float) -> int:
    where = f"{message.name}.{signal.name}"
    if not math.isfinite(value):
        raise ValueError(f"{where}: found {value}; expected a finite number")
    if (signal.low is not None and value < signal.low) or (signal.high is not None and value > signal.high):
        raise ValueError(f"{where}: found {value:g} {signal.unit}; expected {signal.low} to {signal.high}")
    if signal.is_float:
        return _float_bits(signal, (value - signal.offset) / signal.scale, where)
    if _needs_integers(signal) and float(value).is_integer():
        number = round((int(value) - int(signal.offset)) / int(signal.scale))
    elif signal.scale == 1 and signal.offset == 0:
        number = round(value)
    else:
        number = round((value - signal.offset) / signal.scale)
    low, high = (
        (-(1 << signal.length - 1), (1 << signal.length - 1) - 1) if signal.signed else (0, (1 << signal.length) - 1)
    )
    if not low <= number <= high:
        ends = sorted((low * signal.scale + signal.offset, high * signal.scale + signal.offset))
        raise ValueError(f"{where}: found {value:g} {signal.unit}; its bits hold {ends[0]:g} to {ends[1]:g}")
    return number & ((1 << signal.length) - 1)


def _float_bits(signal: Signal, value: float, where: str) -> int:
    try:
        return int.from_bytes(struct.pack(_FLOAT_FORMATS[signal.length], value), "little")
    except OverflowError:
        raise ValueError(f"{where}: found {value:g}; too large for a {signal.length}-bit float") from None


def _placed(signal: Signal, raw: int, size: int) -> int:
    """The raw number at its place in the payload, read as one little-endian integer."""
    if not signal.big_endian:
        return raw << signal.start
    top = signal.start - signal.start % 8 + 7 - signal.start % 8
    swapped = raw << (8 * size - top - signal.length)
    return int.from_bytes(swapped.to_bytes(size, "big"), "little")
