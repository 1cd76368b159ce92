"""Ports with two ends for the tests of the heartbeat, and a metronome.

No sleeps: "some time has passed" means that a second heartbeat process, the metronome, has beaten so often.
"""

from __future__ import annotations

import os
import select
import socket
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import numpy as np

from bench.link.frames import FD, FrameBatch, empty_batch, frame
from bench.wire import slcan
from drivers.heartbeat import Beat, HeartbeatProcess, WriterSpec

DEADLINE_S = 30.0


class Far:
    """The other end of a port: takes lines or packets apart."""

    def __init__(self, fileno: int, delimiter: bytes = b"\r") -> None:
        self._fileno, self._delimiter, self._rest = fileno, delimiter, b""

    def units(self, count: int, renew: Callable[[], None] = lambda: None) -> list[bytes]:
        """The next lines or packets; `renew` is called all the while."""
        deadline = time.monotonic() + DEADLINE_S
        while self._rest.count(self._delimiter) < count:
            assert time.monotonic() < deadline, f"{count} units expected, found {self._rest!r}"
            renew()
            if select.select([self._fileno], [], [], 0.1)[0]:
                data = os.read(self._fileno, 65536)
                assert data, f"{count} units expected, found the end"
                self._rest += data
        *units, self._rest = self._rest.split(self._delimiter, count)
        return units

    def beats(self, count: int, renew: Callable[[], None] = lambda: None) -> list[int]:
        """The counters of the next heartbeats; nothing else may come."""
        return [counter(line) for line in self.units(count, renew)]

    def waiting(self) -> list[bytes]:
        """What has come by now, whole."""
        while select.select([self._fileno], [], [], 0)[0] and (data := os.read(self._fileno, 65536)):
            self._rest += data
        assert not self._rest or self._rest.endswith(self._delimiter)
        return self.units(self._rest.count(self._delimiter))

    def end(self) -> bytes:
        """All that comes until the port is closed by its last user."""
        deadline = time.monotonic() + DEADLINE_S
        data = self._rest
        while True:
            assert select.select([self._fileno], [], [], max(0.0, deadline - time.monotonic()))[0], "still open"
            try:
                part = os.read(self._fileno, 65536)
            except OSError:  # a pty says it so
                return data
            if not part:
                return data
            data += part


def counter(line: bytes) -> int:
    parsed = slcan.parse(line)
    assert parsed is not None
    assert (parsed.identifier, parsed.fd) == (0x010, True)
    return int.from_bytes(parsed.payload[4:6], "little")


@contextmanager
def socket_port() -> Iterator[tuple[Far, socket.socket]]:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        yield Far(ours.fileno()), theirs


@contextmanager
def tcp_port() -> Iterator[tuple[Far, socket.socket]]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        theirs = socket.create_connection(server.getsockname())
        ours, _ = server.accept()
    with ours, theirs:
        yield Far(ours.fileno()), theirs


@contextmanager
def running(beat: Beat, writer: WriterSpec) -> Iterator[HeartbeatProcess]:
    process = HeartbeatProcess(beat, writer)
    try:
        yield process
    finally:
        process.close()


@contextmanager
def pty_port() -> Iterator[tuple[int, int]]:
    """Master and slave; the test may close them."""
    master, slave = os.openpty()
    tty.setraw(slave)
    yield master, slave
    for end in (master, slave):
        with suppress(OSError):
            os.close(end)


@contextmanager
def metronome() -> Iterator[Callable[[int], None]]:
    """A call that returns when so many heartbeats of 5 ms have passed, or more time."""
    beat = Beat(0x010, bytes(8), range(32, 48), fd=True, period_s=0.005)
    with socket_port() as (far, port), running(beat, WriterSpec("slcan", port.fileno())) as process:

        def passes(count: int) -> None:
            for _ in range(count):
                far.beats(1, process.renew_lease)

        yield passes


def descriptors() -> set[int]:
    """The open ones of this process."""
    return {int(number) for number in os.listdir("/proc/self/fd") if os.path.exists(f"/proc/self/fd/{number}")}


def frames(count: int, first: int = 0) -> FrameBatch:
    return np.concatenate(
        [empty_batch(), *(frame(0x011, (first + n).to_bytes(8, "big"), flags=FD) for n in range(count))]
    )


def wait_for(condition: Callable[[], bool], renew: Callable[[], None]) -> None:
    """Until the other process has come so far; it tells by shared numbers only."""
    deadline = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline, "did not come"
        renew()
        select.select([], [], [], 0.002)


def child_of(heart: HeartbeatProcess) -> int:
    assert heart._process is not None
    return heart._process.pid
