"""The messages of `benchmarks.serial_link`, and the plain way to read them: eight channels of 16 bits."""

from __future__ import annotations

import binascii
import struct
import zlib

import numpy as np
from cobs import cobs

from bench.link.frames import FRAME, FrameBatch
from bench.link.packetstream import encode

Row = tuple[int, int, list[float]]
"""Sequence number, tick, values."""
CHANNELS = 8
SCALE = 0.0005
LENGTH = 24  # 22 bytes of signals in a legal CAN FD length
LAYOUT = struct.Struct(f"<HI{CHANNELS}h")
SIGNALS = [("seq", 0, 16, "+", 1.0), ("tick", 16, 32, "+", 1.0)]
SIGNALS += [(f"i_{k}", 48 + 16 * k, 16, "-", SCALE) for k in range(CHANNELS)]
FORMATS = ["StandardCAN", *(f"reserved{k}" for k in range(1, 14)), "StandardCAN_FD"]
DBC = "\n".join(
    ['VERSION ""', "BU_: Controller", f"BO_ 256 Samples: {LENGTH} Controller"]
    + [f' SG_ {n} : {start}|{bits}@1{sign} ({scale},0) [0|0] "A" Controller' for n, start, bits, sign, scale in SIGNALS]
    + ['BA_DEF_ BO_ "VFrameFormat" ENUM ' + ",".join(f'"{x}"' for x in FORMATS) + ";",
       'BA_DEF_DEF_ "VFrameFormat" "StandardCAN_FD";', 'BA_ "VFrameFormat" BO_ 256 14;', ""]
)  # fmt: skip


def frames(first: int, count: int) -> FrameBatch:
    """So many messages, numbered from `first`, with values that use all 16 bits."""
    index = np.arange(first, first + count)
    batch = np.zeros(count, FRAME)
    batch["id"], batch["length"] = 256, LENGTH
    batch["data"][:, 0:2] = index.astype("<u2")[:, None].view(np.uint8)
    batch["data"][:, 2:6] = index.astype("<u4")[:, None].view(np.uint8)
    values = (index[:, None] * np.arange(11, 11 + CHANNELS) * 37).astype("<i2")
    batch["data"][:, 6:22] = values.view(np.uint8)
    return batch


def packets(first: int, count: int, sequence: int, per_packet: int) -> tuple[bytes, int]:
    """The same messages in packets of `per_packet`."""
    out, batch = list[bytes](), frames(first, count)
    for a in range(0, count, per_packet):
        data, sequence = encode(batch[a : a + per_packet], sequence, (first + a) & 0xFFFFFFFF)
        out.append(data)
    return b"".join(out), sequence


def plain(data: bytes) -> int:
    """A message at a time, as one would write it without arrays."""
    rows: list[Row] = []
    for encoded in data.split(b"\0")[:-1]:
        rows += plain_packet(encoded)
    return len(rows)


def plain_packet(encoded: bytes) -> list[Row]:
    rows = []
    whole = cobs.decode(encoded)
    if len(whole) <= 130:
        content, good = whole[:-2], binascii.crc_hqx(whole[:-2], 0xFFFF) == int.from_bytes(whole[-2:], "little")
    else:
        content, good = whole[:-4], zlib.crc32(whole[:-4]) == int.from_bytes(whole[-4:], "little")
    at = 7
    while good and at < len(content):
        sequence, tick, *raw = LAYOUT.unpack_from(content, at + 3)
        rows.append((sequence, tick, [x * SCALE for x in raw]))
        at += 3 + content[at + 2]
    return rows
