"""The heartbeat process: `python -m drivers.heartbeat_process`, started by `drivers.heartbeat`.

A process of its own, because a Python thread cannot keep 20 ms: imports and long calls hold it for up to 350 ms. It is
the one writer of a byte stream, so it also writes the bench's frames, in order. It falls silent, and the controller's
watchdog lands the rotor, when

- the bench has died: its pipe (standard input) ends, or this process has a new parent: it exits at once;
- the bench hangs or is stopped: the lease is not renewed;
- the port is lost, until the bench hands over a new one.

A port that takes no bytes stops nothing else. Frames wait (the bench is told to by a short queue), a heartbeat does
not: it goes before waiting frames at the next line or packet, and is made only once it can be written.
No numpy here.
"""

from __future__ import annotations

import contextlib
import gc
import os
import socket
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Final

from bench.errors import ConfigError
from drivers import portable
from drivers.beat import (
    BEATS,
    FRAMES,
    GAP,
    LEASE,
    RAW,
    RECORD,
    REFUSED,
    WORDS,
    Beat,
    Encoder,
    Frame,
    Schedule,
    WriterSpec,
)  # fmt: skip
from drivers.heartbeat_writers import Writer, open_writer

BACKLOG: Final = 50  # frames that wait here; more stay in the bench's queue
AT_ONCE: Final = 32  # frames written before the clock is looked at again
PACE_S: Final = 0.002  # until the kernel's unsent bytes are looked at again
ORDER_S: Final = 10.0  # for the bench to say what to send
FLUSH_S: Final = 0.2  # for frames that still wait when the bench closes the link

OpenPort = Callable[[list[int]], Writer | None]
"""Descriptors that the bench handed over (none or one) -> the writer on it."""


class Pacemaker:
    """Heartbeats first, frames behind them. `turn` is one round; nothing in it waits."""

    def __init__(self, beat: Beat, writer: Writer | None, words: portable.Words) -> None:
        self._beat, self._schedule, self._words = beat, Schedule(beat), words
        self.writer = writer
        self.backlog: deque[Frame] = deque()
        self.held = False  # something waits for the port to take bytes

    def timeout_s(self, now_ns: int) -> float:
        """How long to wait for descriptors before the next turn: never longer than a period."""
        if self.writer is not None and self.held and not self.writer.full:
            return PACE_S
        if self.writer is None or self.held:
            return self._beat.period_s
        if self.backlog:
            return 0.0
        wait = self._schedule.wait_ns(now_ns, self._words[LEASE])
        return self._beat.period_s if wait is None else wait * 1e-9

    def turn(self, now_ns: int) -> None:
        """Write what is due at this time.

        Raises:
            OSError: the port is lost.
        """
        if self.writer is None:
            self.backlog.clear()
            return
        clear = self._pulse(self.writer, now_ns) and self._frames(self.writer)
        self.held = not (self.writer.tend() and clear)

    def swap(self, writer: Writer | None) -> None:
        """Another port, or none. What waited for the old one is stale."""
        if self.writer is not None:
            with contextlib.suppress(OSError):
                self.writer.close()
        self.writer, self.held = writer, False
        self.backlog.clear()

    def _pulse(self, writer: Writer, now_ns: int) -> bool:
        """Whether no heartbeat waits."""
        if self._schedule.wait_ns(now_ns, self._words[LEASE]) != 0:
            return True
        if not writer.offer(self._beat.frame(self._schedule.count + 1)):
            return False
        self._schedule.sent(now_ns)
        self._words[BEATS], self._words[GAP] = self._schedule.count, self._schedule.longest_gap_ns
        return True

    def _frames(self, writer: Writer) -> bool:
        """Whether the port took what it was offered."""
        for _ in range(min(AT_ONCE, len(self.backlog))):
            frame = self.backlog[0]
            try:
                if not writer.offer(frame):
                    return False
                self._words[FRAMES] += not frame[2] & RAW
            except ValueError:
                self._words[REFUSED] += 1
            self.backlog.popleft()
        return True


class Session:
    """The pipe to the bench, and the loop."""

    def __init__(self, lines: portable.Lines, data: socket.socket, pacemaker: Pacemaker, open_port: OpenPort) -> None:
        self._lines, self._data, self._pacemaker, self._open_port = lines, data, pacemaker, open_port
        self._lines_begun = b""
        self._until: int | None = None  # the bench closes the link: frames go out until then

    def run(self, bench: int) -> None:
        """Until the bench, the process of this id, closes the link or is gone."""
        p = self._pacemaker
        with contextlib.suppress(EOFError):
            while os.getppid() == bench and not self._done(time.monotonic_ns()):
                readable = [self._lines.fileno()]
                if len(p.backlog) < BACKLOG:
                    readable.append(self._data.fileno())
                writable = [p.writer.fileno()] if p.writer is not None and p.held and p.writer.full else []
                ready = portable.wait(readable, writable, p.timeout_s(time.monotonic_ns()))
                if self._lines.fileno() in ready:
                    self._orders()
                if self._data.fileno() in ready:
                    self._take()
                try:
                    p.turn(time.monotonic_ns())
                except OSError as error:
                    p.swap(None)
                    self._tell({"lost": f"the port is unplugged or its other end closed: {error.strerror or error}"})

    def _done(self, now_ns: int) -> bool:
        if self._until is None:
            return False
        p = self._pacemaker
        return now_ns >= self._until or not (p.backlog or p.held or self._take())

    def _take(self) -> bool:
        """One message of frames from the bench."""
        try:
            records = self._data.recv(65536)
        except OSError:
            return False
        for identifier, flags, length, data in RECORD.iter_unpack(records):
            part = data[:length]
            if flags & RAW:  # a heartbeat must not come between the parts of a line
                self._lines_begun += part
                if not part.endswith((b"\r", b"\n")):
                    continue
                part, self._lines_begun = self._lines_begun, b""
            self._pacemaker.backlog.append((identifier, part, flags))
        return bool(records)

    def _orders(self) -> None:
        orders, descriptors = self._lines.receive()
        for order in orders:
            if "close" in order:
                self._until = time.monotonic_ns() + round(FLUSH_S * 1e9)
            elif "port" in order:  # the bench waits for the answer, so the descriptors belong to this order
                self._change_port(descriptors)

    def _change_port(self, descriptors: list[int]) -> None:
        while self._take():  # meant for the old port
            pass
        self._pacemaker.swap(None)  # first: many a bus can be opened only once
        try:
            self._pacemaker.swap(self._open_port(descriptors))
        except (ConfigError, OSError) as error:
            self._tell({"failed": str(error)})
        else:
            self._tell({"port": self._pacemaker.writer is not None})

    def _tell(self, message: dict[str, Any]) -> None:
        with contextlib.suppress(OSError):  # gone, or not listening: the loop finds out by itself
            self._lines.send(message)


def serve(lines: portable.Lines) -> None:
    """Take the orders of a bench: the first line says what to send and where."""
    portable.wait([lines.fileno()], [], ORDER_S)
    (order, *_), (data, words, *port) = lines.receive()
    beat = Beat(**{**order["beat"], "payload": bytes.fromhex(order["beat"]["payload"])})
    spec = WriterSpec(**order["writer"])
    encoder = Encoder(spec)

    def open_port(descriptors: list[int]) -> Writer | None:
        return open_writer(spec, encoder, descriptors)

    try:
        pacemaker = Pacemaker(beat, open_port(port), portable.Words(words, WORDS))
    except (ConfigError, OSError) as error:
        lines.send({"failed": str(error)})
        return
    refused = portable.prefer_this_thread(nice=True)
    gc.collect()
    gc.freeze()
    gc.disable()  # nothing here makes cycles
    lines.send({"ready": True, "refused": refused})
    Session(lines, socket.socket(fileno=data), pacemaker, open_port).run(order["bench"])


if __name__ == "__main__":
    portable.ignore_stop_signals()
    serve(portable.Lines(socket.socket(fileno=0)))
