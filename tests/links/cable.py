"""A serial cable that can be pulled: a pty for the bench whose bytes go to and from a TCP endpoint of a served rig."""

from __future__ import annotations

import os
import select
import socket
import threading
import tty
from contextlib import suppress
from types import TracebackType


class Cable:
    """`path` is what the bench opens as its port. `pull` makes it vanish, as an unplugged adapter does."""

    def __init__(self, endpoint: str) -> None:
        host, _, port = endpoint.rpartition("//")[2].rpartition(":")
        self._far = socket.create_connection((host, int(port)))
        self._near, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(self._near, False)
        self.path = os.ttyname(slave)
        self._slave = slave  # stays open until the bench has opened it, or else the pty would hang up
        self.used = threading.Event()  # the bench has sent something
        self._lock, self._open = threading.Lock(), True
        self._thread = threading.Thread(target=self._carry)
        self._thread.start()

    def _carry(self) -> None:
        with suppress(OSError, ValueError):
            while True:
                ready, _, _ = select.select([self._near, self._far], [], [], 0.1)
                with self._lock:
                    if not self._open:
                        return
                    if self._near in ready:
                        self._far.sendall(os.read(self._near, 65536))
                        self.used.set()
                    if self._far in ready:
                        data = self._far.recv(65536)
                        if not data:
                            return
                        self._pass_on(data)

    def _pass_on(self, data: bytes) -> None:
        """To the bench; what it does not take in a second is lost, as it is once it has died."""
        while data and select.select([], [self._near], [], 1.0)[1]:
            with suppress(BlockingIOError):
                data = data[os.write(self._near, data) :]

    def pull(self) -> None:
        """Unplug it. Twice is harmless."""
        with self._lock:
            if not self._open:
                return
            self._open = False
            os.close(self._slave)
            os.close(self._near)
            self._far.close()
        self._thread.join()

    def __enter__(self) -> Cable:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.pull()
