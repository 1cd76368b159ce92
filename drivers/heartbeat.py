"""Heartbeats from the bench's side: a process that sends them, or a thread where only this process reaches the wire.

Heartbeats run while the bench renews their lease; before the first renewal there are none.
"""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np

from bench.errors import ConfigError, LinkError
from bench.link.frames import FrameBatch
from drivers import portable
from drivers.beat import BEATS, FRAMES, GAP, LEASE, RAW, RECORD, REFUSED, WORDS, Beat, Encoder, WriterSpec
from drivers.heartbeat_thread import HeartbeatThread

__all__ = ["Beat", "HeartbeatProcess", "HeartbeatThread", "WriterSpec"]

START_S: Final = 15.0  # for a Python to start on a busy machine
SEND_S: Final = 0.5  # for a port to take bytes again
END_S: Final = 2.0  # for the process to end when told so
CHUNK: Final = 50  # frames in one message to the process
QUEUE_BYTES: Final = 32768  # between bench and process: a few hundred frames
COMPACT: Final = np.dtype([("id", "<u4"), ("flags", "u1"), ("length", "u1"), ("data", "u1", (64,))])
assert COMPACT.itemsize == RECORD.size
ROOT: Final = Path(__file__).resolve().parent.parent


class HeartbeatProcess:
    """Heartbeats by a process of their own, which is also the one writer of a byte stream."""

    def __init__(self, beat: Beat, writer: WriterSpec) -> None:
        """Start it.

        Raises:
            ConfigError: no other process can reach the wire, the wire knows no such heartbeat, or the process cannot
                start.
        """
        _check(beat, writer)
        self.owns_port = writer.bytewise
        """Whether it is the one writer of the wire: frames must then go through `send`."""
        self._takes_lines = writer.format in ("slcan", "lines")
        self._lock = threading.Lock()
        self._fault: str | None = None
        self.unpreferred = ""
        """Why the system does not grant it real-time priority; "" where it does."""
        self._closed = False
        self._process: subprocess.Popen[bytes] | None = None
        self._data, theirs = portable.message_pair(QUEUE_BYTES)
        pipe, standard_input = socket.socketpair()
        self._lines = portable.Lines(pipe)
        with theirs, tempfile.TemporaryFile() as page:
            page.truncate(8 * WORDS)
            self._words = portable.Words(page.fileno(), WORDS)
            port = [] if writer.fileno is None else [writer.fileno]
            try:
                self._process = _spawn(standard_input)
                self._lines.send(_order(beat, writer), [theirs.fileno(), page.fileno(), *port])
                self._answer("ready", START_S)
            except (LinkError, OSError) as error:
                self.close()
                raise ConfigError(f"the heartbeat process does not start: {error}") from None
            except BaseException:
                self.close()
                raise

    @property
    def fault(self) -> str | None:
        """Why heartbeats do not go out although they should, or None."""
        with self._lock:
            try:
                self._read()
            except LinkError as error:
                return str(error)
            return self._fault

    def send(self, batch: FrameBatch) -> None:
        """Write frames, in order.

        Raises:
            LinkError: the process is gone, its port is lost or takes nothing for half a second.
        """
        records = np.empty(len(batch), COMPACT)
        for name in COMPACT.names or ():
            records[name] = batch[name]
        self._send(records.tobytes())

    def send_bytes(self, data: bytes) -> None:
        """Write whole lines that are no frames (a request for an SLCAN adapter's status, a command line), in order with the
        frames.

        Raises:
            LinkError: as `send`.
            ValueError: no whole lines, or the port takes none.
        """
        if not self._takes_lines or not data.endswith((b"\r", b"\n")):
            raise ValueError(f"{data[-20:]!r}: expected whole lines, for a port that takes lines")
        parts = [data[k : k + 64] for k in range(0, len(data), 64)]
        self._send(b"".join(RECORD.pack(0, RAW, len(part), part) for part in parts))

    def renew_lease(self) -> None:
        """Heartbeats go on for another lease from now. Never waits."""
        self._words[LEASE] = time.monotonic_ns()

    def lapse(self) -> None:
        """No heartbeat from now on, until the lease is renewed."""
        self._words[LEASE] = 0

    def replace_port(self, fileno: int | None) -> None:
        """Go on at another descriptor; frames that waited for the old one are dropped.

        None lets go of the port: nothing is written until there is a new one. A bus of python-can is opened anew.

        Raises:
            LinkError: the process is gone, or cannot open the bus.
        """
        with self._lock:
            self._read()
            try:
                self._lines.send({"port": True}, [] if fileno is None else [fileno])
            except OSError as error:
                raise LinkError(f"the heartbeat process does not take the new port: {error}") from None
            self._answer("port", END_S)

    def counts(self) -> tuple[int, int, int]:
        """Heartbeats and frames written, and the longest time between two heartbeats, ns (pauses included)."""
        return self._words[BEATS], self._words[FRAMES], self._words[GAP]

    @property
    def refused(self) -> int:
        """Frames that cannot exist in the port's format, and were left out."""
        return self._words[REFUSED]

    def close(self) -> None:
        """Write what waits, end the heartbeats and the process. Twice is harmless."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
            try:
                if self._process is not None:
                    _end(self._process, self._lines)
            finally:
                self._lines.close()
                self._data.close()
                self._words.close()

    def _send(self, records: bytes) -> None:
        size = CHUNK * RECORD.size
        with self._lock:
            for at in range(0, len(records), size):
                self._queue(records[at : at + size])

    def _queue(self, records: bytes) -> None:
        deadline = time.monotonic() + SEND_S
        while True:
            self._read()
            if self._fault is not None:
                raise LinkError(f"nothing can be sent: {self._fault}")
            try:
                self._data.send(records)
                return
            except BlockingIOError:
                left = deadline - time.monotonic()
            except OSError as error:
                raise LinkError(f"the heartbeat process is gone: {error}") from None
            if left <= 0:
                raise LinkError(f"the port has taken no bytes for {SEND_S} s: does its other end read?")
            portable.wait([self._lines.fileno()], [self._data.fileno()], left)

    def _read(self) -> list[dict[str, Any]]:
        """What the process has told since the last look. Raises LinkError when it has ended."""
        if self._closed:
            raise LinkError("the link is closed")
        try:
            messages, _ = self._lines.receive()
        except EOFError:
            raise LinkError("the heartbeat process has ended; what it said is on standard error") from None
        for message in messages:
            if "port" in message:
                self._fault = None if message["port"] else "the port was given back"
            self._fault = message.get("failed") or message.get("lost") or self._fault
        return messages

    def _answer(self, key: str, timeout_s: float) -> None:
        """Wait for the line that has this key."""
        deadline = time.monotonic() + timeout_s
        while (left := deadline - time.monotonic()) > 0:
            for message in self._read():
                if "failed" in message:
                    raise LinkError(message["failed"])
                if key in message:
                    self.unpreferred = message.get("refused", self.unpreferred)
                    return
            portable.wait([self._lines.fileno()], [], left)
        raise LinkError(f"the heartbeat process does not answer within {timeout_s} s")


def _check(beat: Beat, writer: WriterSpec) -> None:
    thread = 'set heartbeat = "thread" in the link of the rig file'
    if not portable.CAN_PASS_DESCRIPTORS:
        raise ConfigError(f'heartbeat = "process": this system cannot share a port; {thread}')
    if writer.format == "none" or (writer.bytewise and writer.fileno is None):
        raise ConfigError(f'heartbeat = "process": no other process can reach this link\'s wire; {thread}')
    if writer.bytewise:
        try:
            Encoder(writer).encode(beat.frame(0))
        except ValueError as error:
            raise ConfigError(f"heartbeat: {writer.format} knows no such frame: {error}") from None


def _order(beat: Beat, writer: WriterSpec) -> dict[str, Any]:
    """The first line to the process."""
    return {
        "bench": os.getpid(),
        "beat": {**asdict(beat), "payload": beat.payload.hex(), "counter": list(beat.counter)},
        "writer": {**asdict(writer), "arguments": dict(writer.arguments)},
    }


def _spawn(standard_input: socket.socket) -> subprocess.Popen[bytes]:
    """The process, in a session of its own: no signal of the terminal reaches it. Takes the socket over."""
    code = [sys.executable, "-P", "-m", "drivers.heartbeat_process"]
    path = os.pathsep.join(p for p in (str(ROOT), os.environ.get("PYTHONPATH", "")) if p)
    with standard_input:
        return subprocess.Popen(code, stdin=standard_input.fileno(), stdout=subprocess.DEVNULL, start_new_session=True,
                                env={**os.environ, "PYTHONPATH": path})  # fmt: skip


def _end(process: subprocess.Popen[bytes], lines: portable.Lines) -> None:
    with contextlib.suppress(OSError):
        lines.send({"close": True})
    try:
        process.wait(END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
