"""Blocks of a capture as bytes, in two forms; everything is little endian.

    block = number u16 | offset u32 | data | CRC-32 (zlib) of all before it      one ISO-TP payload on CAN
    piece = number u16 | offset u32 | count u8 | data, 57 bytes of which count   one message of 64 bytes in serial packets

`number` tells one capture from the next, `offset` where the data belong in its buffer. A piece has no CRC of its own: the
packet around it has one.
"""

from __future__ import annotations

import struct
import zlib
from typing import Final, NamedTuple

HEAD: Final = struct.Struct("<HI")
PIECE_HEAD: Final = struct.Struct("<HIB")
CRC_BYTES: Final = 4
PIECE: Final = 64
ROOM: Final = PIECE - PIECE_HEAD.size
"""Bytes of data that a piece holds."""
OVERHEAD: Final = HEAD.size + CRC_BYTES
"""Bytes of a block beside its data."""


class Block(NamedTuple):
    """A part of a capture's buffer and where it belongs."""

    number: int
    offset: int
    data: bytes


def block(number: int, offset: int, data: bytes) -> bytes:
    """A part of a buffer as one payload.

    Raises:
        ValueError: the number has over 16 bits or the offset over 32.
    """
    if not 0 <= number <= 0xFFFF or not 0 <= offset <= 0xFFFFFFFF:
        raise ValueError(f"block {number} at {offset}; they have 16 and 32 bits")
    content = HEAD.pack(number, offset) + data
    return content + zlib.crc32(content).to_bytes(CRC_BYTES, "little")


def block_of(payload: bytes) -> Block | None:
    """The block that a payload holds; None when it is too short or its CRC does not hold."""
    content = payload[:-CRC_BYTES]
    if len(content) < HEAD.size or zlib.crc32(content) != int.from_bytes(payload[-CRC_BYTES:], "little"):
        return None
    number, offset = HEAD.unpack_from(content)
    return Block(number, offset, content[HEAD.size :])


def pieces(number: int, offset: int, data: bytes) -> tuple[bytes, ...]:
    """A part of a buffer as messages of 64 bytes, in order.

    Raises:
        ValueError: the number has over 16 bits, or the last offset over 32.
    """
    if not 0 <= number <= 0xFFFF or not 0 <= offset <= offset + len(data) <= 0xFFFFFFFF:
        raise ValueError(f"pieces of {number} from {offset}; they have 16 and 32 bits")
    out = []
    for at in range(0, len(data), ROOM):
        part = data[at : at + ROOM]
        out.append((PIECE_HEAD.pack(number, offset + at, len(part)) + part).ljust(PIECE, b"\0"))
    return tuple(out)


def piece_of(payload: bytes) -> Block | None:
    """The part that a message holds; None when it has another length, or says that it holds nothing or more than it can."""
    if len(payload) != PIECE:
        return None
    number, offset, count = PIECE_HEAD.unpack_from(payload)
    if not 0 < count <= ROOM:
        return None
    return Block(number, offset, payload[PIECE_HEAD.size : PIECE_HEAD.size + count])
