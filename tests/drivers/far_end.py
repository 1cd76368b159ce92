"""The other end of a byte stream, over a pty or TCP: keeps what came, answers lines, hangs up."""

from __future__ import annotations

import contextlib
import os
import pty
import select
import socket
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager

DEADLINE_S = 20.0
Answer = Callable[[bytes], bytes]


def nothing(_: bytes) -> bytes:
    """The answer of one that only listens."""
    return b""


class FarEnd:
    """Reads in a thread. TCP: one client after the other; `received` is of the present one, `clients` counts them."""

    def __init__(self, tcp: bool = False, answer: Answer = nothing) -> None:
        self.answer = answer
        self.received = b""
        self.clients = 0
        self.reading = threading.Event()
        self.reading.set()
        self._news = threading.Condition()
        self._wake = os.pipe()
        self._ended = False
        self._end: int | None = None
        self._client: socket.socket | None = None
        self._listener: socket.socket | None = None
        self._slave = -1
        if tcp:
            self._listener = socket.create_server(("127.0.0.1", 0))
            self.where = f"socket://127.0.0.1:{self._listener.getsockname()[1]}"
        else:
            self._end, self._slave = pty.openpty()
            tty.setraw(self._slave)
            self.where = os.ttyname(self._slave)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def wait(self, seen: Callable[[FarEnd], bool]) -> None:
        """Until that holds."""
        with self._news:
            assert self._news.wait_for(lambda: seen(self), DEADLINE_S), f"only {self.received[-200:]!r}"

    def wait_for(self, data: bytes) -> None:
        """Until these bytes have come."""
        self.wait(lambda f: data in f.received)

    def lines(self) -> list[bytes]:
        """The whole lines that came."""
        return self.received.split(b"\r")[:-1]

    def write(self, data: bytes) -> None:
        """All of it."""
        while data:
            assert self._end is not None
            data = data[os.write(self._end, data) :]

    def hang_up(self) -> None:
        """Close this connection, or the pty."""
        with self._news, contextlib.suppress(OSError):
            if self._client is not None:
                self._client.shutdown(socket.SHUT_RDWR)  # the thread then reads its end
            elif self._end is not None:
                os.close(self._end)
                self._end = None

    def refuse(self) -> None:
        """Nobody may connect any more."""
        assert self._listener is not None
        self._listener.close()
        self.hang_up()

    def close(self) -> None:
        self._ended = True
        os.write(self._wake[1], b"x")
        self._thread.join(5.0)
        for opened in (self._client, self._listener):
            if opened is not None:
                opened.close()
        master = self._end if self._client is None else None
        for number in (*self._wake, self._slave, master):
            if number is not None and number >= 0:
                os.close(number)

    def _run(self) -> None:
        while not self._ended:
            if self._end is None and self._listener is not None:
                self._accept()
                continue
            sources = [self._wake[0]] if self._end is None else [self._wake[0], self._end]
            try:
                ready, _, _ = select.select(sources if self.reading.is_set() else sources[:1], [], [], 0.05)
            except OSError:  # hung up
                continue
            if self._wake[0] in ready:
                os.read(self._wake[0], 4096)
            elif ready:
                self._take()

    def _accept(self) -> None:
        assert self._listener is not None
        if self._listener.fileno() < 0:
            select.select([self._wake[0]], [], [], 0.05)
            return
        if self._listener in select.select([self._listener, self._wake[0]], [], [], 0.05)[0]:
            self._client, _ = self._listener.accept()
            with self._news:
                self.received, self._end = b"", self._client.fileno()
                self.clients += 1
                self._news.notify_all()

    def _take(self) -> None:
        end = self._end
        try:
            data = os.read(end, 65536) if end is not None else b""
        except OSError:
            data = b""
        if not data:
            with self._news:
                if self._client is not None:
                    self._client.close()
                    self._client = self._end = None
            return
        reply = self.answer(data)
        with self._news:
            self.received += data
            if reply and self._end is not None:
                with contextlib.suppress(OSError):
                    os.write(self._end, reply)
            self._news.notify_all()


@contextmanager
def far_end(tcp: bool = False, answer: Answer = nothing) -> Iterator[FarEnd]:
    """One that is closed at the end."""
    end = FarEnd(tcp, answer)
    try:
        yield end
    finally:
        end.close()


class Adapter:
    """What an SLCAN adapter answers: closed until O, as the Lawicel manual says, so that F is refused before."""

    def __init__(self, status: bytes = b"F00\r", unknown: tuple[bytes, ...] = ()) -> None:
        self.status, self._unknown = status, unknown
        self.opened = False
        self._rest = b""

    def __call__(self, data: bytes) -> bytes:
        *lines, self._rest = (self._rest + data).split(b"\r")
        return b"".join(map(self._line, lines))

    def _line(self, line: bytes) -> bytes:
        if line in self._unknown:
            return b"\a"
        if line == b"V":
            return b"V1013\r"
        if line == b"F":
            return self.status if self.opened else b"\a"
        if line == b"C" and not self.opened:
            return b"\a"
        if line in (b"O", b"C"):
            self.opened = line == b"O"
        return b"z\r" if line[:1] in (b"t", b"d", b"b") else b"\r"


def until(condition: Callable[[], bool], what: str = "") -> None:
    """Until that holds, which something else brings about."""
    deadline = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline, what or "it did not happen"
        threading.Event().wait(0.002)


def descriptors() -> set[str]:
    """What this process has open, without what comes and goes."""
    found = set()
    for name in os.listdir("/proc/self/fd"):
        with contextlib.suppress(OSError):
            target = os.readlink(f"/proc/self/fd/{name}").removesuffix(" (deleted)")  # a pty that was hung up
            found.add(f"{name} {target}")
    return {f for f in found if "/proc/" not in f}
