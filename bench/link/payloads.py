"""Payloads of whole batches from values: the inverse of `bench.link.codec.Decoder`, by the same places of bits."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from bench.link.codec import FLOATS, Array, Payloads, aligned_type, bits_of, bytes_of, laid_out
from bench.link.windows import SIDE, Words, fits, places
from bench.rigfile.messages import Message, Signal

Codes = npt.NDArray[Any]
_LARGEST: Final = {16: 65504.0, 32: float(2**128 - 2**104), 64: sys.float_info.max}


class Encoder:
    """Encodes payloads of one message. `names` are its signals in the order of the rows of a table, as a `Decoder` has them.

    Args:
        message: which.
        counts: names of signals whose bits are given apart, as whole numbers; their values in a table are to be raw zero.
    """

    def __init__(self, message: Message, counts: Sequence[str] = ()) -> None:
        self.message = message
        signals, self._groups, self._places = laid_out(message)
        self.names = tuple(s.name for s in signals)
        self._scales = np.array([s.scale for s in signals])[:, None]
        self._offsets = np.array([s.offset for s in signals])[:, None]
        self._shifted = bool(self._offsets.any())
        limits = [_limits(s) for s in signals]
        self._low, self._high = (np.array([x[k] for x in limits])[:, None] for k in (0, 1))
        self._whole = np.array([not s.is_float for s in signals])
        self._all_whole, self._all_float = bool(self._whole.all()), not self._whole.any()
        apart = [(row, message.signal(name)) for row, name in enumerate(counts)]
        self._counts = list(places([(row, s) for row, s in apart if fits(s, bytes_of)], bytes_of))
        self._put = [(row, s) for row, s in apart if not fits(s, bytes_of)]

    def table(self, values: Array, counts: Codes | None = None) -> Payloads:
        """Payloads (n, message.length) of values (signals, n) in the signals' units, and of those given apart (counts, n).

        A value beyond what the bits can hold becomes the nearest that they can, as a converter at its end does; what is not
        a number is that for a float, and raw zero for an integer. Of whole numbers given apart the low bits are put in.
        """
        raw = values - self._offsets if self._shifted else values.copy()
        raw /= self._scales
        if self._all_whole:
            np.rint(raw, out=raw)
        else:
            raw[self._whole] = np.rint(raw[self._whole])
        np.clip(raw, self._low, self._high, out=raw)
        wide = np.zeros((raw.shape[1], self.message.length + 2 * SIDE), np.uint8)
        out = wide[:, SIDE:-SIDE]
        if not self._all_float:
            np.copyto(raw, 0.0, where=self._whole[:, None] & np.isnan(raw))
        for p in self._places:
            p.write(wide, raw[p.rows].astype(np.int64))
        for row, group in self._groups:
            _write(out, group, raw[row : row + len(group)])
        if counts is not None:
            for p in self._counts:
                p.write(wide, counts[p.rows])
            for row, s in self._put:
                put(out, s, counts[row])
        return out


def put(payloads: Payloads, s: Signal, raw: Codes) -> None:
    """Put the bits of one signal, whole numbers (n,) of any sign, into payloads (n, bytes); the others stay."""
    first_bit, order = bytes_of(s)
    word = raw.astype(np.uint64) if raw.dtype.kind == "u" else raw.astype(np.int64).view(np.uint64)  # two's complement
    mask = (1 << s.length) - 1
    word = word & np.uint64(mask)
    for k, byte in enumerate(order):  # least significant first
        shift = 8 * k - first_bit
        held = (mask >> shift if shift >= 0 else mask << -shift) & 0xFF
        part = (word >> np.uint64(shift) if shift >= 0 else word << np.uint64(-shift)).astype(np.uint8)
        payloads[:, byte] = part if held == 0xFF else (payloads[:, byte] & np.uint8(0xFF ^ held)) | part


def taken(payloads: Payloads, s: Signal) -> Words:
    """The bits of one signal of payloads, as whole numbers (n,) without a sign."""
    plain = Signal(s.name, s.start, s.length, s.little_endian, False, False, 1.0, 0.0, "", {}, "")
    out: Words = bits_of(payloads, plain).astype(np.uint64)
    return out


def _limits(s: Signal) -> tuple[float, float]:
    """Least and greatest raw value; of long integers the last that a float64 holds inside the range."""
    if s.is_float:
        return -_LARGEST[s.length], _LARGEST[s.length]
    low, high = (-(1 << s.length - 1), (1 << s.length - 1) - 1) if s.signed else (0, (1 << s.length) - 1)
    top = float(high)
    return float(low), top if top <= high else float(np.nextafter(top, 0.0))


def _write(out: Payloads, group: list[Signal], raw: Array) -> None:
    """Put neighbours of one aligned type in by one view, and what lies at any place bit by bit."""
    first, kind = group[0], aligned_type(group[0])
    if kind:
        low = first.start // 8
        high = low + len(group) * first.length // 8
        with np.errstate(invalid="ignore"):
            out[:, low:high].view(kind)[:] = raw.T
        return
    numbers = raw[0]
    if first.is_float:
        bits = np.ascontiguousarray(numbers.astype(FLOATS[first.length])).view(f"<u{first.length // 8}")
        put(out, first, bits.astype(np.uint64))
    elif first.signed:
        put(out, first, numbers.astype(np.int64))
    else:
        put(out, first, numbers.astype(np.uint64))
