"""Whole numbers at any place of a payload, many at once: each lies in a window of eight bytes, which is one machine word.

A window begins at any byte. Payloads stand in a wider array with seven bytes of nothing on either side, so that each has all
its windows: those of little-endian signals begin at the byte of the least significant bit, those of big-endian ones end there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from bench.rigfile.messages import Signal

Payloads = npt.NDArray[np.uint8]
Words = npt.NDArray[np.uint64]
BytesOf = Callable[[Signal], tuple[int, list[int]]]
SIDE: Final = 7


@dataclass(frozen=True)
class Places:
    """Where signals of one byte order and kind lie: their rows in a table, the bytes of a widened payload where their windows
    begin, and how far their bits are moved, all (signals,) or (signals, 1)."""

    rows: npt.NDArray[np.intp]
    little_endian: bool
    signed: bool
    begins: npt.NDArray[np.intp]
    shifts: Words
    lengths: Words

    def read(self, wide: Payloads) -> npt.NDArray[Any]:
        """The numbers (signals, n) of widened payloads (n, bytes)."""
        words = windows(wide, self.little_endian)[:, self.begins].T.astype(np.uint64)
        down = np.uint64(64) - self.lengths
        up = words << (down - self.shifts)
        return up.view(np.int64) >> down.view(np.int64) if self.signed else up >> down

    def write(self, wide: Payloads, numbers: npt.NDArray[np.int64]) -> None:
        """Put numbers (signals, n) where nothing was put before."""
        masks = np.uint64(2**64 - 1) >> (np.uint64(64) - self.lengths)
        words = (numbers.view(np.uint64) & masks) << self.shifts
        into = windows(wide, self.little_endian)
        for begin, word in zip(self.begins.tolist(), words, strict=True):  # windows overlap: one after the other
            into[:, begin] |= word


def fits(s: Signal, bytes_of: BytesOf) -> bool:
    """Whether a signal is a whole number that lies in one window, and that a signed word holds."""
    whole = not s.is_float and (s.signed or s.length < 64)
    return whole and bytes_of(s)[0] + s.length <= 64


def places(signals: Sequence[tuple[int, Signal]], bytes_of: BytesOf) -> Iterator[Places]:
    """The places of signals that fit, with their rows, by byte order and kind."""
    for little in (True, False):
        for signed in (True, False):
            mine = [(row, s, *bytes_of(s)) for row, s in signals if (s.little_endian, s.signed) == (little, signed)]
            if not mine:
                continue
            yield Places(
                np.array([row for row, *_ in mine], np.intp), little, signed,
                np.array([order[0] + (SIDE if little else 0) for *_, order in mine], np.intp),
                np.array([bit for _, _, bit, _ in mine], np.uint64)[:, None],
                np.array([s.length for _, s, *_ in mine], np.uint64)[:, None],
            )  # fmt: skip


def widened(payloads: Payloads) -> Payloads:
    """Payloads (n, bytes) with nothing on either side, as `windows` needs them."""
    out = np.zeros((len(payloads), payloads.shape[1] + 2 * SIDE), np.uint8)
    out[:, SIDE:-SIDE] = payloads
    return out


def windows(wide: Payloads, little_endian: bool) -> npt.NDArray[np.uint64]:
    """Every window of widened payloads, (n, bytes - 7), as views of them."""
    count, length = wide.shape
    return np.ndarray((count, length - SIDE), "<u8" if little_endian else ">u8", wide.data, 0, (length, 1))
