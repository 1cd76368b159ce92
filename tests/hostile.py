"""Recordings that somebody made up: the chunks of a sound one changed, with every length and CRC put right again."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path

import lz4.frame

MAGIC = b"\x89MCAP0\r\n"
Chunk = tuple[bytes, bytes]
"""The head of a chunk record (its times) and its records."""


def record_of(opcode: int, data: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(data)) + data


def message(channel: int, t_ns: int, data: bytes) -> bytes:
    return record_of(0x05, struct.pack("<HIQQ", channel, 0, t_ns, t_ns) + data)


def chunk(records: bytes, times: bytes = struct.pack("<QQ", 0, (1 << 63) - 1)) -> bytes:
    packed = lz4.frame.compress(records)
    head = times + struct.pack("<QII", len(records), zlib.crc32(records), 3) + b"lz4"
    return record_of(0x06, head + struct.pack("<Q", len(packed)) + packed)


def whole(records: Iterable[bytes]) -> bytes:
    """A file of these records that ends as it should, without a summary."""
    data = MAGIC + b"".join(records)
    end = record_of(0x0F, struct.pack("<I", zlib.crc32(data)))
    return data + end + record_of(0x02, bytes(20)) + MAGIC


def records_of(path: Path) -> list[tuple[int, bytes]]:
    """The records of a file up to the end of its data."""
    data, at, out = path.read_bytes(), len(MAGIC), []
    while data[at] != 0x0F:
        length = int.from_bytes(data[at + 1 : at + 9], "little")
        out.append((data[at], data[at + 9 : at + 9 + length]))
        at += 9 + length
    return out


def inside(data: bytes) -> bytes:
    """The records of a chunk record."""
    name = int.from_bytes(data[28:32], "little")
    return bytes(lz4.frame.decompress(data[32 + name + 8 :]))


def rewritten(sound: Path, change: Callable[[bytes], bytes]) -> bytes:
    """A sound recording, the records of each of its chunks changed, every CRC right."""
    return whole(
        chunk(change(inside(data)), data[:16]) if opcode == 0x06 else record_of(opcode, data)
        for opcode, data in records_of(sound)
    )


def with_chunks(sound: Path, chunks: Iterable[bytes]) -> bytes:
    """A sound recording with more chunks behind its own."""
    return whole([*(record_of(opcode, data) for opcode, data in records_of(sound)), *chunks])


def events_channel(sound: Path) -> int:
    """The number of the channel /events."""
    for opcode, data in records_of(sound):
        at, records = 0, inside(data) if opcode == 0x06 else b""
        while at < len(records):
            length = int.from_bytes(records[at + 1 : at + 9], "little")
            body = records[at + 9 : at + 9 + length]
            if records[at] == 0x04 and b"/events" in body:
                return int.from_bytes(body[:2], "little")
            at += 9 + length
    raise LookupError("/events")
