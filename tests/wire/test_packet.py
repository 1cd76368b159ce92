"""Serial packets: bytes worked out by hand, CRC widths at their boundary, and everything that is no packet."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable

import pytest
from cobs import cobs
from hypothesis import given
from hypothesis import strategies as st

from bench.wire import packet
from bench.wire.packet import Malformed, Packet, WrongCrc

HEARTBEAT = (0x010, bytes.fromhex("44332211 0500 0000"))  # session 0x11223344, counter 5
HEARTBEAT_PACKET = bytes.fromhex(
    "03 01 07"  # version 1, low byte of sequence 7; its high byte is the zero that ends the block
    "01 01 01 01"  # tick 0
    "02 10"  # identifier 0x010
    "07 08 44 33 22 11 05"  # eight bytes: session, counter
    "01 01 03 42 6F"  # spare, CRC-16 0x6F42
    "00"
)
messages = st.tuples(st.integers(0, 0x7FF), st.binary(max_size=64))


def crc16(data: bytes) -> int:
    """CRC-16/CCITT-FALSE bit by bit, from its definition."""
    register = 0xFFFF
    for byte in data:
        for bit in range(7, -1, -1):
            out = register >> 15 ^ byte >> bit & 1
            register = (register << 1 & 0xFFFF) ^ (0x1021 if out else 0)
    return register


def crc32(data: bytes) -> int:
    """CRC-32 bit by bit: reflected polynomial 0xEDB88320, both ends inverted."""
    register = 0xFFFFFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0xEDB88320 if register & 1 else 0)
    return register ^ 0xFFFFFFFF


def content(*parts: tuple[int, bytes], version: int = 1, sequence: int = 0, tick: int = 0) -> bytes:
    """Any content, right or wrong, laid out by hand; a length in `parts` is whatever the payload has."""
    head = bytes((version,)) + sequence.to_bytes(2, "little") + tick.to_bytes(4, "little")
    return head + b"".join(i.to_bytes(2, "little") + bytes((len(p),)) + p for i, p in parts)


def sealed(inner: bytes, wide: bool | None = None) -> bytes:
    """Content with its CRC under COBS, without a delimiter; `wide` forces the width of the CRC."""
    if len(inner) > 128 if wide is None else wide:
        return bytes(cobs.encode(inner + crc32(inner).to_bytes(4, "little")))
    return bytes(cobs.encode(inner + crc16(inner).to_bytes(2, "little")))


def test_check_values() -> None:
    """The check values of both CRCs in the catalogues, so that the bitwise ones here can serve as an oracle."""
    assert (crc16(b"123456789"), crc32(b"123456789")) == (0x29B1, 0xCBF43926)


def test_golden_heartbeat() -> None:
    assert packet.packet(7, 0, [HEARTBEAT]) == HEARTBEAT_PACKET
    assert packet.unpack(HEARTBEAT_PACKET[:-1]) == Packet(7, 0, [HEARTBEAT])


def test_golden_two_messages() -> None:
    """Without a zero byte in the content COBS only puts one byte in front."""
    expected = bytes.fromhex("13 01 3412 78563412 1101 02 AABB 2202 01 CC E270 00")
    made = packet.packet(0x1234, 0x12345678, [(0x111, b"\xaa\xbb"), (0x222, b"\xcc")])
    assert made == expected
    assert packet.unpack(expected[:-1]) == Packet(0x1234, 0x12345678, [(0x111, b"\xaa\xbb"), (0x222, b"\xcc")])


@pytest.mark.parametrize("last", [51, 52])
def test_crc_widens_above_128_bytes(last: int) -> None:
    """Content of 128 bytes has 16 bits of CRC, content of 129 has 32."""
    parts = [(1, bytes(64)), (2, bytes(last))]
    inner = content((1, bytes(64)), (2, bytes(last)), sequence=3, tick=4)
    assert len(inner) == 77 + last
    assert packet.packet(3, 4, parts) == sealed(inner) + b"\0"
    assert len(cobs.decode(sealed(inner))) == {51: 130, 52: 133}[last]
    with pytest.raises((Malformed, WrongCrc)):
        packet.unpack(sealed(inner, wide=last == 51))


def test_longest() -> None:
    """1024 bytes of content fit, none of them zero, and 1025 do not."""
    parts = [(0x111, b"\xff" * 64)] * 15 + [(0x111, b"\xff" * 9)]
    made = packet.packet(0x1111, 0x11111111, parts)
    assert len(content(*parts)) == 1024
    assert len(made) == packet.ENCODED_LIMIT + 1
    assert packet.unpack(made[:-1]).messages == parts
    with pytest.raises(ValueError, match="at most 1024"):
        packet.packet(0, 0, [*parts[:-1], (0x111, bytes(10))])


@given(st.integers(0, 0xFFFF), st.integers(0, 0xFFFFFFFF), st.lists(messages, min_size=1, max_size=15))
def test_round_trip(sequence: int, tick: int, parts: list[tuple[int, bytes]]) -> None:
    made = packet.packet(sequence, tick, parts)
    assert made == sealed(content(*parts, sequence=sequence, tick=tick)) + b"\0"
    assert packet.unpack(made[:-1]) == Packet(sequence, tick, parts)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: packet.packet(0x10000, 0, [HEARTBEAT]), "sequence 65536"),
        (lambda: packet.packet(-1, 0, [HEARTBEAT]), "sequence -1"),
        (lambda: packet.packet(0, 1 << 32, [HEARTBEAT]), "tick 4294967296"),
        (lambda: packet.packet(0, 0, []), "at least one"),
        (lambda: packet.packet(0, 0, [(0x800, b"")]), "0x800"),
        (lambda: packet.packet(0, 0, [(1, bytes(65))]), "65 bytes"),
    ],
)
def test_what_cannot_be_packed(make: Callable[[], bytes], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        make()


BAD = {
    "nothing": b"",
    "a zero inside": b"\x03\x00\x01",
    "code past the end": HEARTBEAT_PACKET[:-2],
    "no message": sealed(content()),
    "other version": sealed(content(HEARTBEAT, version=2)),
    "payload cut off": sealed(content() + b"\x10\x00\x08\x01\x02"),
    "second message cut off": sealed(content((1, bytes(10))) + b"\x02\x00\x04abc"),
    "header of a message cut off": sealed(content((1, b"abc")) + b"\x02\x00"),
    "length 65": sealed(content((1, bytes(65)))),
    "length 65 second": sealed(content((1, bytes(8)), (1, bytes(65)))),
    "identifier of 12 bits": sealed(content((0x800, bytes(8)))),
    "identifier of 12 bits among others": sealed(content((1, bytes(8)), (0x800, bytes(4)))),
    "131 bytes": sealed(content((1, bytes(64)), (2, bytes(52))), wide=False),
    "132 bytes": sealed(content((1, bytes(64)), (2, bytes(51))), wide=True),
    "content of 1025 bytes": sealed(content(*[(1, bytes(64))] * 15, (1, bytes(10)))),
    "far too long": b"\x01" * 2000,
}


@pytest.mark.parametrize("name", BAD)
def test_malformed(name: str) -> None:
    with pytest.raises(Malformed):
        packet.unpack(BAD[name])


def test_crc_comes_before_version() -> None:
    """A version byte hit by noise is a CRC error, not an unknown version."""
    whole = bytearray(cobs.decode(HEARTBEAT_PACKET[:-1]))
    whole[0] = 9
    with pytest.raises(WrongCrc):
        packet.unpack(bytes(cobs.encode(bytes(whole))))


@given(st.integers(0, 8 * 20 - 1))
def test_any_single_bit_is_noticed(bit: int) -> None:
    """A CRC finds every single error in what it covers, itself included."""
    whole = bytearray(cobs.decode(HEARTBEAT_PACKET[:-1]))
    whole[bit // 8] ^= 1 << bit % 8
    with pytest.raises(WrongCrc):
        packet.check(bytes(whole))


def test_needs_no_numpy() -> None:
    """The heartbeat process must start fast."""
    code = "import sys, bench.wire.packet; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
