"""Bytes of a line that is no bus, carried by frames: what serves messages serves them too."""

from __future__ import annotations

from typing import Final

from bench.link.frames import FrameBatch, batch_of, packed

BYTES: Final = 0x7FFFFFFF
"""Identifier, of no bus, of frames that are no messages but bytes, up to 64 each."""


def framed(data: bytes, t_ns: int) -> FrameBatch:
    """Bytes as frames that carry them."""
    return batch_of(packed(BYTES, data[k : k + 64], t_ns=t_ns) for k in range(0, len(data), 64))


def unframed(batch: FrameBatch) -> bytes:
    """The bytes that frames carry; messages carry none."""
    mine = batch[batch["id"] == BYTES]
    whole, size = mine["data"].tobytes(), mine["data"].shape[1]
    return b"".join(whole[size * k : size * k + n] for k, n in enumerate(mine["length"].tolist()))
