"""SLCAN lines: golden bytes by hand from the Lawicel manual's layout and the CANable dialect."""

from __future__ import annotations

import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.errors import ConfigError
from bench.link.frames import EXTENDED as FRAMES_EXTENDED
from bench.wire.slcan import EXTENDED, LENGTHS, Parsed, line, parse, setup

HEARTBEAT = bytes.fromhex("78563412 0100 0000")
GOLDEN = [
    (0x010, HEARTBEAT, False, False, b"t01087856341201000000\r"),
    (0x7FF, b"", False, False, b"t7FF0\r"),
    (EXTENDED | 0x1ABCDEF0, b"\x0a\xb0", False, False, b"T1ABCDEF020AB0\r"),
    (EXTENDED | 0x5, b"\xff", False, False, b"T000000051FF\r"),
    (0x010, HEARTBEAT, True, False, b"d01087856341201000000\r"),
    (0x100, bytes(range(12)), True, False, b"d1009000102030405060708090A0B\r"),
    (0x100, bytes(64), True, True, b"b100F" + b"00" * 64 + b"\r"),
    (EXTENDED | 0x100, bytes(16), True, False, b"D00000100A" + b"00" * 16 + b"\r"),
    (EXTENDED | 0x1FFFFFFF, b"\x01", True, True, b"B1FFFFFFF101\r"),
]


@pytest.mark.parametrize(("identifier", "payload", "fd", "brs", "expected"), GOLDEN)
def test_golden_lines_both_ways(identifier: int, payload: bytes, fd: bool, brs: bool, expected: bytes) -> None:
    assert line(identifier, payload, fd=fd, brs=brs) == expected
    assert parse(expected[:-1]) == Parsed(identifier, payload, fd, -1, fd and brs)
    assert parse(expected[:1] + expected[1:-1].lower()) == Parsed(identifier, payload, fd, -1, fd and brs)


@pytest.mark.parametrize(
    ("code", "length"),
    [
        ("0", 0),
        ("1", 1),
        ("7", 7),
        ("8", 8),
        ("9", 12),
        ("A", 16),
        ("B", 20),
        ("C", 24),
        ("D", 32),
        ("E", 48),
        ("F", 64),
    ],
)
def test_every_dlc(code: str, length: int) -> None:
    assert line(0x123, bytes(length), fd=True) == f"d123{code}{'00' * length}\r".encode()
    classic = parse(f"t123{code}{'00' * length}".encode())
    assert (classic is not None) == (length <= 8)


def test_classic_frames_have_no_bit_rate_switch() -> None:
    assert line(0x010, b"", fd=False, brs=True) == b"t0100\r"


@pytest.mark.parametrize(("identifier", "size", "fd"), [(0, 9, False), (0, 12, False), (0, 9, True), (0, 65, True)])
def test_lengths_that_no_frame_has(identifier: int, size: int, fd: bool) -> None:
    with pytest.raises(ValueError, match=f"payload of {size} bytes"):
        line(identifier, bytes(size), fd=fd)


@pytest.mark.parametrize("identifier", [0x800, -1, EXTENDED | 0x20000000, EXTENDED << 1])
def test_identifiers_that_no_frame_has(identifier: int) -> None:
    with pytest.raises(ValueError, match="more than"):
        line(identifier, b"", fd=False)


def test_setup_closes_sets_the_rates_and_opens() -> None:
    assert setup(1_000_000, 5_000_000) == b"C\rS8\rY5\rO\r"
    assert setup(500_000, 2_000_000) == b"C\rS6\rY2\rO\r"
    assert setup(125_000) == b"C\rS4\rO\r"
    assert setup(10_000, timestamp=True) == b"C\rS0\rZ1\rO\r"


def test_rates_without_a_code_are_refused_with_those_that_have_one() -> None:
    with pytest.raises(ConfigError, match="bit rate of 123456 bit/s; expected one of 10000, 20000"):
        setup(123_456)
    with pytest.raises(ConfigError, match="data bit rate of 4000000 bit/s; expected one of 2000000, 5000000"):
        setup(1_000_000, 4_000_000)


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"t",
        b"t010",
        b"t0101",  # a byte short
        b"t01010",  # half a byte
        b"t01010000",  # a byte too many
        b"t0109" + b"00" * 8,  # classic with a DLC over 8
        b"t8000",  # 12 bits
        b"T200000000",  # 30 bits
        b"t0101G0",
        b"t01 100",
        b"t0_1100",
        b"t+10100",
        b"x0100",
        b"r0100",  # a remote frame carries no data
        b"t\xff\xff\xff0",
        b"b100F" + b"00" * 65,
    ],
)
def test_what_is_no_data_frame(text: bytes) -> None:
    assert parse(text) is None


def test_timestamps_only_where_they_are_expected() -> None:
    assert parse(b"t010155EA5F", timestamp=True) == Parsed(0x010, b"\x55", False, 59_999)
    assert parse(b"t010155EA60", timestamp=True) is None  # 60 000 ms
    assert parse(b"t010155", timestamp=True) is None
    assert parse(b"t010155EA5F") is None


@given(
    identifier=st.integers(0, 0x7FF) | st.integers(0, 0x1FFFFFFF).map(lambda n: n | EXTENDED),
    payload=st.sampled_from(LENGTHS).flatmap(lambda n: st.binary(min_size=n, max_size=n)),
    brs=st.booleans(),
)
def test_what_is_written_is_read_back(identifier: int, payload: bytes, brs: bool) -> None:
    for fd in {True, len(payload) > 8}:
        assert parse(line(identifier, payload, fd=fd, brs=brs)[:-1]) == Parsed(identifier, payload, fd, -1, fd and brs)


@given(st.binary(max_size=20), st.booleans())
def test_any_bytes_are_a_frame_or_none(text: bytes, timestamp: bool) -> None:
    found = parse(text, timestamp=timestamp)
    if found is not None:
        again = line(found.identifier, found.payload, fd=found.fd, brs=text[:1] in b"bB")[:-1]
        assert again[1:] == text[1 : len(again)].upper()


def test_the_bit_of_extended_identifiers_is_that_of_the_frames() -> None:
    assert EXTENDED == FRAMES_EXTENDED


def test_the_module_does_not_bring_numpy_along() -> None:
    code = "import sys, bench.wire.slcan; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
