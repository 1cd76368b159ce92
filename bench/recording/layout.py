"""How a recording is laid out: topics, protobuf schemas made from the channel list, and columns to bytes and back.

Blocks are columnar: one packed field per channel, encoded by hand as tag, length and the column's bytes, because the
protobuf runtime is ten times slower at that. The schema is an ordinary FileDescriptorSet, so every reader understands.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from bench.errors import RecordingError
from bench.samples import StreamLayout

VERSION: Final = 2
"""2: frames carry the interface's own timestamp."""
EVENTS: Final = "/events"
_TYPES: Final = {"f4": ("TYPE_FLOAT", "<f4"), "f8": ("TYPE_DOUBLE", "<f8"), "u2": ("TYPE_FIXED32", "<u4")}
KINDS: Final = tuple(_TYPES)
"""Of channels: values, values that need all digits, codes."""
HEAD: Final = (
    ("first_sample_index", "TYPE_FIXED64"),
    ("count", "TYPE_FIXED32"),
    ("lost_before", "TYPE_FIXED32"),
    ("host_time_ns", "TYPE_FIXED64"),
    ("sample_period_ns", "TYPE_FIXED64"),
)
_HEAD_BYTES: Final = struct.Struct("<BQBIBIBQBQ")
LAST_INDEX: Final = 1 << 53
MOST_FIELDS: Final = 4096
TICKS, TIMES, FIRST_COLUMN = 6, 7, 16
"""Field numbers of the device ticks, the sample times and the first channel."""

EVENT_SCHEMA: Final = (
    b'{"type":"object","properties":{"kind":{"type":"string"},"t_ns":{"type":"integer"}},"required":["kind","t_ns"]}'
)


def raw_topic(link: str) -> str:
    return f"/raw/{link}"


def block_topic(stream: str) -> str:
    return f"/{stream}/block"


def view_topic(stream: str) -> str:
    return f"/{stream}/view"


def sample_topic(stream: str) -> str:
    """Only in exports: one scalar message per sample."""
    return f"/{stream}/sample"


def type_name(kind: str, stream: str) -> str:
    """The protobuf name of a stream's messages: `Block_telemetry`, `Block_capture_1`."""
    return f"{kind}_{stream.replace('/', '_')}"


def _file(name: str, fields: list[tuple[str, int, int, bool]]) -> bytes:
    """A FileDescriptorSet with one message of (name, number, type, repeated) fields."""
    from google.protobuf import descriptor_pb2  # slow to import, and only what is recorded needs it

    file = descriptor_pb2.FileDescriptorProto(name=f"{name}.proto", package="levbench", syntax="proto3")
    message = file.message_type.add(name=name)
    for field, number, kind, repeated in fields:
        label = (
            descriptor_pb2.FieldDescriptorProto.LABEL_REPEATED
            if repeated
            else descriptor_pb2.FieldDescriptorProto.LABEL_OPTIONAL
        )
        message.field.add(name=field, number=number, type=kind, label=label)
    return descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()


def _kind(name: str) -> int:
    from google.protobuf import descriptor_pb2

    return int(getattr(descriptor_pb2.FieldDescriptorProto, name))


def raw_schema() -> bytes:
    """`Frames`: host time and the packed frame records (see bench.link.frames.FRAME)."""
    return _file("Frames", [("host_time_ns", 1, _kind("TYPE_FIXED64"), False), ("count", 2, _kind("TYPE_FIXED32"), False),
                            ("frames", 3, _kind("TYPE_BYTES"), False)])  # fmt: skip


def block_schema(layout: StreamLayout) -> bytes:
    """`Block_<stream>`: the head, ticks, times, and one packed column per channel from field 16 on."""
    fields = [(name, k + 1, _kind(kind), False) for k, (name, kind) in enumerate(HEAD)]
    fields += [("device_ticks", TICKS, _kind("TYPE_FIXED64"), True), ("t_ns", TIMES, _kind("TYPE_FIXED64"), True)]
    fields += [(c.name, FIRST_COLUMN + k, _kind(_TYPES[c.dtype][0]), True) for k, c in enumerate(layout.channels)]
    return _file(type_name("Block", layout.name), fields)


def view_schema(layout: StreamLayout) -> bytes:
    """`View_<stream>`: scalars, mean, minimum and maximum of each measured channel and the last value of each code."""
    return _scalars(type_name("View", layout.name), view_names(layout))


def sample_schema(layout: StreamLayout) -> bytes:
    """`Sample_<stream>`: scalars, one for each channel."""
    return _scalars(type_name("Sample", layout.name), [c.name for c in layout.channels])


def _scalars(name: str, fields: Sequence[str]) -> bytes:
    return _file(name, [(field, k + 1, _kind("TYPE_FLOAT"), False) for k, field in enumerate(fields)])


def view_names(layout: StreamLayout) -> list[str]:
    """The fields of a view message."""
    names = []
    for c in layout.channels:
        names += [c.name] if c.dtype == "u2" else [c.name, f"{c.name}_min", f"{c.name}_max"]
    return names


def varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def _packed(number: int, data: bytes) -> bytes:
    return varint(number << 3 | 2) + varint(len(data)) + data


def encode_frames(host_ns: int, count: int, records: bytes) -> bytes:
    return struct.pack("<BQBI", 1 << 3 | 1, host_ns, 2 << 3 | 5, count) + _packed(3, records)


def encode_block(
    layout: StreamLayout,
    first: int,
    lost: int,
    host_ns: int,
    ticks: npt.NDArray[np.uint64],
    t_ns: npt.NDArray[np.int64],
    columns: Mapping[str, npt.NDArray[Any]],
) -> bytes:
    """One block message; every column has len(ticks) samples."""
    parts = [_HEAD_BYTES.pack(1 << 3 | 1, first, 2 << 3 | 5, len(ticks), 3 << 3 | 5, lost, 4 << 3 | 1, host_ns,
                              5 << 3 | 1, layout.period_ns),
             _packed(TICKS, ticks.astype("<u8").tobytes()), _packed(TIMES, t_ns.astype("<u8").tobytes())]  # fmt: skip
    for k, c in enumerate(layout.channels):
        parts.append(_packed(FIRST_COLUMN + k, columns[c.name].astype(_TYPES[c.dtype][1]).tobytes()))
    return b"".join(parts)


def block_counts(data: bytes) -> tuple[int, int]:
    """Samples of a block message of ours, and how many are lost before them."""
    _, _, _, count, _, lost, *_ = _HEAD_BYTES.unpack_from(data)
    return count, lost


class ViewWindows:
    """Reduces samples to one scalar message per window of `width_ns`: mean, minimum and maximum, or the last code.

    A window may come in parts: what falls into the newest one is kept until its end is known.
    """

    def __init__(self, layout: StreamLayout, width_ns: int) -> None:
        self._layout, self._width_ns = layout, width_ns
        self._t_ns: npt.NDArray[np.int64] = np.empty(0, np.int64)
        self._columns: dict[str, npt.NDArray[Any]] = {}

    def take(self, t_ns: npt.NDArray[np.int64], columns: Mapping[str, npt.NDArray[Any]]) -> list[tuple[int, bytes]]:
        """Time and message of each window that these samples end."""
        if len(self._t_ns):
            t_ns = np.concatenate([self._t_ns, t_ns])
            columns = {n: np.concatenate([x, columns[n]]) for n, x in self._columns.items()}
        windows = t_ns // self._width_ns
        done = len(t_ns) - int(np.argmax(windows[::-1] != windows[-1])) if windows[0] != windows[-1] else 0
        self._t_ns, self._columns = t_ns[done:], {n: x[done:] for n, x in columns.items()}
        return self._messages(t_ns[:done], {n: x[:done] for n, x in columns.items()}) if done else []

    def rest(self) -> list[tuple[int, bytes]]:
        """The window that the last samples began."""
        t_ns, self._t_ns = self._t_ns, self._t_ns[:0]
        return self._messages(t_ns, self._columns) if len(t_ns) else []

    def _messages(
        self, t_ns: npt.NDArray[np.int64], columns: Mapping[str, npt.NDArray[Any]]
    ) -> list[tuple[int, bytes]]:
        edges = np.flatnonzero(np.diff(t_ns // self._width_ns, prepend=-1))
        counts = np.diff(np.append(edges, len(t_ns)))
        values: list[npt.NDArray[Any]] = []
        for c in self._layout.channels:
            x = columns[c.name]
            if c.dtype != "u2":
                mean = np.add.reduceat(x, edges) / counts
                values += [mean, np.minimum.reduceat(x, edges), np.maximum.reduceat(x, edges)]
            else:
                values.append(x[edges + counts - 1])
        return list(zip(t_ns[edges].tolist(), encode_scalars(values), strict=True))


def encode_scalars(values: Sequence[npt.NDArray[Any]]) -> list[bytes]:
    """Messages of float fields numbered from 1: one message a row, one field for each of `values`, as float32."""
    row, places = _scalar_row(len(values))
    rows = np.tile(row, (len(values[0]), 1))
    rows[:, places] = np.ascontiguousarray(np.array(values, "<f4").T).view(np.uint8)
    data, size = rows.tobytes(), len(row)
    return [data[at : at + size] for at in range(0, len(data), size)]


@cache
def _scalar_row(count: int) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.intp]]:
    """The bytes of such a message with zeros for values, and the places of the bytes of these."""
    tags = [varint(k << 3 | 5) for k in range(1, count + 1)]
    ends = np.cumsum([len(tag) + 4 for tag in tags])
    row = np.frombuffer(b"".join(tag + bytes(4) for tag in tags), np.uint8)
    return row, (ends[:, None] + np.arange(-4, 0)).ravel()


class DecodedBlock:
    """A block read back: head numbers, ticks, times and columns by channel, read-only views of the message."""

    __slots__ = ("columns", "count", "first", "host_ns", "lost", "t_ns", "ticks")

    def __init__(self, layout: StreamLayout, data: bytes) -> None:
        try:
            fields = dict(_fields(data))
            self.first, self.count, self.lost = int(fields[1]), int(fields[2]), int(fields.get(3, 0))
            self.host_ns = int(fields.get(4, 0))
            self.ticks = np.frombuffer(fields[TICKS], "<u8")
            self.t_ns = np.frombuffer(fields[TIMES], "<u8").astype(np.int64)
            self.columns = {
                c.name: np.frombuffer(fields[FIRST_COLUMN + k], _TYPES[c.dtype][1])
                for k, c in enumerate(layout.channels)
            }
        except (KeyError, ValueError, TypeError, struct.error, RecordingError) as error:
            raise RecordingError(f"a block of stream {layout.name} cannot be read: {error}") from error
        if any(len(x) != self.count for x in (self.ticks, self.t_ns, *self.columns.values())):
            raise RecordingError(f"a block of stream {layout.name} has columns of different lengths")
        if self.first + self.count > LAST_INDEX or self.lost > LAST_INDEX:
            raise RecordingError(
                f"a block of stream {layout.name} has index {self.first}; expected one that time allows"
            )


def _fields(data: bytes) -> list[tuple[int, Any]]:
    """Top-level protobuf fields: number, and an integer or the bytes."""
    out: list[tuple[int, Any]] = []
    at = 0
    while at < len(data):
        if len(out) > MOST_FIELDS:
            raise RecordingError(f"a message of more than {MOST_FIELDS} fields; expected fewer")
        tag, at = data[at], at + 1
        if tag > 0x7F:  # most numbers of fields take one byte
            tag, at = _read_varint(data, at - 1)
        wire = tag & 7
        if wire == 1:
            value: Any = struct.unpack_from("<Q", data, at)[0]
            at += 8
        elif wire == 5:
            value = struct.unpack_from("<I", data, at)[0]
            at += 4
        elif wire == 2:
            length, at = _read_varint(data, at)
            if at + length > len(data):
                raise RecordingError("a message ends in the middle of a field")
            value = memoryview(data)[at : at + length]
            at += length
        else:
            raise RecordingError(f"a message holds wire type {wire}, which this layout does not use")
        out.append((tag >> 3, value))
    return out


def _read_varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while at < len(data) and shift < 64:
        byte = data[at]
        value |= (byte & 0x7F) << shift
        at += 1
        if byte < 0x80:
            return value, at
        shift += 7
    raise RecordingError("a message ends in the middle of a number")


def decode_frames(data: bytes) -> tuple[int, bytes]:
    """Host time and frame records of a `Frames` message."""
    fields = dict(_fields(data))
    records = fields.get(3, b"")
    if isinstance(records, int):
        raise RecordingError("a batch of frames holds a number where its records should be")
    return int(fields.get(1, 0)), bytes(records)
