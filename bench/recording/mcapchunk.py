"""One chunk of an MCAP file: found in the file, decompressed, and taken apart. Whatever is wrong in it is a RecordingError."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import lz4.frame
from mcap.exceptions import McapError
from mcap.opcode import Opcode

from bench.errors import RecordingError

MAX_CHUNK: Final = 64 << 20
MAX_RECORDS: Final = 1 << 18
"""In a chunk; ours end at 1 MiB, with some tens of records."""
DAMAGED: Final = "the file was damaged after it was written"
_MESSAGE: Final = struct.Struct("<HIQQ")
_MESSAGE_CODE, _CHANNEL_CODE, _SCHEMA_CODE = int(Opcode.MESSAGE), int(Opcode.CHANNEL), int(Opcode.SCHEMA)
_HEAD: Final = struct.Struct("<QQQII")


@dataclass(frozen=True, slots=True)
class ChunkPlace:
    """Where a chunk's compressed records lie, and what they span."""

    offset: int
    length: int
    size: int
    crc: int
    compression: str
    start_ns: int
    end_ns: int


@contextmanager
def sound(path: Path) -> Iterator[None]:
    """Where bytes are taken apart: what that raises is the file's fault, and is told with its name.

    Raises:
        RecordingError: instead of a dozen others.
    """
    try:
        yield
    except (McapError, ValueError, KeyError, IndexError, TypeError, struct.error, OverflowError, RecursionError, EOFError,
            RuntimeError) as error:  # fmt: skip
        what = str(error)[:200] or type(error).__name__
        raise RecordingError(f"recording {path}: holds a record that cannot be right: {what}") from error


def place_of(data: bytes, after: int) -> ChunkPlace:
    """The place of a chunk from its record, which ends at byte `after` of the file.

    Raises:
        ValueError, struct.error: its lengths do not fit the record.
    """
    start_ns, end_ns, size, crc, name = _HEAD.unpack_from(data)
    at = _HEAD.size + name
    if name > 64 or at + 8 + int.from_bytes(data[at : at + 8], "little") != len(data):
        raise ValueError("the lengths in a chunk do not add up")
    compression = data[_HEAD.size : at].decode("utf-8")
    length = len(data) - at - 8
    return ChunkPlace(after - length, length, size, crc, compression, start_ns, end_ns)


def decompressed(path: Path, place: ChunkPlace, data: bytes) -> bytes:
    """A chunk's records.

    Raises:
        RecordingError: larger than a chunk may be, of a compression that ours do not have, or damaged.
    """
    if place.size > MAX_CHUNK:
        raise RecordingError(f"recording {path}: a chunk of {place.size} bytes; expected at most {MAX_CHUNK}")
    if place.compression not in ("", "lz4"):
        raise RecordingError(f"recording {path}: compression {place.compression[:16]!r}; expected lz4")
    try:
        if place.compression:
            data = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=place.size + 1)
    except RuntimeError as error:
        raise RecordingError(f"recording {path}: a chunk cannot be decompressed: {error}") from error
    if len(data) != place.size or zlib.crc32(data) != place.crc:
        raise RecordingError(f"recording {path}: a chunk fails its CRC; {DAMAGED}")
    return data


def records_in(path: Path, records: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Channel, log time and data of each message; channel -1 stands for the description of one.

    Raises:
        RecordingError: the records do not add up, or are none that a chunk may hold.
    """
    at = count = 0
    while at < len(records):
        length = int.from_bytes(records[at + 1 : at + 9], "little")
        opcode, at = records[at], at + 9
        count += 1
        if at + length > len(records):
            raise RecordingError(f"recording {path}: a chunk ends in the middle of a record")
        if count > MAX_RECORDS:
            raise RecordingError(f"recording {path}: a chunk of more than {MAX_RECORDS} records; expected fewer")
        if opcode == _MESSAGE_CODE and length >= _MESSAGE.size:
            channel, _, t_ns, _ = _MESSAGE.unpack_from(records, at)
            yield channel, t_ns, records[at + _MESSAGE.size : at + length]
        elif opcode == _CHANNEL_CODE:
            yield -1, 0, records[at : at + length]
        elif opcode != _SCHEMA_CODE:
            raise RecordingError(
                f"recording {path}: a chunk holds a record of kind 0x{opcode:02X} and {length} bytes; expected schemas, "
                "channels and messages"
            )
        at += length
