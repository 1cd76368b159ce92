"""The heartbeat thread, with a wire that the test watches."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from bench.errors import LinkError
from bench.link.frames import FD, SENT, FrameBatch, frame
from drivers.heartbeat import Beat, HeartbeatThread

BEAT = Beat(0x010, bytes(8), range(32, 48), fd=True, period_s=0.005, lease_s=1.0)
DEADLINE_S = 30.0


class Wire:
    """Keeps what is written; fails while it is `down`."""

    def __init__(self) -> None:
        self.frames: list[tuple[int, int, bytes]] = []
        self.lines: list[bytes] = []
        self.tries = 0
        self.down = False
        self._changed = threading.Condition()

    def write(self, batch: FrameBatch) -> None:
        with self._changed:
            self.tries += 1
            self._changed.notify_all()
            if self.down:
                raise LinkError("cable out")
            self.frames += [(int(f["id"]), int(f["flags"]), bytes(f["data"][:8])) for f in batch]

    def write_bytes(self, data: bytes) -> None:
        self.lines.append(data)

    def wait_for(self, condition: Callable[[], bool]) -> None:
        with self._changed:
            assert self._changed.wait_for(condition, DEADLINE_S)

    def wait_for_a_try(self) -> None:
        tries = self.tries
        self.wait_for(lambda: self.tries > tries)

    def counters(self) -> list[int]:
        return [int.from_bytes(data[4:6], "little") for identifier, _, data in self.frames if identifier == 0x010]


@pytest.fixture
def wire() -> Wire:
    return Wire()


@pytest.fixture
def heart(wire: Wire) -> Iterator[HeartbeatThread]:
    heart = HeartbeatThread(BEAT, wire.write, wire.write_bytes)
    yield heart
    heart.close()


def test_heartbeats_count_up(wire: Wire, heart: HeartbeatThread) -> None:
    heart.renew_lease()
    wire.wait_for(lambda: len(wire.frames) >= 5)
    assert heart.owns_port
    assert wire.counters()[:5] == [1, 2, 3, 4, 5]
    assert {flags for _, flags, _ in wire.frames} == {SENT | FD}
    assert heart.counts()[2] >= 5_000_000


def test_heartbeats_follow_the_lease(wire: Wire) -> None:
    metronome = Wire()
    heart, other = HeartbeatThread(replace(BEAT, lease_s=0.025), wire.write), HeartbeatThread(BEAT, metronome.write)

    def passes(count: int) -> None:
        for _ in range(count):
            other.renew_lease()
            metronome.wait_for_a_try()

    try:
        passes(5)
        assert wire.frames == []  # not renewed yet
        seen = 0
        for _ in range(3):
            while len(wire.counters()) == seen:
                heart.renew_lease()
                passes(1)
            passes(20)
            assert len(wire.counters()) - seen <= 10  # five each of the last renewal and of the one before
            seen = len(wire.counters())
            passes(5)
            assert len(wire.counters()) == seen
        assert wire.counters() == list(range(1, seen + 1))
        assert heart.counts()[0] == seen
    finally:
        heart.close()
        other.close()


def test_frames_go_between_heartbeats(wire: Wire, heart: HeartbeatThread) -> None:
    heart.renew_lease()
    heart.send(np.concatenate([frame(0x011, bytes([n]), flags=SENT) for n in range(100)]))
    heart.send_bytes(b"F\r")
    assert [data[0] for identifier, _, data in wire.frames if identifier == 0x011] == list(range(100))
    assert wire.lines == [b"F\r"]
    assert heart.counts()[1] == 100


def test_a_heartbeat_goes_in_the_middle_of_a_long_batch(wire: Wire) -> None:
    """A wire so slow that every sixteen frames take a period: the batch alone would keep the lock."""
    slow = threading.Event()

    def write(batch: FrameBatch) -> None:
        if len(batch) > 1:
            slow.wait(0.006)
        wire.write(batch)

    heart = HeartbeatThread(BEAT, write)
    heart.renew_lease()
    heart.send(np.concatenate([frame(0x011, bytes(8))] * 160))
    heart.close()
    order = [identifier for identifier, _, _ in wire.frames]
    inside = order[order.index(0x011) : len(order) - order[::-1].index(0x011)]
    assert inside.count(0x010) >= 9


def test_a_lost_wire_is_a_fault_until_it_is_back(wire: Wire, heart: HeartbeatThread) -> None:
    heart.renew_lease()
    wire.wait_for(lambda: len(wire.frames) >= 1)
    wire.down = True
    tries = wire.tries
    wire.wait_for(lambda: wire.tries >= tries + 3)
    assert heart.fault == "cable out"
    with pytest.raises(LinkError, match="cable out"):
        heart.send(frame(0x011, b""))
    heart.replace_port(None)
    before = len(wire.counters())
    wire.down = False
    heart.renew_lease()
    wire.wait_for(lambda: len(wire.counters()) >= before + 2)
    assert heart.fault is None
    assert wire.counters() == list(range(1, len(wire.counters()) + 1))


def test_closed_is_closed(wire: Wire, heart: HeartbeatThread) -> None:
    heart.close()
    heart.close()
    with pytest.raises(LinkError, match="closed"):
        heart.send(frame(0x011, b""))
    with pytest.raises(LinkError, match="closed"):
        heart.send_bytes(b"F\r")
    heart.renew_lease()
    assert wire.frames == []


def test_raw_lines_need_a_wire_that_takes_them(wire: Wire) -> None:
    heart = HeartbeatThread(BEAT, wire.write)
    with pytest.raises(ValueError, match="frames only"):
        heart.send_bytes(b"F\r")
    heart.close()
