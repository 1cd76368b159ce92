"""Byte streams: serial ports and ptys through pyserial, TCP, RFC 2217. The only module that imports pyserial.

Where the system gives a file descriptor to wait on, reads take whatever is there at once; pyserial's own `read` would
cost a system call for each byte or a timeout for each block.
"""

from __future__ import annotations

import contextlib
import errno
import math
import os
import select
import socket
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import serial

from bench.errors import ConfigError, LinkError
from drivers import portfaults
from drivers.pace import Pace

CHUNK = 65536
PTY_CHUNK = 4000  # a pty gives at most 4095 bytes a read: so much means that more is waiting
MOST = 1 << 20  # bytes of one read
CONNECT_S, WRITE_S = 3.0, 1.0
POLL_S = 0.05  # where there is nothing to wait on (RFC 2217) or no way to interrupt a wait
BAUDRATE = 115200  # which USB adapters and ptys do not mind
CLOSED = (OSError, ValueError, TypeError)
"""What a stream raises when it ends: SerialException is an OSError; the others come when it is closed during a call."""


@dataclass
class BytePort:
    """An open byte stream. One thread reads; writes come from one thread at a time; `cancel` may come from any.

    `serial` is pyserial's object, `tcp` a socket: one of them is there.
    """

    where: str
    serial: Any = None
    tcp: socket.socket | None = None
    pace: Pace = field(default_factory=Pace)
    _wake: tuple[socket.socket, socket.socket] = field(default_factory=socket.socketpair)
    _closed: bool = False

    @classmethod
    def open(cls, where: str, *, baudrate: int | None = None, exclusive: bool = True) -> Self:
        """Open a device (`/dev/ttyACM0`, `COM3`), `socket://HOST:PORT` or `rfc2217://HOST:PORT`.

        Raises:
            ConfigError: it is not there, busy, not allowed, or no serial port; the text says which and what to do.
        """
        if where.startswith("socket://"):
            return cls(where, tcp=_connect(where))
        return cls(where, serial=_open_serial(where, baudrate or BAUDRATE, exclusive))

    def __post_init__(self) -> None:
        for end in self._wake:
            end.setblocking(False)

    def fileno(self) -> int | None:
        """The descriptor that another process may write to; None for RFC 2217 and on Windows."""
        if self._closed or sys.platform == "win32":
            return None
        if self.tcp is not None:
            return self.tcp.fileno()
        return int(self.serial.fd) if hasattr(self.serial, "fd") else None

    def read(self, timeout_s: float) -> bytes:
        """Whatever is there, after waiting for it no longer than `timeout_s`; b"" on timeout and after `cancel`.

        Raises:
            LinkError: unplugged, or the other end closed.
        """
        if self._closed:
            raise LinkError(f"port {self.where} is closed")
        source = self.tcp.fileno() if self.tcp is not None else self.fileno()
        if source is None:
            return self._read_blocking(timeout_s)
        self.pace.wait()
        wake = self._wake[0].fileno()
        try:
            ready = _ready([source, wake], [], timeout_s)
            if wake in ready:
                self._calm()
                return b""
            return self._take() if ready else b""
        except CLOSED as error:
            raise portfaults.lost(self.where, error) from error

    def _take(self) -> bytes:
        """What is there. Whatever ends the stream is told by the next call, so that nothing is thrown away."""
        parts: list[bytes] = []
        total, blocked = 0, False
        while total < MOST:
            try:
                part = self.tcp.recv(CHUNK) if self.tcp is not None else os.read(self.serial.fd, CHUNK)
            except BlockingIOError:
                blocked = True
                break
            except OSError:
                if not parts:
                    raise
                break
            if not part:  # the end, or nothing more: a serial port tells them apart by the next wait only
                break
            parts.append(part)
            total += len(part)
            if len(part) < PTY_CHUNK:
                break
        if not parts and not blocked:
            raise OSError("end of the stream")
        return b"".join(parts)

    def _read_blocking(self, timeout_s: float) -> bytes:
        """Without a descriptor: pyserial's read with its fixed short timeout, so that `cancel` is heard."""
        deadline = time.monotonic() + timeout_s
        self.pace.wait()
        try:
            while not self._calm():
                waiting = int(self.serial.in_waiting)
                if data := bytes(self.serial.read(max(1, min(waiting, MOST)))):
                    return data + bytes(self.serial.read(int(self.serial.in_waiting)))
                if time.monotonic() >= deadline:
                    break
        except CLOSED as error:
            raise portfaults.lost(self.where, error) from error
        return b""

    def write(self, data: bytes) -> None:
        """Write all of it.

        Raises:
            LinkError: unplugged, the other end closed, or it takes nothing for a second.
        """
        if self._closed:
            raise LinkError(f"port {self.where} is closed")
        try:
            if self.tcp is None and self.fileno() is None:
                self.serial.write(data)
            else:
                self._write_all(memoryview(data))
        except serial.SerialTimeoutException as error:
            raise portfaults.full(self.where, WRITE_S) from error
        except CLOSED as error:
            raise portfaults.lost(self.where, error) from error

    def _write_all(self, left: memoryview) -> None:
        deadline = time.monotonic() + WRITE_S
        while left:
            try:
                done = self.tcp.send(left) if self.tcp is not None else os.write(self.serial.fd, left)
                left = left[done:]
            except BlockingIOError:
                pass
            if left:
                target = self.tcp.fileno() if self.tcp is not None else self.serial.fd
                if not _ready([], [target], deadline - time.monotonic()):
                    raise portfaults.full(self.where, WRITE_S)

    def cancel(self) -> None:
        """Make a read that waits, or else the next one, return at once."""
        with contextlib.suppress(OSError):
            self._wake[1].send(b"x")

    def _calm(self) -> bool:
        """Take the wake-up calls; True when there were some."""
        try:
            return bool(self._wake[0].recv(4096))
        except BlockingIOError:
            return False

    def close(self) -> None:
        """Release it. Ends the TCP connection and the lock even where another process still holds the descriptor."""
        if self._closed:
            return
        self._closed = True
        if self.tcp is not None:
            with contextlib.suppress(OSError):
                self.tcp.shutdown(socket.SHUT_RDWR)
            self.tcp.close()
        else:
            with contextlib.suppress(Exception):  # a vanished device cannot be unlocked
                self.serial.exclusive = False
            remote = getattr(self.serial, "_socket", None)  # pyserial forgets it open when the server has hung up
            with contextlib.suppress(OSError):
                self.serial.close()
            if remote is not None:
                remote.close()
        for end in self._wake:
            end.close()


def _ready(readable: Sequence[int], writable: Sequence[int], timeout_s: float) -> list[int]:
    """Which descriptors are ready, after waiting no longer than that. Closed ones are: the next call says so."""
    timeout_s = max(0.0, timeout_s)
    if sys.platform != "linux":  # no poll (Windows), or one that does not know serial ports (macOS)
        ready = select.select(readable, writable, [], timeout_s)
        return [*ready[0], *ready[1]]
    poll = select.poll()  # not select, which ends at descriptor 1023
    for number in readable:
        poll.register(number, select.POLLIN)
    for number in writable:
        poll.register(number, select.POLLOUT)
    return [number for number, _ in poll.poll(math.ceil(timeout_s * 1e3))]


def _connect(where: str) -> socket.socket:
    host, _, port = where.removeprefix("socket://").rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    if not host or not port.isascii() or not port.isdigit() or not 0 < int(port) < 65536:
        raise ConfigError(f"port {where!r}: expected socket://HOST:PORT, such as socket://127.0.0.1:28501")
    try:
        tcp = socket.create_connection((host, int(port)), CONNECT_S)
        if tcp.getsockname() == tcp.getpeername():  # a client's own port, given by the system: talking to itself
            tcp.close()
            raise ConnectionRefusedError(errno.ECONNREFUSED, os.strerror(errno.ECONNREFUSED))
    except (OSError, ValueError) as error:  # ValueError: no host name at all
        raise portfaults.not_connected(where, error) from error
    tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    tcp.setblocking(False)
    return tcp


def _open_serial(where: str, baudrate: int, exclusive: bool) -> Any:
    settings: dict[str, Any] = {"baudrate": baudrate, "timeout": POLL_S}
    if not where.startswith("rfc2217://"):  # which knows none; its socket has a timeout of 5 s
        settings["write_timeout"] = WRITE_S
    if "://" not in where:
        settings["exclusive"] = exclusive
    try:
        return serial.serial_for_url(where, **settings)
    except (OSError, ValueError, NotImplementedError) as error:  # SerialException is an OSError
        raise portfaults.not_opened(where, baudrate, error, _devices) from error


def _devices() -> list[str]:
    from serial.tools import list_ports  # slow, and wanted only when something is wrong

    return sorted(str(p.device) for p in list_ports.comports())
