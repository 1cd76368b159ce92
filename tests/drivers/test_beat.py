"""Heartbeat messages, their schedule and their bytes: all of it without a port, with times that the test gives."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.errors import ConfigError
from bench.link.codec import places_of
from bench.rigfile.messages import load_messages
from bench.wire import packet
from drivers.beat import FD, RAW, Beat, Encoder, Schedule, WriterSpec

MS = 1_000_000
BEAT = Beat(0x010, bytes.fromhex("AABBCCDD00000000"), range(32, 48), fd=True, period_s=0.02, lease_s=0.1)


def test_the_counter_is_little_endian_and_wraps() -> None:
    assert BEAT.frame(1) == (0x010, bytes.fromhex("AABBCCDD01000000"), FD)
    assert BEAT.frame(0x1234)[1] == bytes.fromhex("AABBCCDD34120000")
    assert BEAT.frame(0x10000) == BEAT.frame(0)
    assert Beat(0x010, bytes(8), range(16), fd=False).frame(7) == (0x010, bytes.fromhex("0700000000000000"), 0)


@pytest.mark.parametrize("counter", [range(-1, 15), range(56, 72), range(64, 65), ()])
def test_a_counter_outside_the_payload_is_refused(counter: Sequence[int]) -> None:
    with pytest.raises(ConfigError, match="8 bytes"):
        Beat(0x010, bytes(8), counter, fd=True)


@pytest.mark.parametrize(
    ("signal", "number", "payload"),  # of a message whose other bits are all set, by hand
    [
        ("0|16@1+", 0x1234, "3412FFFF"),
        ("7|16@0+", 0x1234, "1234FFFF"),
        ("8|8@1+", 0x1AB, "FFABFFFF"),
        ("4|4@1+", 0x15, "5FFFFFFF"),
        ("7|4@0+", 0x15, "5FFFFFFF"),
        ("12|1@1+", 2, "FFEFFFFF"),
        ("11|12@0+", 0xABC, "FFFABCFF"),
        ("4|12@1+", 0xABC, "CFABFFFF"),
        ("31|8@0+", 7, "FFFFFF07"),
        ("7|32@0+", 0x01020304, "01020304"),
    ],
)
def test_a_counter_has_any_width_and_byte_order(signal: str, number: int, payload: str) -> None:
    """Motorola's start is the most significant bit, Intel's the least."""
    dbc = f'VERSION ""\n\nBU_: A B\n\nBO_ 16 Alive: 4 A\n SG_ Count : {signal} (1,0) [0|0] "" B\n'
    counter = places_of(load_messages(dbc)["Alive"].signal("Count"))
    assert Beat(16, bytes.fromhex("FFFFFFFF"), counter, fd=False).frame(number)[1].hex().upper() == payload


@pytest.mark.parametrize("period_s", [0.0, -1.0, 1.5, float("nan")])
def test_a_period_over_the_lease_or_near_zero_is_refused(period_s: float) -> None:
    with pytest.raises(ConfigError, match="period"):
        Beat(0x010, bytes(8), range(32, 48), fd=True, period_s=period_s)


def test_nothing_is_due_before_the_first_renewal() -> None:
    assert Schedule(BEAT).wait_ns(5 * MS, 0) is None


def test_the_first_heartbeat_is_due_at_once_and_the_next_a_period_later() -> None:
    schedule = Schedule(BEAT)
    assert schedule.wait_ns(1000 * MS, 1000 * MS) == 0
    schedule.sent(1000 * MS)
    assert schedule.wait_ns(1005 * MS, 1000 * MS) == 15 * MS
    assert schedule.wait_ns(1020 * MS, 1000 * MS) == 0


def test_the_lease_ends_after_its_time() -> None:
    schedule = Schedule(BEAT)
    assert schedule.wait_ns(1100 * MS - 1, 1000 * MS) == 0
    assert schedule.wait_ns(1100 * MS, 1000 * MS) is None


def test_a_renewal_from_far_in_the_future_is_none() -> None:
    assert Schedule(BEAT).wait_ns(1000 * MS, 1100 * MS) is None


def test_nothing_is_made_up_for_after_a_pause() -> None:
    schedule = Schedule(BEAT)
    schedule.sent(1000 * MS)
    assert schedule.wait_ns(5000 * MS, 5000 * MS) == 0  # 200 periods late
    schedule.sent(5000 * MS)
    assert schedule.wait_ns(5000 * MS, 5000 * MS) == 20 * MS
    assert schedule.count == 2
    assert schedule.longest_gap_ns == 4000 * MS


@given(st.lists(st.integers(0, 60), max_size=200), st.integers(1, 50))
def test_heartbeats_are_never_closer_than_a_period(steps_ms: list[int], renew_every: int) -> None:
    schedule, now, renewed, sent = Schedule(BEAT), 1000 * MS, 0, []
    for index, step in enumerate(steps_ms):
        now += step * MS
        if index % renew_every == 0:
            renewed = now
        if schedule.wait_ns(now, renewed) == 0:
            schedule.sent(now)
            sent.append(now)
            assert now - renewed < 100 * MS
    assert all(later - earlier >= 20 * MS for earlier, later in pairwise(sent))
    assert schedule.count == len(sent)


@pytest.mark.parametrize(
    ("brs", "fd", "expected"),
    [(False, True, b"d0108AABBCCDD01000000\r"), (True, True, b"b0108AABBCCDD01000000\r")]
    + [(brs, False, b"t0108AABBCCDD01000000\r") for brs in (False, True)],
)
def test_lines(brs: bool, fd: bool, expected: bytes) -> None:
    identifier, payload, _ = BEAT.frame(1)
    assert Encoder(WriterSpec("slcan", 3, brs)).encode((identifier, payload, FD if fd else 0)) == expected


def test_raw_lines_pass_as_they_are() -> None:
    assert Encoder(WriterSpec("slcan", 3)).encode((0, b"F\r", RAW)) == b"F\r"


def test_packets_count_only_what_was_written() -> None:
    encoder = Encoder(WriterSpec("packet", 3))
    # version 1, sequence 0, tick 0, identifier 0x010, length 8, payload; CRC-16/CCITT-FALSE; COBS
    content = bytes.fromhex("01 0000 00000000 1000 08 AABBCCDD01000000")
    assert packet.content_of(encoder.encode(BEAT.frame(1))[:-1]) == content
    assert packet.unpack(encoder.encode(BEAT.frame(2))[:-1]).sequence == 0
    for expected in (*range(1, 65536), 0, 1):
        encoder.written()
        if expected in (1, 2, 65535, 0):
            assert packet.unpack(encoder.encode(BEAT.frame(3))[:-1]).sequence == expected


@pytest.mark.parametrize(
    ("spec", "frame"),
    [
        (WriterSpec("slcan", 3), (0x010, bytes(9), FD)),
        (WriterSpec("slcan", 3), (0x010, bytes(12), 0)),
        (WriterSpec("slcan", 3), (0x800, bytes(8), FD)),
        (WriterSpec("packet", 3), (0x800, bytes(8), FD)),
    ],
)
def test_impossible_frames_are_refused(spec: WriterSpec, frame: tuple[int, bytes, int]) -> None:
    with pytest.raises(ValueError, match=r"bytes|bits"):
        Encoder(spec).encode(frame)
