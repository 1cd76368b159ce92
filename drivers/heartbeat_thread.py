"""Heartbeats by a thread of the bench, with the interface of `drivers.heartbeat.HeartbeatProcess`."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Final

from bench.errors import LinkError
from bench.link.frames import SENT, FrameBatch, frame
from drivers import portable
from drivers.beat import Beat, Schedule

CHUNK: Final = 16  # frames written between two looks at the clock
END_S: Final = 2.0  # for the thread to end when told so


class HeartbeatThread:
    """Heartbeats by a thread, where only this process reaches the wire.

    Long calls that keep the interpreter busy delay it; where a descriptor exists, HeartbeatProcess is the safe one.
    """

    owns_port = True
    refused = 0

    def __init__(
        self, beat: Beat, write: Callable[[FrameBatch], None], write_bytes: Callable[[bytes], None] | None = None
    ) -> None:
        """`write` and `write_bytes` (for `send_bytes`) raise LinkError when the wire is lost."""
        self._write, self._write_bytes = write, write_bytes
        self._beat, self._schedule = beat, Schedule(beat)
        self._lock = threading.Lock()
        self._renewed = self._frames = 0
        self._closed = threading.Event()
        self.fault: str | None = None
        self.unpreferred = ""
        """As HeartbeatProcess.unpreferred, once it has begun."""
        self._thread = threading.Thread(target=self._run, name="heartbeat", daemon=True)
        self._thread.start()

    def send(self, batch: FrameBatch) -> None:
        """As HeartbeatProcess.send; raises what `write` raises."""
        for at in range(0, len(batch), CHUNK):
            chunk = batch[at : at + CHUNK]
            with self._lock:
                self._open()
                self._pulse()  # a long batch keeps the lock nearly all the time
                self._write(chunk)
                self._frames += len(chunk)

    def send_bytes(self, data: bytes) -> None:
        """As HeartbeatProcess.send_bytes."""
        if self._write_bytes is None:
            raise ValueError(f"{len(data)} bytes: the wire takes frames only")
        with self._lock:
            self._open()
            self._write_bytes(data)

    def renew_lease(self) -> None:
        """As HeartbeatProcess.renew_lease."""
        self._renewed = time.monotonic_ns()

    def lapse(self) -> None:
        """As HeartbeatProcess.lapse."""
        self._renewed = 0

    def replace_port(self, fileno: int | None) -> None:
        """Nothing to do: `write` knows the wire, and every heartbeat tries it again."""

    def counts(self) -> tuple[int, int, int]:
        """As HeartbeatProcess.counts."""
        return self._schedule.count, self._frames, self._schedule.longest_gap_ns

    def close(self) -> None:
        """End the heartbeats. Twice is harmless."""
        self._closed.set()
        self._thread.join(END_S)

    def _open(self) -> None:
        if self._closed.is_set():
            raise LinkError("the link is closed")

    def _run(self) -> None:
        wait_s, self.unpreferred = 0.0, portable.prefer_this_thread()
        while not self._closed.wait(wait_s):
            with self._lock:
                wait_ns = self._pulse()
            wait_s = self._beat.period_s if wait_ns is None else wait_ns * 1e-9

    def _pulse(self) -> int | None:
        """Write the heartbeat if it is due; then the time to the next, None while none goes out."""
        now = time.monotonic_ns()
        wait_ns = self._schedule.wait_ns(now, self._renewed)
        if wait_ns != 0:
            return wait_ns
        identifier, payload, flags = self._beat.frame(self._schedule.count + 1)
        try:
            self._write(frame(identifier, payload, flags=SENT | flags))
        except Exception as error:  # whatever it is, the next heartbeat tries again: a dead thread would tell nobody
            self.fault = str(error) or type(error).__name__
            return None
        self.fault = None
        self._schedule.sent(now)
        return self._schedule.wait_ns(now, self._renewed)
