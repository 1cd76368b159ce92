"""One client of an endpoint: a nonblocking byte stream, its peer, and output that waits, bounded."""

from __future__ import annotations

from typing import Protocol

from bench.link.frames import FrameBatch, empty_batch
from sim_backend.serving.peers import Peer, Sent

READ_BYTES = 16_384  # at most so much of one client in a slice: a flood must not hold up the bench time
BACKLOG_BYTES = 262_144  # about two seconds of telemetry in SLCAN


class Stream(Protocol):
    """A nonblocking byte stream. Both calls raise OSError when it is lost."""

    def fileno(self) -> int: ...

    def read(self, count: int) -> bytes | None:
        """What came; None when nothing did. Empty: the other end closed."""
        ...

    def write(self, data: bytes) -> int:
        """How much was taken."""
        ...


class Connection:
    """A client. `closed` says that its end is gone; `dropped` counts frames it did not read in time."""

    def __init__(self, stream: Stream, peer: Peer) -> None:
        self.stream, self.peer = stream, peer
        self.closed = False
        self.dropped = 0
        self._backlog = b""

    def receive(self, t_ns: int) -> FrameBatch:
        """Take what the client wrote."""
        try:
            data = self.stream.read(READ_BYTES)
        except OSError:
            data = b""
        if data is None:
            return empty_batch()
        self.closed = not data
        return self.peer.take(data, t_ns) if data else empty_batch()

    def hear(self, sent: Sent) -> None:
        """Offer frames of the bus. A client that does not read loses them, whole."""
        if len(self._backlog) < BACKLOG_BYTES:
            self.peer.hear(sent)
        else:
            self.dropped += len(sent.batch)

    def flush(self) -> None:
        """Write what waits, as far as the client takes it."""
        answers = self.peer.answers
        if answers:
            if len(self._backlog) < BACKLOG_BYTES:  # else a client that asks but does not read
                self._backlog += answers
            answers.clear()
        if self._backlog:
            try:
                taken = self.stream.write(self._backlog)
            except BlockingIOError:
                return
            except OSError:
                self.closed = True
                return
            self._backlog = self._backlog[taken:]
