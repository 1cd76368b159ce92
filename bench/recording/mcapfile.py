"""Reading MCAP for `bench.recording`: one sequential pass that checks every CRC and indexes the chunks, whole or not.

A file that was cut off is read up to its last complete chunk and says so; one way of reading serves both. What is kept
in memory is bounded, whatever the file holds.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np
import numpy.typing as npt
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode

from bench.errors import RecordingError
from bench.recording import layout
from bench.recording.kept import Kept
from bench.recording.mcapchunk import DAMAGED, MAX_CHUNK, ChunkPlace, decompressed, place_of, records_in, sound
from bench.recording.readlimits import ReadLimits, read_limits

KEPT: Final = 160  # decoded chunks of half a second: an analysis goes over its steps more than once
KEPT_BYTES: Final = 64 << 20
OVERHEAD: Final = 160  # bytes that Python adds to each message
MAX_HEADER: Final = 48 << 20
"""Bytes of all attachments, metadata and channels: what a file says of itself."""
RAW = layout.raw_topic("")
MAGIC = b"\x89MCAP0\r\n"
Messages = list[tuple[str, int, bytes]]


@dataclass
class McapFile:
    """An indexed file. `messages` is the only way to its content."""

    path: Path
    limits: ReadLimits = field(default_factory=read_limits)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    topics: dict[int, tuple[str, dict[str, str]]] = field(default_factory=dict)
    chunks: list[ChunkPlace] = field(default_factory=list)
    profile: str = ""
    truncated: bool = True
    _header: int = 0
    _kept: Kept[Messages] = field(default_factory=lambda: Kept(KEPT, KEPT_BYTES))
    _holds: dict[int, frozenset[str]] = field(default_factory=dict)
    _alike: dict[frozenset[str], frozenset[str]] = field(default_factory=dict)

    def messages(self, topic: str, start_ns: int = 0, end_ns: int = 1 << 63) -> Iterator[tuple[int, bytes]]:
        """Log time and data of a topic's messages with start <= log time < end, in file order.

        Raises:
            RecordingError: a chunk is damaged, or holds what cannot be right.
        """
        first, last = self._spans
        for number in np.flatnonzero((last >= start_ns) & (first < end_ns)).tolist():
            raw = topic.startswith(RAW)
            if not raw and topic not in self._holds.get(number, (topic,)):
                continue  # a hundred captures are a hundred topics: without this each goes through the whole file
            for name, t_ns, data in self._read(number) if raw else self._decoded(number):
                if name == topic and start_ns <= t_ns < end_ns:
                    yield t_ns, data

    def everything(self, end_ns: int = 1 << 63) -> Iterator[tuple[str, int, bytes]]:
        """Topic, log time and data of every message of the chunks that begin by then, in file order; nothing is kept.

        Raises:
            RecordingError: a chunk is damaged, or holds what cannot be right.
        """
        for number in np.flatnonzero(self._spans[0] <= end_ns).tolist():
            yield from self._read(number)

    @cached_property
    def _spans(self) -> tuple[npt.NDArray[np.uint64], npt.NDArray[np.uint64]]:
        """First and last time of every chunk, ns."""
        return (np.array([c.start_ns for c in self.chunks], np.uint64),
                np.array([c.end_ns for c in self.chunks], np.uint64))  # fmt: skip

    def _decoded(self, number: int) -> Messages:
        """The messages of a chunk but its raw frames, which are most of it and of no use to an analysis. Kept."""
        found = self._kept.get(number)
        if found is None:
            found = [m for m in self._read(number) if not m[0].startswith(RAW)]
            self._kept.put(number, found, sum(len(data) + OVERHEAD for _, _, data in found))
            holds = frozenset(name for name, _, _ in found)
            self._holds[number] = self._alike.setdefault(holds, holds)
        return found

    def _read(self, number: int) -> Messages:
        place = self.chunks[number]
        with self.path.open("rb") as file:
            file.seek(place.offset)
            records = decompressed(self.path, place, file.read(place.length))
        out: Messages = []
        for channel, t_ns, data in records_in(self.path, records):
            if channel < 0:
                self._learn(data)
            elif channel in self.topics:
                out.append((self.topics[channel][0], t_ns, data))
        return out

    def _learn(self, data: bytes) -> None:
        """A channel's description: it may come again, but only the same."""
        from mcap.records import Channel  # slow to import, and only who reads a file needs it

        with sound(self.path):
            c = Channel.read(ReadDataStream(BytesIO(data)))
            described = (c.topic, dict(c.metadata))
        before = self.topics.setdefault(c.id, described)
        if before is described:
            self.count(len(data))
        elif before != described:
            raise RecordingError(f"recording {self.path}: channel {c.id} is described twice, and not alike")

    def count(self, size: int) -> None:
        """Add to what the file says of itself.

        Raises:
            RecordingError: it is too much.
        """
        self._header += size
        if self._header > MAX_HEADER:
            raise RecordingError(
                f"recording {self.path}: more than {MAX_HEADER} bytes of attachments, metadata and channels; expected fewer"
            )

    def learn_channels(self) -> None:
        """Find the channels of a file without a summary: they stand in its chunks."""
        for number in range(len(self.chunks)):
            self._read(number)

    def take(self, opcode: int, data: bytes, after: int) -> None:
        """Keep a record that ends at byte `after`; schemas and indexes are not needed to read.

        Raises:
            RecordingError: it is one too many, or cannot be right.
        """
        if opcode == Opcode.CHUNK:
            place = place_of(data, after)
            if place.size:  # an empty one holds nothing to come back for
                self.chunks.append(place)
            return
        if opcode == Opcode.CHANNEL:
            self._learn(data)
            return
        from mcap.records import Attachment, Header, Metadata

        stream = ReadDataStream(BytesIO(data))
        if opcode == Opcode.HEADER:
            self.profile = Header.read(stream).profile or "none"
        elif opcode == Opcode.METADATA:
            self.count(len(data))
            record = Metadata.read(stream)
            self.metadata[record.name] = dict(record.metadata)
        elif opcode == Opcode.ATTACHMENT:
            self.count(len(data))
            attached = Attachment.read(stream)
            self.attachments[attached.name] = attached.data


def index(path: Path) -> McapFile:
    """Read a file once, checking the CRCs of its data section and of its summary.

    Raises:
        RecordingError: it cannot be read, is no MCAP file, is damaged, or larger than the limits allow. A file that was
            cut off is no error.
        ConfigError: the environment states no limit.
    """
    out = McapFile(path)
    try:
        with path.open("rb") as file:
            size = file.seek(0, 2)
            file.seek(0)
            if file.read(len(MAGIC)) != MAGIC:
                raise RecordingError(f"{path} is not an MCAP recording: it does not begin as one")
            with sound(path):
                out.truncated = not _scan(out, file, size)
            file.seek(-len(MAGIC), 2)
            closed = size > 2 * len(MAGIC) and file.read() == MAGIC
    except OSError as error:
        raise RecordingError(f"recording {path}: cannot be read: {error.strerror or error}") from error
    if not out.profile:
        raise RecordingError(f"{path} is not an MCAP recording: it ends before a header")
    if out.truncated and closed:
        raise RecordingError(f"recording {path}: its records do not lead to its end; {DAMAGED}")
    if out.truncated or not out.topics:
        out.learn_channels()
    return out


def _scan(out: McapFile, file: BinaryIO, size: int) -> bool:
    """Take every complete record; true when the file ends as it should.

    A length is held against the size of the file before anything is read: a cut is told from damage, and damage takes
    no memory.
    """
    crc, at = zlib.crc32(MAGIC), len(MAGIC)
    inflated = chunks = 0
    where = f"recording {out.path}"
    while True:
        head = file.read(9)
        length = int.from_bytes(head[1:], "little")
        at += 9 + length
        if len(head) < 9 or at > size:
            return False
        if length > MAX_CHUNK:
            raise RecordingError(f"{where}: a record of {length} bytes; expected at most {MAX_CHUNK}")
        data = file.read(length)
        if head[0] == Opcode.DATA_END:
            from mcap.records import DataEnd

            if DataEnd.read(ReadDataStream(BytesIO(data))).data_section_crc not in (0, crc):
                raise RecordingError(f"{where}: fails its CRC; {DAMAGED}")
            crc = 0  # that of the summary begins here
        elif head[0] == Opcode.FOOTER:
            from mcap.records import Footer

            crc = zlib.crc32(data[:16], zlib.crc32(head, crc))
            if Footer.read(ReadDataStream(BytesIO(data))).summary_crc not in (0, crc):
                raise RecordingError(f"{where}: its summary fails its CRC; {DAMAGED}")
            return file.read() == MAGIC
        else:
            crc = zlib.crc32(data, zlib.crc32(head, crc))
            if head[0] == Opcode.ATTACHMENT and int.from_bytes(data[-4:], "little") not in (0, zlib.crc32(data[:-4])):
                raise RecordingError(f"{where}: an attachment fails its CRC; {DAMAGED}")
            if head[0] == Opcode.CHUNK:
                chunks += 1
                inflated += int.from_bytes(data[16:24], "little")
                out.limits.check("chunks", chunks, where, "chunks")
                out.limits.check(
                    "inflation", (inflated - MAX_CHUNK) / size, where, "bytes in its chunks for each byte of the file"
                )
            out.take(head[0], data, at)
