"""Bus load against frames counted bit by bit on paper, and against the classic formula."""

from __future__ import annotations

import pytest

from bench.rigfile import load_rig
from bench.rigfile.busload import ON_DEMAND_HZ, bus_load, frame_seconds
from bench.rigfile.messages import Message, MessageMap


def message(
    length: int, *, name: str = "M", fd: bool = False, extended: bool = False, period_s: float = 0.0
) -> Message:
    return Message(name, 1 << 31 if extended else 1, length, fd, period_s, "", (), "")


@pytest.mark.parametrize(
    ("length", "extended", "bits"),
    [
        # start 1 + identifier 11 + RTR, IDE, r0 3 + length 4 + CRC 15 = 34 stuffable, 34 + 64 = 98 with 8 bytes; at worst
        # floor(97 / 4) = 24 stuff bits; then delimiter 1 + acknowledge 2 + end 7 + space 3 = 13: 98 + 24 + 13 = 135
        (8, False, 135),
        # 34 + floor(33 / 4) = 8 + 13 = 55
        (0, False, 55),
        # extended: 54 stuffable (18 identifier bits, SRR and r1 more): 54 + 64 = 118 + floor(117 / 4) = 29 + 13 = 160
        (8, True, 160),
    ],
)
def test_a_classic_frame_counted_by_hand(length: int, extended: bool, bits: int) -> None:
    assert frame_seconds(message(length, extended=extended), 500e3, None) == pytest.approx(bits / 500e3, rel=1e-14)


@pytest.mark.parametrize(
    ("length", "slow", "fast"),
    [
        # slow: start 1 + identifier 11 + r1, IDE, FDF, res, BRS 5 = 17, stuffed floor(16 / 4) = 4 -> 21;
        #       delimiter 1 + acknowledge 2 + end 7 + space 3 = 13 -> 34
        # fast, 64 bytes: ESI 1 + length 4 + 512 = 517, stuffed at worst ceil(517 / 4) = 130 -> 647;
        #       stuff count 4 + CRC 21 = 25, fixed stuff bits 1 + ceil(25 / 4) = 8 -> 33; together 680
        (64, 34, 680),
        # 16 bytes keep the 17-bit CRC: 5 + 128 = 133 + 34 = 167; 4 + 17 = 21 + 1 + 6 = 28 -> 195
        (16, 34, 195),
        # 20 bytes have the 21-bit one: 5 + 160 = 165 + 42 = 207; 33 -> 240
        (20, 34, 240),
        # 8 bytes: 5 + 64 = 69 + 18 = 87; 28 -> 115
        (8, 34, 115),
    ],
)
def test_an_fd_frame_counted_by_hand(length: int, slow: int, fast: int) -> None:
    seconds = frame_seconds(message(length, fd=True), 1e6, 5e6)
    assert seconds == pytest.approx(slow / 1e6 + fast / 5e6, rel=1e-14)


def test_without_a_data_rate_everything_goes_at_the_nominal_one() -> None:
    assert frame_seconds(message(64, fd=True), 1e6, None) == pytest.approx((34 + 680) / 1e6, rel=1e-14)


def test_load_is_time_per_period_and_an_allowance_on_demand() -> None:
    periodic, asked = message(64, name="Telemetry", fd=True, period_s=1e-3), message(8, name="Command", fd=True)
    load = bus_load(MessageMap({"Telemetry": periodic, "Command": asked}), 1e6, 5e6)
    assert load.by_message["Telemetry"] == pytest.approx(170e-6 / 1e-3, rel=1e-12)  # 34 us + 136 us
    assert load.by_message["Command"] == pytest.approx(57e-6 * ON_DEMAND_HZ, rel=1e-12)  # 34 us + 23 us
    assert load.total == pytest.approx(0.17 + 57e-6 * ON_DEMAND_HZ, rel=1e-12)


def test_the_load_of_tsbs12() -> None:
    rig = load_rig("tsbs12")
    load = bus_load(rig.messages, rig.link.bitrate, rig.link.data_bitrate)
    # telemetry 170 us a ms; heartbeat 57 us in 20 ms; on demand 50 times a second 57 us (8 bytes), 49 us (4), 170 us (64)
    by_hand = 0.170 + 57e-6 / 20e-3 + ON_DEMAND_HZ * (4 * 57e-6 + 2 * 49e-6 + 2 * 170e-6)
    # of captures CaptureArm and CaptureStatus (32 bytes): 261 + 66 + 33 = 360 fast, 34 us slow: 106 us; CaptureAsk 57 us;
    # CaptureRead (12): 101 + 26 + 28 = 155: 65 us; CaptureFlow (3): 29 + 8 + 28 = 65: 47 us; CaptureBlock, CaptureData 170 us
    by_hand += ON_DEMAND_HZ * (2 * 106e-6 + 57e-6 + 65e-6 + 47e-6 + 2 * 170e-6)
    assert load.total == pytest.approx(by_hand, rel=1e-12)


def test_a_message_in_segments_counted_by_hand() -> None:
    # 32 bytes on classic CAN: 6 in the first frame, 7 in each of the next four: five frames of 8 bytes, 135 bits each
    assert frame_seconds(message(32), 500e3, None) == pytest.approx(5 * 135 / 500e3, rel=1e-14)
    # 12 bytes: 6 and 6
    assert frame_seconds(message(12), 500e3, None) == pytest.approx(2 * 135 / 500e3, rel=1e-14)
