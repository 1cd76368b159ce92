"""How a recording is laid out: topics, protobuf schemas made from the channel list, and columns to bytes and back.

Blocks are columnar: one packed field per channel, encoded by hand as tag, length and the column's bytes, because the
protobuf runtime is ten times slower at that. The schema is an ordinary FileDescriptorSet, so every reader understands.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from google.protobuf import descriptor_pb2

from bench.errors import RecordingError
from bench.samples import StreamLayout

VERSION: Final = 1
EVENTS: Final = "/events"
_TYPES: Final = {"f4": ("TYPE_FLOAT", "<f4"), "u2": ("TYPE_FIXED32", "<u4")}
HEAD: Final = (
    ("first_sample_index", "TYPE_FIXED64"),
    ("count", "TYPE_FIXED32"),
    ("lost_before", "TYPE_FIXED32"),
    ("host_time_ns", "TYPE_FIXED64"),
    ("sample_period_ns", "TYPE_FIXED64"),
)
_HEAD_BYTES: Final = struct.Struct("<BQBIBIBQBQ")
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


def _file(name: str, fields: list[tuple[str, int, int, bool]]) -> bytes:
    """A FileDescriptorSet with one message of (name, number, type, repeated) fields."""
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
    return int(getattr(descriptor_pb2.FieldDescriptorProto, name))


def raw_schema() -> bytes:
    """`Frames`: host time and the packed frame records (see bench.frames.FRAME)."""
    return _file("Frames", [("host_time_ns", 1, _kind("TYPE_FIXED64"), False), ("count", 2, _kind("TYPE_FIXED32"), False),
                            ("frames", 3, _kind("TYPE_BYTES"), False)])  # fmt: skip


def block_schema(layout: StreamLayout) -> bytes:
    """`Block_<stream>`: the head, ticks, times, and one packed column per channel from field 16 on."""
    fields = [(name, k + 1, _kind(kind), False) for k, (name, kind) in enumerate(HEAD)]
    fields += [("device_ticks", TICKS, _kind("TYPE_FIXED64"), True), ("t_ns", TIMES, _kind("TYPE_FIXED64"), True)]
    fields += [(c.name, FIRST_COLUMN + k, _kind(_TYPES[c.dtype][0]), True) for k, c in enumerate(layout.channels)]
    return _file(f"Block_{layout.name}", fields)


def view_schema(layout: StreamLayout) -> bytes:
    """`View_<stream>`: scalars, mean, minimum and maximum of each measured channel and the last value of each code."""
    return _file(
        f"View_{layout.name}", [(n, k + 1, _kind("TYPE_FLOAT"), False) for k, n in enumerate(view_names(layout))]
    )


def view_names(layout: StreamLayout) -> list[str]:
    """The fields of a view message."""
    names = []
    for c in layout.channels:
        names += [c.name, f"{c.name}_min", f"{c.name}_max"] if c.dtype == "f4" else [c.name]
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


class DecodedBlock:
    """A block read back: head numbers, ticks, times and columns by channel, read-only views of the message."""

    __slots__ = ("columns", "count", "first", "host_ns", "lost", "t_ns", "ticks")

    def __init__(self, layout: StreamLayout, data: bytes) -> None:
        fields = dict(_fields(data))
        try:
            self.first, self.count, self.lost = int(fields[1]), int(fields[2]), int(fields.get(3, 0))
            self.host_ns = int(fields.get(4, 0))
            self.ticks = np.frombuffer(fields[TICKS], "<u8")
            self.t_ns = np.frombuffer(fields[TIMES], "<u8").astype(np.int64)
            self.columns = {
                c.name: np.frombuffer(fields[FIRST_COLUMN + k], _TYPES[c.dtype][1])
                for k, c in enumerate(layout.channels)
            }
        except (KeyError, ValueError) as error:
            raise RecordingError(f"a block of stream {layout.name} cannot be read: {error}") from error
        if any(len(x) != self.count for x in (self.ticks, self.t_ns, *self.columns.values())):
            raise RecordingError(f"a block of stream {layout.name} has columns of different lengths")


def _fields(data: bytes) -> list[tuple[int, Any]]:
    """Top-level protobuf fields: number, and an integer or the bytes."""
    out, at = [], 0
    while at < len(data):
        tag, at = _read_varint(data, at)
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
    return int(fields.get(1, 0)), bytes(fields.get(3, b""))
