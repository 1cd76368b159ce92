"""What the heartbeat process writes and when: on real ptys and sockets, with times that the test gives."""

from __future__ import annotations

import os
import select
import socket
import tempfile
import tty
from collections.abc import Iterator
from contextlib import suppress

import can
import pytest

from bench.errors import ConfigError
from drivers.beat import BEATS, FD, FRAMES, LEASE, REFUSED, WORDS, Beat, Encoder, Frame, WriterSpec
from drivers.heartbeat_process import PACE_S, Pacemaker
from drivers.heartbeat_writers import BusWriter, PortWriter, open_writer
from drivers.portable import Words

MS = 1_000_000
T0 = 1000 * MS
BEAT = Beat(0x010, bytes(8), range(32, 48), fd=True, period_s=0.02, lease_s=0.1)
SLCAN = WriterSpec("slcan")


def beat_line(counter: int) -> bytes:
    return b"d010800000000%02X000000\r" % counter


def numbered(number: int) -> Frame:
    return 0x011, number.to_bytes(64, "big"), FD


def line(number: int) -> bytes:
    return b"d011F%0128X\r" % number


@pytest.fixture
def words() -> Iterator[Words]:
    with tempfile.TemporaryFile() as page:
        page.truncate(8 * WORDS)
        yield Words(page.fileno(), WORDS)


@pytest.fixture
def pty() -> Iterator[tuple[int, int]]:
    master, slave = os.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    yield master, slave
    for end in (master, slave):
        with suppress(OSError):
            os.close(end)


def taken(master: int, most: int = 1 << 20) -> bytes:
    """What waits at the master, up to `most` bytes."""
    parts = []
    with suppress(BlockingIOError):
        while most > 0:
            parts.append(os.read(master, most))
            most -= len(parts[-1])
    return b"".join(parts)


def pacemaker_on(fileno: int, words: Words) -> Pacemaker:
    return Pacemaker(BEAT, PortWriter(os.dup(fileno), Encoder(SLCAN)), words)


def test_one_heartbeat_a_period_and_one_after_a_pause(pty: tuple[int, int], words: Words) -> None:
    master, slave = pty
    p = pacemaker_on(slave, words)
    p.turn(T0)
    assert taken(master) == b""  # no lease yet
    assert p.timeout_s(T0) == 0.02
    words[LEASE] = T0
    assert p.timeout_s(T0) == 0.0
    p.turn(T0)
    p.turn(T0 + 5 * MS)
    assert taken(master) == beat_line(1)
    assert p.timeout_s(T0 + 5 * MS) == pytest.approx(0.015)
    p.turn(T0 + 5000 * MS)
    assert taken(master) == b""  # the lease is over
    words[LEASE] = T0 + 5000 * MS
    for _ in range(10):
        p.turn(T0 + 5000 * MS)
    assert taken(master) == beat_line(2)
    assert words[BEATS] == 2
    p.swap(None)


def test_heartbeats_go_before_waiting_frames(pty: tuple[int, int], words: Words) -> None:
    master, slave = pty
    p = pacemaker_on(slave, words)
    p.backlog.extend(numbered(n) for n in range(40))
    words[LEASE] = T0
    p.turn(T0)
    p.turn(T0 + 20 * MS)
    assert taken(master) == b"".join(
        [beat_line(1), *(line(n) for n in range(32)), beat_line(2), *(line(n) for n in range(32, 40))]
    )
    assert words[FRAMES] == 40
    p.swap(None)


def test_a_full_port_drops_heartbeats_and_keeps_lines_whole(pty: tuple[int, int], words: Words) -> None:
    master, slave = pty
    p = pacemaker_on(slave, words)
    p.backlog.extend(numbered(n) for n in range(400))  # more than the pty holds
    now = T0
    while not p.held or select.select([], [slave], [], 0.1)[1]:  # the kernel moves bytes on for a while
        p.turn(now)
    for _ in range(50):  # as many heartbeats are due while nobody reads
        now += 20 * MS
        words[LEASE] = now
        p.turn(now)
        assert p.held
        assert p.timeout_s(now) == 0.02
    assert words[BEATS] == 0
    received = b""
    while p.backlog or p.held:  # the other end wakes up and takes little by little, always at the same time
        received += taken(master, 7)
        p.turn(now)
    received += taken(master)
    assert received.count(beat_line(1)) == 1
    assert received.replace(beat_line(1), b"") == b"".join(line(n) for n in range(400))
    assert words[BEATS] == 1
    assert words[FRAMES] == 400
    p.swap(None)


def test_little_lies_unsent_where_the_kernel_tells(words: Words) -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        p = pacemaker_on(theirs.fileno(), words)
        for tick in range(200):  # four seconds of heartbeats that nobody reads
            words[LEASE] = T0 + tick * 20 * MS
            p.turn(T0 + tick * 20 * MS)
        assert p.held
        assert p.timeout_s(T0 + 4000 * MS) == PACE_S
        waiting = ours.recv(1 << 20)
        assert len(waiting) <= 1024 + len(beat_line(1))
        assert waiting.count(b"\r") == words[BEATS]
        p.turn(T0 + 4000 * MS)
        assert ours.recv(1 << 20).count(b"\r") == 1
        p.swap(None)


def test_a_lost_port_is_an_error_and_its_frames_are_stale(pty: tuple[int, int], words: Words) -> None:
    master, slave = pty
    p = pacemaker_on(slave, words)
    os.close(master)
    p.backlog.append(numbered(0))
    with pytest.raises(OSError, match="output error"):
        p.turn(T0)
    p.swap(None)
    assert not p.backlog
    words[LEASE] = T0
    p.backlog.append(numbered(0))
    p.turn(T0)
    assert not p.backlog
    assert words[BEATS] == words[FRAMES] == 0
    assert p.timeout_s(T0) == 0.02


def test_frames_that_the_format_does_not_know_are_counted_and_left_out(pty: tuple[int, int], words: Words) -> None:
    master, slave = pty
    p = pacemaker_on(slave, words)
    p.backlog.extend([(0x011, bytes(9), FD), numbered(1), (0x800, bytes(8), FD), numbered(2)])
    p.turn(T0)
    assert taken(master) == line(1) + line(2)
    assert (words[FRAMES], words[REFUSED]) == (2, 2)
    p.swap(None)


def test_a_bus_of_python_can(words: Words) -> None:
    with can.Bus(interface="virtual", channel="heartbeat") as other:
        writer = open_writer(
            WriterSpec("python-can", brs=True, arguments={"interface": "virtual", "channel": "heartbeat"}),
            Encoder(SLCAN),
            [],
        )
        p = Pacemaker(BEAT, writer, words)
        words[LEASE] = T0
        p.backlog += [(0x80000123, b"\1\2", 0)]
        p.turn(T0)
        first, second = other.recv(5), other.recv(5)
        assert first is not None
        assert second is not None
        assert (first.arbitration_id, bytes(first.data)) == (0x010, bytes.fromhex("0000000001000000"))
        assert (first.is_fd, first.bitrate_switch, first.is_extended_id) == (True, True, False)
        assert (second.arbitration_id, bytes(second.data)) == (0x123, b"\1\2")
        assert (second.is_fd, second.bitrate_switch, second.is_extended_id) == (False, False, True)
        assert not p.held
        p.swap(None)


def test_what_others_send_does_not_fill_the_bus(words: Words) -> None:
    arguments = {"interface": "virtual", "channel": "heartbeat", "rx_queue_size": 100}
    with can.Bus(interface="virtual", channel="heartbeat") as other:
        p = Pacemaker(BEAT, BusWriter(arguments, brs=False), words)
        for number in range(300):  # a full queue makes `virtual` fail the sender
            other.send(can.Message(arbitration_id=0x100, data=[number & 0xFF]))
            p.turn(T0)
        p.swap(None)


def test_a_bus_that_cannot_be_opened_names_the_remedy() -> None:
    with pytest.raises(ConfigError, match='heartbeat = "thread"'):
        BusWriter({"interface": "no-such-interface"}, brs=False)
