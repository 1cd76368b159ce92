"""Reading MCAP for `bench.recording`: one sequential pass that checks every CRC and indexes the chunks, whole or not.

A file that was cut off is read up to its last complete chunk and says so; one way of reading serves both.
"""

from __future__ import annotations

import struct
import zlib
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, DataEnd, Footer, Header, Metadata

from bench import layout
from bench.errors import RecordingError

MAX_CHUNK = 64 << 20
KEPT = 160  # decoded chunks of half a second: an analysis goes over its steps more than once
RAW = layout.raw_topic("")
MAGIC = b"\x89MCAP0\r\n"
DAMAGED = "the file was damaged after it was written"
RECORDS: dict[int, Any] = {
    Opcode.HEADER: Header, Opcode.METADATA: Metadata, Opcode.ATTACHMENT: Attachment, Opcode.CHANNEL: Channel,
    Opcode.CHUNK: Chunk,
}  # fmt: skip
"""Those that are kept; schemas and indexes are not needed to read."""
_MESSAGE = struct.Struct("<HIQQ")


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


@dataclass
class McapFile:
    """An indexed file. `messages` is the only way to its content."""

    path: Path
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    topics: dict[int, tuple[str, dict[str, str]]] = field(default_factory=dict)
    chunks: list[ChunkPlace] = field(default_factory=list)
    profile: str = ""
    truncated: bool = True
    _cache: OrderedDict[int, list[tuple[str, int, bytes]]] = field(default_factory=OrderedDict)

    def messages(self, topic: str, start_ns: int = 0, end_ns: int = 1 << 63) -> Iterator[tuple[int, bytes]]:
        """Log time and data of a topic's messages with start <= log time < end, in file order."""
        for number, chunk in enumerate(self.chunks):
            if chunk.end_ns >= start_ns and chunk.start_ns < end_ns:
                for name, t_ns, data in self._read(number) if topic.startswith(RAW) else self._decoded(number):
                    if name == topic and start_ns <= t_ns < end_ns:
                        yield t_ns, data

    def _decoded(self, number: int) -> list[tuple[str, int, bytes]]:
        """The messages of a chunk but its raw frames, which are most of it and of no use to an analysis. Kept."""
        if number in self._cache:
            self._cache.move_to_end(number)
            return self._cache[number]
        out = self._cache[number] = [m for m in self._read(number) if not m[0].startswith(RAW)]
        if len(self._cache) > KEPT:
            self._cache.popitem(last=False)
        return out

    def _read(self, number: int) -> list[tuple[str, int, bytes]]:
        place = self.chunks[number]
        with self.path.open("rb") as file:
            file.seek(place.offset)
            records = _decompressed(self.path, place, file.read(place.length))
        out = []
        for channel, t_ns, data in self._parse(records):
            if channel in self.topics:
                out.append((self.topics[channel][0], t_ns, data))
        return out

    def _parse(self, records: bytes) -> Iterator[tuple[int, int, bytes]]:
        at = 0
        while at + 9 <= len(records):
            opcode, length = records[at], int.from_bytes(records[at + 1 : at + 9], "little")
            at += 9
            if at + length > len(records):
                raise RecordingError(f"recording {self.path}: a chunk ends in the middle of a record")
            if opcode == 0x05:
                channel, _, t_ns, _ = _MESSAGE.unpack_from(records, at)
                yield channel, t_ns, records[at + _MESSAGE.size : at + length]
            elif opcode == 0x04:
                self._learn(records[at : at + length])
            at += length

    def _learn(self, data: bytes) -> None:
        c = Channel.read(ReadDataStream(BytesIO(data)))
        self.topics[c.id] = (c.topic, dict(c.metadata))

    def learn_channels(self) -> None:
        """Find the channels of a file without a summary: they stand in its chunks."""
        for number in range(len(self.chunks)):
            self._decoded(number)
        self._cache.clear()


def _decompressed(path: Path, place: ChunkPlace, data: bytes) -> bytes:
    if place.size > MAX_CHUNK:
        raise RecordingError(f"recording {path}: a chunk of {place.size} bytes; expected at most {MAX_CHUNK}")
    try:
        if place.compression == "lz4":
            data = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=place.size + 1)
        elif place.compression:
            raise RecordingError(f"recording {path}: compression {place.compression!r}; expected lz4")
    except RuntimeError as error:
        raise RecordingError(f"recording {path}: a chunk cannot be decompressed: {error}") from error
    if len(data) != place.size or zlib.crc32(data) != place.crc:
        raise RecordingError(f"recording {path}: a chunk fails its CRC; {DAMAGED}")
    return data


def index(path: Path) -> McapFile:
    """Read a file once, checking the CRCs of its data section and of its summary.

    Raises:
        RecordingError: it cannot be read, is no MCAP file, or is damaged. A file that was cut off is no error.
    """
    out = McapFile(path)
    try:
        with path.open("rb") as file:
            size = file.seek(0, 2)
            file.seek(0)
            if file.read(len(MAGIC)) != MAGIC:
                raise RecordingError(f"{path} is not an MCAP recording: it does not begin as one")
            out.truncated = not _scan(out, file, size)
            file.seek(-len(MAGIC), 2)
            closed = size > 2 * len(MAGIC) and file.read() == MAGIC
    except OSError as error:
        raise RecordingError(f"recording {path}: cannot be read: {error.strerror or error}") from error
    except (McapError, ValueError, KeyError, IndexError, struct.error, OverflowError) as error:
        raise RecordingError(f"recording {path}: holds a record that cannot be right: {error}") from error
    if not out.profile:
        raise RecordingError(f"{path} is not an MCAP recording: it ends before a header")
    if out.truncated and closed:
        raise RecordingError(f"recording {path}: its records do not lead to its end; {DAMAGED}")
    if out.truncated:
        out.learn_channels()
    return out


def _scan(out: McapFile, file: BinaryIO, size: int) -> bool:
    """Take every complete record; true when the file ends as it should.

    A length is held against the size of the file before anything is read: a cut is told from damage, and damage takes
    no memory.
    """
    crc = zlib.crc32(MAGIC)
    while True:
        head = file.read(9)
        length = int.from_bytes(head[1:], "little")
        if len(head) < 9 or length > size - file.tell():
            return False
        if length > MAX_CHUNK:
            raise RecordingError(f"recording {out.path}: a record of {length} bytes; expected at most {MAX_CHUNK}")
        data = file.read(length)
        stream = ReadDataStream(BytesIO(data))
        if head[0] == Opcode.DATA_END:
            if DataEnd.read(stream).data_section_crc not in (0, crc):
                raise RecordingError(f"recording {out.path}: fails its CRC; {DAMAGED}")
            crc = 0  # that of the summary begins here
        elif head[0] == Opcode.FOOTER:
            crc = zlib.crc32(data[:16], zlib.crc32(head, crc))
            if Footer.read(stream).summary_crc not in (0, crc):
                raise RecordingError(f"recording {out.path}: its summary fails its CRC; {DAMAGED}")
            return file.read() == MAGIC
        else:
            crc = zlib.crc32(data, zlib.crc32(head, crc))
            if head[0] == Opcode.ATTACHMENT and int.from_bytes(data[-4:], "little") not in (0, zlib.crc32(data[:-4])):
                raise RecordingError(f"recording {out.path}: an attachment fails its CRC; {DAMAGED}")
            if head[0] in RECORDS:
                _take(out, RECORDS[head[0]].read(stream), file.tell())


def _take(out: McapFile, record: object, after: int) -> None:
    if isinstance(record, Header):
        out.profile = record.profile or "none"
    elif isinstance(record, Metadata):
        out.metadata[record.name] = dict(record.metadata)
    elif isinstance(record, Attachment):
        out.attachments[record.name] = record.data
    elif isinstance(record, Channel):
        out.topics[record.id] = (record.topic, dict(record.metadata))
    elif isinstance(record, Chunk):
        out.chunks.append(
            ChunkPlace(
                after - len(record.data),
                len(record.data),
                record.uncompressed_size,
                record.uncompressed_crc,
                record.compression,
                record.message_start_time,
                record.message_end_time,
            )
        )
