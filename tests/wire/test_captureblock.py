"""Blocks and pieces of a capture: golden bytes by hand, and anything that may come in their place."""

from __future__ import annotations

import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.wire.captureblock import CRC_BYTES, OVERHEAD, PIECE, ROOM, Block, block, block_of, piece_of, pieces


def test_a_block_golden() -> None:
    content = bytes.fromhex("03 00 00 10 00 00 AA BB CC")  # capture 3, offset 4096
    crc = bytes.fromhex("AE 0B 5E 9D")  # as gzip writes it behind these nine bytes
    assert block(3, 4096, b"\xaa\xbb\xcc") == content + crc
    assert block_of(content + crc) == Block(3, 4096, b"\xaa\xbb\xcc")
    assert OVERHEAD == 10


def test_pieces_golden() -> None:
    data = bytes(range(60))
    first = bytes.fromhex("01 00 39 00 00 00 39") + data[:57]  # capture 1 from offset 57: 57 bytes
    rest = bytes.fromhex("01 00 72 00 00 00 03 39 3A 3B") + bytes(54)
    assert pieces(1, 57, data) == (first, rest)
    assert piece_of(rest) == Block(1, 114, bytes.fromhex("39 3A 3B"))


@pytest.mark.parametrize(("number", "offset"), [(-1, 0), (1 << 16, 0), (0, -1), (0, 1 << 32)])
def test_numbers_out_of_range(number: int, offset: int) -> None:
    with pytest.raises(ValueError, match="16 and 32 bits"):
        block(number, offset, b"x")
    with pytest.raises(ValueError, match="16 and 32 bits"):
        pieces(number, offset, b"x")


@given(st.integers(0, 0xFFFF), st.integers(0, 0xFFFF0000), st.binary(max_size=700))
def test_both_ways(number: int, offset: int, data: bytes) -> None:
    assert block_of(block(number, offset, data)) == Block(number, offset, data)
    parts = [piece_of(p) for p in pieces(number, offset, data)]
    assert all(p is not None and p.number == number for p in parts)
    assert b"".join(p.data for p in parts if p is not None) == data
    assert [p.offset for p in parts if p is not None] == [offset + k for k in range(0, len(data), ROOM)]


@given(st.binary(max_size=100))
def test_any_bytes(payload: bytes) -> None:
    found = block_of(payload)
    crc = int.from_bytes(payload[-CRC_BYTES:], "little")
    assert (found is not None) == (len(payload) >= OVERHEAD and zlib.crc32(payload[:-CRC_BYTES]) == crc)
    part = piece_of(payload)
    assert part is None or (len(payload) == PIECE and 0 < len(part.data) <= ROOM)


@given(st.binary(min_size=1, max_size=200), st.data())
def test_a_changed_bit_is_no_block(data: bytes, draw: st.DataObject) -> None:
    payload = bytearray(block(1, 0, data))
    bit = draw.draw(st.integers(0, 8 * len(payload) - 1))
    payload[bit // 8] ^= 1 << bit % 8
    assert block_of(bytes(payload)) is None


@pytest.mark.parametrize("count", [0, 58, 255])
def test_a_piece_that_says_more_than_it_can(count: int) -> None:
    assert piece_of(bytes([1, 0, 0, 0, 0, 0, count]).ljust(64, b"\0")) is None
