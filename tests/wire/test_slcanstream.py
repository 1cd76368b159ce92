"""SLCAN streams: frames out of bytes in any pieces, and what is no frame is counted."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from bench.link.frames import ERROR, EXTENDED, FD, FRAME, REMOTE, SWITCHED, FrameBatch, frame, payload
from bench.link.slcanstream import REPLIES, SlcanStream, encode
from bench.wire.slcan import BUS_ERROR, LENGTHS

T = 1_767_225_600 * 10**9
FRAMES = st.builds(
    lambda identifier, data, fd: frame(identifier, data, flags=FD if fd or len(data) > 8 else 0),
    st.integers(0, 0x7FF) | st.integers(0, 0x1FFFFFFF).map(lambda n: n | EXTENDED),
    st.sampled_from(LENGTHS).flatmap(lambda n: st.binary(min_size=n, max_size=n)),
    st.booleans(),
)
FRAGMENTS = st.sampled_from(
    [b"\r", b"\a", b"t0101AA\r", b"b1001AA\r", b"F80\r", b"V1013\r", b"z\r", b"r0108\r", b"t01", b"0" * 150]
)


def state(stream: SlcanStream) -> tuple[object, ...]:
    return stream.malformed, stream.refused, stream.remote, stream.status, stream.replies, stream.pending


def rows(batch: FrameBatch) -> list[tuple[int, bytes, int]]:
    return [(int(r["id"]), payload(r), int(r["flags"])) for r in batch]


def test_golden_stream() -> None:
    stream = SlcanStream()
    batch = stream.feed(b"\rz\rt0102BEEF\r\aF80\rB1FFFFFFF9000102030405060708090A0B\rV1013\r", T)
    assert rows(batch) == [(0x010, b"\xbe\xef", 0), (EXTENDED | 0x1FFFFFFF, bytes(range(12)), FD | SWITCHED)]
    assert batch["t_ns"].tolist() == [T, T]
    assert batch["hw_ns"].tolist() == [0, 0]
    assert (stream.refused, stream.status, stream.replies, stream.malformed) == (1, BUS_ERROR, [b"V1013"], 0)


def test_a_batch_is_written_line_by_line_in_its_order() -> None:
    batch = np.concatenate(
        [frame(0x100, bytes(12), flags=FD), frame(0x010, b"\xab\xcd"), frame(EXTENDED | 0x123, b"", flags=FD)]
    )
    assert encode(batch, brs=True) == b"b1009" + b"00" * 12 + b"\rt0102ABCD\rB000001230\r"
    assert encode(batch, brs=False) == b"d1009" + b"00" * 12 + b"\rt0102ABCD\rD000001230\r"
    assert encode(batch[:0], brs=True) == b""


@pytest.mark.parametrize(
    ("bad", "match"),
    [
        (frame(0x100, bytes(9), flags=FD), "payload of 9 bytes"),
        (frame(0x100, bytes(12)), "payload of 12 bytes; a classic"),
        (frame(0x800, b""), "identifier 0x800"),
        (frame(0, b"", flags=ERROR), "error frame"),
    ],
)
def test_frames_that_cannot_be_sent(bad: FrameBatch, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        encode(bad, brs=True)


def test_an_impossible_length_byte_is_not_sent() -> None:
    bad = frame(0x100, b"", flags=FD)
    bad["length"] = 200
    with pytest.raises(ValueError, match="payload of 200 bytes"):
        encode(bad, brs=False)


@given(st.lists(FRAMES, max_size=8), st.booleans())
def test_round_trip(frames: list[FrameBatch], brs: bool) -> None:
    batch = np.concatenate([np.empty(0, FRAME), *frames])
    stream = SlcanStream()
    came = rows(stream.feed(encode(batch, brs=brs), T))
    assert came == [(i, data, flags | SWITCHED if brs and flags & FD else flags) for i, data, flags in rows(batch)]
    assert state(stream) == (0, 0, 0, None, [], 0)


@given(
    st.lists(st.binary(max_size=12) | FRAGMENTS, max_size=30).map(b"".join),
    st.lists(st.integers(0, 400)),
    st.booleans(),
)
@example(b"x" * 400 + b"\rt0100\r", [142, 143, 144, 300], False)
@example(b"x" * 400 + b"\at0100\r", [143, 399, 400], False)
def test_any_split_gives_the_same(data: bytes, cuts: list[int], timestamp: bool) -> None:
    whole, split = SlcanStream(timestamp=timestamp), SlcanStream(timestamp=timestamp)
    expected = whole.feed(data, T)
    places = [0, *sorted(min(c, len(data)) for c in cuts), len(data)]
    got = [split.feed(data[a:b], T) for a, b in pairwise(places)]
    assert np.concatenate(got).tobytes() == expected.tobytes()
    assert state(whole) == state(split)


@pytest.mark.parametrize(
    "text",
    [
        b"t0101",
        b"t01099",
        b"A1B2C3",  # the tail of a frame
        b"F8",
        b"F800",
        b"C1",
        b"V\xff",
        b"\x00",
        b"r0109",
        b"r8000",
        b"V" * 65,
        b"0" * 500,
    ],
)
def test_malformed_lines_are_counted_and_the_next_frame_is_taken(text: bytes) -> None:
    stream = SlcanStream()
    assert rows(stream.feed(text + b"\rt0101AA\r", T)) == [(0x010, b"\xaa", 0)]
    assert (stream.malformed, stream.replies, stream.status) == (1, [], None)


def test_a_line_cut_off_by_a_refusal_is_no_frame() -> None:
    stream = SlcanStream()
    assert rows(stream.feed(b"t0101AA\at0101BB\r", T)) == [(0x010, b"\xbb", 0)]
    assert (stream.refused, stream.malformed) == (1, 1)


def test_remote_frames_are_counted_and_give_no_sample() -> None:
    stream = SlcanStream()
    assert len(stream.feed(b"r0108\rR1FFFFFFF0\r", T)) == 0
    assert (stream.remote, stream.malformed) == (2, 0)


def test_commands_and_answers_are_kept_in_order() -> None:
    stream = SlcanStream()
    stream.feed(b"C\rS8\rY5\rZ1\rO\rF\rV\rNA123\r", T)
    assert stream.replies == [b"C", b"S8", b"Y5", b"Z1", b"O", b"F", b"V", b"NA123"]


def test_answers_that_nobody_takes_are_bounded() -> None:
    stream = SlcanStream()
    stream.feed(b"".join(b"V%04d\r" % n for n in range(REPLIES + 10)), T)
    assert len(stream.replies) == REPLIES
    assert stream.replies[-1] == b"V%04d" % (REPLIES + 9)


def test_an_endless_line_takes_no_memory_and_counts_once() -> None:
    stream = SlcanStream()
    for _ in range(100):
        stream.feed(b"0" * 10_000, T)
        assert stream.pending < 150
    assert rows(stream.feed(b"\rt0100\r", T)) == [(0x010, b"", 0)]
    assert stream.malformed == 1


def test_the_batch_can_be_written_to() -> None:
    batch = SlcanStream().feed(b"t0100\r", T)
    batch["t_ns"] += 1
    assert batch["t_ns"].tolist() == [T + 1]


def test_adapter_time_is_unwrapped_over_minutes() -> None:
    stream, second = SlcanStream(timestamp=True), 10**9
    taken = []
    for host_s, ms in [(0.0, 59_990), (0.02, 10), (0.02, 11), (30.0, 30_000), (210.0, 30_001), (210.0, 30_000)]:
        taken += stream.feed(b"t0100%04X\r" % ms, T + int(host_s * second))["hw_ns"].tolist()
    since = [(t - taken[0]) // 1_000_000 for t in taken]
    assert since == [0, 20, 21, 30_010, 210_011, 210_010]
    assert min(taken) > 0


def test_frames_that_the_adapter_lost_itself_are_counted() -> None:
    stream = SlcanStream()
    for answer in (b"F00\r", b"F04\r", b"F08\r", b"F00\r", b"F02\r", b"F81\r"):
        stream.feed(answer, 0)
    assert stream.overruns == 3


@given(st.booleans(), st.integers(0, 0x1FFF_FFFF), st.integers(0, 8), st.booleans())
def test_remote_frames_are_given_where_they_are_wanted(extended: bool, number: int, dlc: int, timestamp: bool) -> None:
    number = number if extended else number & 0x7FF
    line = (f"R{number:08X}{dlc}" if extended else f"r{number:03X}{dlc}") + ("0010" if timestamp else "")
    wanted, counted = SlcanStream(timestamp=timestamp, remotes=True), SlcanStream(timestamp=timestamp)
    batch = wanted.feed(f"{line}\r".encode(), T)
    assert (batch["id"].tolist(), batch["flags"].tolist(), batch["length"].tolist()) == (
        [number | (EXTENDED if extended else 0)], [REMOTE], [dlc],
    )  # fmt: skip
    assert bool(batch["hw_ns"][0]) == timestamp
    assert len(counted.feed(f"{line}\r".encode(), T)) == 0
    assert (wanted.remote, counted.remote, wanted.malformed) == (1, 1, 0)
