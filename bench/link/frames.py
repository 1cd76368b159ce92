"""Frames: timestamped id and bytes, in batches. The unit that links carry and `/raw` records."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

FRAME: Final = np.dtype(
    [
        ("t_ns", "<i8"),  # host time of receipt or sending, UNIX ns (virtual in simulation)
        ("hw_ns", "<i8"),  # the interface's own timestamp, ns on a clock of its own; 0 where it has none
        ("id", "<u4"),  # CAN identifier; bit 31 set for extended identifiers
        ("flags", "u1"),  # bit 0: sent by the host; 1: CAN FD; 2: error frame; 3: bit rate switched; 4: remote frame
        ("length", "u1"),  # payload bytes, 0..64
        ("data", "u1", (64,)),
    ]
)
_PLAIN: Final = np.dtype((np.void, FRAME.itemsize))
_RECORD: Final = struct.Struct("<qqIBB64s")
SENT: Final = 1
FD: Final = 2
ERROR: Final = 4
SWITCHED: Final = 8
"""Of a CAN FD frame that came: its data phase was at the data bit rate. Not every link tells."""
REMOTE: Final = 16
"""A request for a frame: `length` is that of the frame asked for, and there is no data. Only python-can's side sees one."""
EXTENDED: Final = 1 << 31
"""Bit of `id`: an identifier of 29 bits."""

FrameBatch = npt.NDArray[np.void]
"""A one-dimensional structured array of dtype FRAME, in order of arrival."""


def empty_batch() -> FrameBatch:
    """A batch without frames."""
    return np.empty(0, FRAME)


def frame(identifier: int, payload: bytes, *, t_ns: int = 0, flags: int = 0) -> FrameBatch:
    """A batch of one frame.

    Raises:
        ValueError: the payload is longer than 64 bytes.
    """
    return batch_of([packed(identifier, payload, t_ns=t_ns, flags=flags)])


def packed(identifier: int, payload: bytes, *, t_ns: int = 0, flags: int = 0) -> bytes:
    """The bytes of one frame of a batch.

    Raises:
        ValueError: the payload is longer than 64 bytes.
    """
    if len(payload) > 64:
        raise ValueError(f"payload of {len(payload)} bytes; a CAN FD frame holds at most 64")
    return _RECORD.pack(t_ns, 0, identifier, flags, len(payload), payload)


def batch_of(frames: Iterable[bytes]) -> FrameBatch:
    """A batch of packed frames: quicker than joining batches of one frame."""
    return np.frombuffer(bytearray(b"".join(frames)), FRAME)


def joined(batches: Sequence[FrameBatch]) -> FrameBatch:
    """Batches one after the other, as one. As plain bytes: numpy takes ten times as long to compare their fields."""
    if len(batches) == 1:
        return batches[0]
    return np.concatenate([np.empty(0, _PLAIN), *(b.view(_PLAIN) for b in batches)]).view(FRAME)


def by_time(batch: FrameBatch) -> FrameBatch:
    """The frames in order of time, those of one time as they were; as plain bytes, too."""
    return batch.view(_PLAIN)[np.argsort(batch["t_ns"], kind="stable")].view(FRAME)


def frames_of(records: bytes, version: int) -> FrameBatch:
    """A batch from the bytes of a recording of that layout version; version 1 knew no `hw_ns`."""
    if version > 1:
        return np.frombuffer(records, FRAME)
    old = np.frombuffer(records, np.dtype([(n, FRAME[n]) for n in FRAME.names or () if n != "hw_ns"]))
    batch = np.zeros(len(old), FRAME)
    for name in old.dtype.names or ():
        batch[name] = old[name]
    return batch


def payload(record: np.void) -> bytes:
    """The payload bytes of one frame of a batch."""
    out: bytes = record["data"][: int(record["length"])].tobytes()
    return out
