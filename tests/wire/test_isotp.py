"""ISO-TP: golden frames by hand from the layout of ISO 15765-2, and both ends against each other."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.wire.isotp import FrameLength, Reassembler, Sender, TransferError, flow_control, segments
from bench.wire.slcan import LENGTHS

GO = bytes.fromhex("30 00 00")


def content(size: int) -> bytes:
    return bytes(n % 251 for n in range(size))


def test_single_frames() -> None:
    assert segments(b"\x11\x22") == (bytes.fromhex("02 11 22"),)
    assert segments(content(7)) == (bytes.fromhex("07 00 01 02 03 04 05 06"),)
    assert segments(content(7), 64) == segments(content(7))
    assert segments(content(8), 64) == (bytes.fromhex("00 08 00 01 02 03 04 05 06 07 CC CC"),)
    assert segments(content(62), 64) == (b"\x00\x3e" + content(62),)


def test_first_and_consecutive_frames() -> None:
    assert segments(content(20)) == (
        bytes.fromhex("10 14 00 01 02 03 04 05"),
        bytes.fromhex("21 06 07 08 09 0A 0B 0C"),
        bytes.fromhex("22 0D 0E 0F 10 11 12 13"),
    )
    assert segments(content(8)) == (bytes.fromhex("10 08 00 01 02 03 04 05"), bytes.fromhex("21 06 07"))
    assert segments(content(73), 64) == (b"\x10\x49" + content(62), b"\x21" + content(73)[62:])
    assert segments(content(75), 64)[1] == b"\x21" + content(75)[62:] + bytes.fromhex("CC CC")  # 14 to 16 bytes
    assert segments(content(70), 64)[1] == b"\x21" + content(70)[62:] + bytes.fromhex("CC CC CC")  # 9 to 12 bytes


def test_the_sequence_number_wraps() -> None:
    frames = segments(content(6 + 7 * 18))
    assert [f[0] for f in frames[1:]] == [*range(0x21, 0x30), 0x20, 0x21, 0x22]


def test_lengths_over_12_bits_use_the_escape() -> None:
    assert segments(content(4095))[0] == bytes.fromhex("1F FF 00 01 02 03 04 05")
    assert segments(content(4096))[0] == bytes.fromhex("10 00 00 00 10 00 00 01")
    assert segments(content(4096))[1][:2] == bytes.fromhex("21 02")
    assert segments(content(70_000), 64)[0] == bytes.fromhex("10 00 00 01 11 70") + content(58)


def test_an_empty_payload_cannot_be_sent() -> None:
    with pytest.raises(ValueError, match="payload of 0 bytes"):
        segments(b"")


def test_flow_control_golden() -> None:
    assert flow_control() == GO
    assert flow_control(8, 0xF1) == bytes.fromhex("30 08 F1")
    receiver = Reassembler(block_size=8, st_min=10)
    assert receiver.feed(segments(content(20))[0]).send == bytes.fromhex("30 08 0A")


@given(
    st.binary(min_size=1, max_size=300) | st.integers(4090, 4100).map(content),
    st.sampled_from([8, 64]),
    st.integers(0, 20),
)
def test_both_ends(payload: bytes, frame_length: FrameLength, block_size: int) -> None:
    sender, receiver = Sender(payload, frame_length), Reassembler(block_size=block_size)
    queue, received = [sender.start()], []
    while queue:
        frame = queue.pop(0)
        assert len(frame) in LENGTHS[: 9 if frame_length == 8 else None]
        event = receiver.feed(frame)
        assert event.failure is None
        if event.send is not None:
            assert not queue, "flow control is due only after the last frame of a block"
            queue += sender.feed(event.send)
        if event.received is not None:
            received.append(event.received)
    assert received == [payload]
    assert sender.done
    assert not receiver.receiving


def test_a_wrong_sequence_number_ends_the_transfer() -> None:
    receiver, frames = Reassembler(), segments(content(40))
    receiver.feed(frames[0])
    receiver.feed(frames[1])
    assert receiver.feed(frames[3]).failure == "wrong-sequence"
    assert (receiver.receiving, receiver.held) == (False, 0)
    assert receiver.feed(frames[4]).failure == "unexpected"
    assert [receiver.feed(f) for f in frames][-1].received == content(40)


def test_a_repeated_frame_ends_the_transfer() -> None:
    receiver, frames = Reassembler(), segments(content(40))
    receiver.feed(frames[0])
    receiver.feed(frames[1])
    assert receiver.feed(frames[1]).failure == "wrong-sequence"


@pytest.mark.parametrize("size", [3, 1])
def test_a_short_consecutive_frame_ends_the_transfer(size: int) -> None:
    receiver, frames = Reassembler(), segments(content(40))
    receiver.feed(frames[0])
    assert receiver.feed(frames[1][:size]).failure == "wrong-length"
    assert not receiver.receiving


def test_a_consecutive_frame_longer_than_the_first_ends_the_transfer() -> None:
    receiver = Reassembler()
    receiver.feed(segments(content(40))[0])
    assert receiver.feed(b"\x21" + bytes(63)).failure == "wrong-length"


def test_a_new_transfer_ends_the_other_and_is_taken() -> None:
    receiver = Reassembler()
    receiver.feed(segments(content(40))[0])
    event = receiver.feed(b"\x01\x55")
    assert (event.received, event.failure) == (b"\x55", "unexpected")
    receiver.feed(segments(content(40))[0])
    event = receiver.feed(segments(content(50))[0])
    assert (event.send, event.failure) == (GO, "unexpected")
    assert [receiver.feed(f) for f in segments(content(50))[1:]][-1].received == content(50)


def test_the_limit_holds_before_memory_is_taken() -> None:
    receiver = Reassembler(limit=100)
    event = receiver.feed(bytes.fromhex("10 00 FF FF FF FF 00 01"))
    assert (event.send, event.failure) == (bytes.fromhex("32 00 00"), "too-long")
    assert (receiver.receiving, receiver.held) == (False, 0)
    assert receiver.feed(segments(content(101))[0]).failure == "too-long"
    assert [receiver.feed(f) for f in segments(content(100))][-1].received == content(100)
    assert Reassembler(limit=10).feed(b"\x00\x0b" + bytes(14)).failure == "too-long"


@pytest.mark.parametrize(
    "frame",
    [
        "",
        "00",
        "05 01 02",  # says five, has two
        "08 01 02 03 04 05 06 07",
        "03 00 00 00 00 00 00 00 00 00 00 00",  # 12 bytes need the escape
        "00 00" + " 00" * 10,
        "00 0B" + " 00" * 10,
        "10 07 00 00 00 00 00 00",  # fits a single frame
        "10 00 00 00 0F FF 00 00",  # fits 12 bits
        "10 20 00",
        "40 00",
        "FF" * 8,
        "02 00 00 00 00 00 00 00 00",  # 9 bytes: no frame has them
        "00" * 65,
    ],
)
def test_malformed_frames_are_ignored_and_named(frame: str) -> None:
    receiver, frames = Reassembler(), segments(content(20))
    receiver.feed(frames[0])
    event = receiver.feed(bytes.fromhex(frame))
    assert (event.received, event.send, event.failure) == (None, None, "malformed")
    assert [receiver.feed(f) for f in frames[1:]][-1].received == content(20)


def test_flow_control_is_not_for_the_receiver() -> None:
    event = Reassembler().feed(GO)
    assert (event.received, event.send, event.failure) == (None, None, None)


def test_reset_drops_a_transfer() -> None:
    receiver, frames = Reassembler(), segments(content(20))
    receiver.feed(frames[0])
    receiver.reset()
    assert receiver.feed(frames[1]).failure == "unexpected"


def test_block_size_releases_frames_by_blocks() -> None:
    sender = Sender(content(6 + 7 * 5))
    assert sender.feed(GO) == ()  # nothing is under way yet
    sender.start()
    assert [f[0] for f in sender.feed(flow_control(2))] == [0x21, 0x22]
    assert sender.feed(b"\x01\x00") == ()
    assert [f[0] for f in sender.feed(flow_control(0))] == [0x23, 0x24, 0x25]
    assert sender.done
    assert sender.feed(GO) == ()


@pytest.mark.parametrize(
    ("st_min", "pause_ns"),
    [
        (0, 0),
        (1, 10**6),
        (0x7F, 127 * 10**6),
        (0xF1, 10**5),
        (0xF9, 9 * 10**5),
        (0x80, 127 * 10**6),
        (0xFA, 127 * 10**6),
    ],
)
def test_the_pause_between_frames(st_min: int, pause_ns: int) -> None:
    sender = Sender(content(20))
    sender.start()
    sender.feed(flow_control(0, st_min))
    assert sender.pause_ns == pause_ns


@pytest.mark.parametrize(("frame", "match"), [("32 00 00", "no room"), ("33 00 00", "flow status 3")])
def test_a_receiver_that_refuses(frame: str, match: str) -> None:
    sender = Sender(content(20))
    sender.start()
    with pytest.raises(TransferError, match=match):
        sender.feed(bytes.fromhex(frame))


def test_a_receiver_that_waits_for_ever() -> None:
    sender, wait = Sender(content(20)), bytes.fromhex("31 00 00")
    sender.start()
    for _ in range(16):
        assert sender.feed(wait) == ()
    with pytest.raises(TransferError, match="said wait 17 times"):
        sender.feed(wait)


def test_waits_are_counted_anew_in_each_block() -> None:
    sender, wait = Sender(content(40)), bytes.fromhex("31 00 00")
    sender.start()
    for _ in range(3):
        assert [sender.feed(wait) for _ in range(16)] == [()] * 16
        assert len(sender.feed(flow_control(1))) == 1


@given(st.lists(st.binary(max_size=66), max_size=40), st.integers(1, 300))
def test_any_frames(frames: list[bytes], limit: int) -> None:
    receiver = Reassembler(limit=limit)
    for frame in frames:
        event = receiver.feed(frame)
        assert event.received is None or 0 < len(event.received) <= limit
        assert receiver.held <= limit
