"""Between python-can's messages and rows of frame batches."""

from __future__ import annotations

from collections.abc import Sequence

import can
import numpy as np

from bench.link.frames import ERROR, EXTENDED, FD, FRAME, REMOTE, SENT, SWITCHED, FrameBatch, empty_batch


def batch_of(messages: Sequence[can.Message], t_ns: int, *, own_time: bool = False) -> FrameBatch:
    """Messages as frames, in order; remote frames, which carry nothing, are left out.

    Args:
        messages: as an interface gave them.
        t_ns: host time of receipt, UNIX ns.
        own_time: their timestamps are the interface's own and go to `hw_ns`.
    """
    rows = [
        (
            t_ns,
            round(m.timestamp * 1e9) if own_time else 0,
            m.arbitration_id | (EXTENDED if m.is_extended_id and not m.is_error_frame else 0),
            (FD if m.is_fd else 0)
            | (ERROR if m.is_error_frame else 0)
            | (SWITCHED if m.is_fd and m.bitrate_switch else 0),
            min(len(m.data), 64),
            np.frombuffer(bytes(m.data[:64]).ljust(64, b"\0"), np.uint8),
        )
        for m in messages
        if not m.is_remote_frame
    ]
    return np.array(rows, FRAME) if rows else empty_batch()


def messages_of(batch: FrameBatch, *, brs: bool = False, timestamp: float | None = None) -> list[can.Message]:
    """Frames as messages; `timestamp` (UNIX s) instead of each frame's host time. With `brs` every CAN FD frame switches its
    bit rate, else those that did."""
    data = batch["data"].tobytes()
    columns = zip(*(batch[n].tolist() for n in ("id", "flags", "length", "t_ns")), strict=True)
    return [
        can.Message(
            timestamp=t_ns * 1e-9 if timestamp is None else timestamp,
            arbitration_id=identifier & ~EXTENDED,
            is_extended_id=bool(identifier & EXTENDED),
            is_error_frame=bool(flags & ERROR),
            is_remote_frame=bool(flags & REMOTE),
            is_fd=bool(flags & FD),
            bitrate_switch=bool(flags & FD) and (brs or bool(flags & SWITCHED)),
            is_rx=not flags & SENT,
            dlc=length,
            data=None if flags & REMOTE else data[64 * row : 64 * row + length],
        )
        for row, (identifier, flags, length, t_ns) in enumerate(columns)
    ]
