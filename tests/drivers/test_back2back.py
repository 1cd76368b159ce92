"""Two buses of `slcan_batch` on one cable: what python-can's own back-to-back tests ask of every interface.

The assertions are those of python-can's `back2back_test.py`.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack

import can
import pytest
from far_end import Adapter, FarEnd, far_end

from drivers.slcan_bus import SlcanBatchBus

LONG_S = 20.0
FRAMES = frozenset(b"tTdDbBrR")


class Cable:
    """The adapters of one bus: each hands on what it is told to send to the others."""

    def __init__(self, stack: ExitStack, count: int = 2) -> None:
        self.writing = threading.Lock()
        self.ends = [stack.enter_context(far_end(True, self._station(k))) for k in range(count)]

    def _station(self, number: int) -> Station:
        return Station(self, number)

    def carry(self, sender: int, lines: bytes) -> None:
        for k, end in enumerate(self.ends):
            if k != sender and end.clients:
                end.write(lines)


class Station:
    """One adapter on the cable."""

    def __init__(self, cable: Cable, number: int) -> None:
        self._cable, self._number = cable, number
        self._adapter, self._rest = Adapter(), b""

    def __call__(self, data: bytes) -> bytes:
        *lines, self._rest = (self._rest + data).split(b"\r")
        sent = b"".join(line + b"\r" for line in lines if line[:1] and line[0] in FRAMES)
        if sent:
            self._cable.carry(self._number, sent)
        return self._adapter(data)


def opened(end: FarEnd, **settings: object) -> SlcanBatchBus:
    return SlcanBatchBus(end.where, fd=True, single_handle=True, **settings)  # type: ignore[arg-type]


@pytest.fixture
def pair() -> Iterator[tuple[SlcanBatchBus, SlcanBatchBus]]:
    with ExitStack() as stack:
        cable = Cable(stack)
        first, second = (stack.enter_context(opened(end)) for end in cable.ends)
        yield first, second


def same(came: can.Message | None, sent: can.Message) -> None:
    assert came is not None
    for name in (
        "arbitration_id",
        "is_extended_id",
        "is_remote_frame",
        "is_error_frame",
        "is_fd",
        "bitrate_switch",
        "dlc",
    ):
        assert getattr(came, name) == getattr(sent, name), name
    assert sent.is_remote_frame or bytes(came.data) == bytes(sent.data)


@pytest.mark.parametrize(
    "message",
    [
        can.Message(is_extended_id=False, arbitration_id=0x100, data=[1, 2, 3, 4, 5, 6, 7, 8]),
        can.Message(is_extended_id=True, arbitration_id=0x123456, data=[10, 11, 12, 13, 14, 15, 16, 17]),
        can.Message(is_extended_id=False, arbitration_id=0x200, is_remote_frame=True, dlc=4),
        can.Message(is_extended_id=True, arbitration_id=0x200, is_remote_frame=True, dlc=0),
        can.Message(is_extended_id=False, arbitration_id=0x300, data=[4, 5, 6]),
        can.Message(is_fd=True, is_extended_id=True, arbitration_id=0x56789, data=[0xFF] * 64),
        can.Message(is_fd=True, bitrate_switch=True, is_extended_id=True, arbitration_id=0x98765, data=[0xFF] * 48),
    ],
    ids=["standard", "extended", "remote", "remote extended", "short", "fd", "fd with bit-rate switch"],
)
def test_a_message_arrives_as_it_was_sent_both_ways(
    pair: tuple[SlcanBatchBus, SlcanBatchBus], message: can.Message
) -> None:
    first, second = pair
    first.send(message)
    same(second.recv(LONG_S), message)
    assert first.recv(0) is None
    message.arbitration_id += 1
    second.send(message)
    same(first.recv(LONG_S), message)


def test_nothing_comes_where_nothing_was_sent_and_shutting_down_twice_is_harmless(
    pair: tuple[SlcanBatchBus, SlcanBatchBus],
) -> None:
    assert pair[0].recv(0.1) is None
    pair[0].shutdown()
    pair[0].shutdown()


def test_times_are_unix_times_with_parts_of_a_second(pair: tuple[SlcanBatchBus, SlcanBatchBus]) -> None:
    first, second = pair
    for _ in range(3):
        second.send(can.Message())
    times = [came.timestamp for _ in range(3) if (came := first.recv(LONG_S))]
    assert len(times) == 3
    assert any(t % 1 for t in times)
    assert times[0] > 1.6e9


def test_each_bus_has_a_message_of_its_own() -> None:
    with ExitStack() as stack:
        first, second, third = (stack.enter_context(opened(end)) for end in Cable(stack, 3).ends)
        third.send(can.Message(is_extended_id=False, arbitration_id=0x300, data=[2, 1, 3]))
        one, two = first.recv(LONG_S), second.recv(LONG_S)
        assert one is not None
        assert two is not None
        one.data[0] = 4
        assert bytes(two.data) == b"\2\1\3"


def test_own_messages_are_refused_as_python_can_refuses_them() -> None:
    with pytest.raises(can.CanInterfaceNotImplementedError, match="does not send back what it sent"):
        can.Bus(interface="slcan_batch", channel="/dev/null", receive_own_messages=True, ignore_config=True)


def test_remote_frames_are_no_data_for_the_bench(pair: tuple[SlcanBatchBus, SlcanBatchBus]) -> None:
    first, second = pair
    second.send(can.Message(is_extended_id=False, arbitration_id=0x200, is_remote_frame=True, dlc=4))
    second.send(can.Message(is_extended_id=False, arbitration_id=0x201, data=[7]))
    found: list[int] = []
    while 0x201 not in found:
        found += first.recv_batch(0.1)["id"].tolist()
    assert found == [0x201]
    assert first.stream.remote == 1


def test_a_hundred_threads_send_and_receive_through_python_cans_lock() -> None:
    with ExitStack() as stack:
        ends = Cable(stack).ends
        first, second = (
            stack.enter_context(
                can.ThreadSafeBus(channel=e.where, interface="slcan_batch", fd=True, ignore_config=True)
            )
            for e in ends
        )
        second.set_filters([{"can_id": 0x123, "can_mask": 0xFF, "extended": True}])
        wanted = can.Message(arbitration_id=0x123, data=[254, 255, 1, 2])
        other = can.Message(arbitration_id=0x02, data=[1, 2, 3])
        with ThreadPoolExecutor(100) as senders, ThreadPoolExecutor(100) as receivers:
            came = [receivers.submit(second.recv, LONG_S) for _ in range(200)]
            for message in [wanted, other] * 200:
                senders.submit(first.send, message)
            for future in came:
                assert wanted.equals(future.result(), timestamp_delta=None)
