"""Pseudo terminals as serial ports: the one module of the simulated backend that touches ptys. POSIX only."""

from __future__ import annotations

import os
import select
from contextlib import suppress

AVAILABLE = hasattr(os, "openpty")


class Pty:
    """The device's end of a pseudo terminal in raw mode; a `Stream`. Clients open `path` as a serial port."""

    def __init__(self) -> None:
        import tty

        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.path = os.ttyname(slave)
        os.close(slave)
        os.set_blocking(self._master, False)
        self._poll = select.poll()
        self._poll.register(self._master, 0)  # hang-up is told without being asked for

    def fileno(self) -> int:
        return self._master

    @property
    def in_use(self) -> bool:
        """Whether somebody has it open. Without anybody a selector would report it all the time."""
        return not self._poll.poll(0)

    def forget(self) -> None:
        """Throw away what the last client has not read, lest the next one gets it."""
        import termios

        with suppress(OSError, termios.error):  # the next one may be there already, and exclusively
            slave = os.open(self.path, os.O_RDWR | os.O_NOCTTY)
            try:
                termios.tcflush(slave, termios.TCIFLUSH)
            finally:
                os.close(slave)

    def read(self, count: int) -> bytes | None:
        try:
            return os.read(self._master, count)
        except BlockingIOError:
            return None

    def write(self, data: bytes) -> int:
        return os.write(self._master, data)

    def close(self) -> None:
        """The port is gone, as when a cable is pulled."""
        os.close(self._master)
