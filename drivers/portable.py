"""What differs between operating systems: descriptors passed to a process, bytes unsent, priorities. One module for it.

No numpy here: the heartbeat process imports this module.
"""

from __future__ import annotations

import contextlib
import json
import mmap
import os
import select
import signal
import socket
import stat
import struct
import sys
from collections.abc import Sequence
from typing import Any, Final

if sys.platform != "win32":
    import fcntl
    import termios

CAN_PASS_DESCRIPTORS: Final = hasattr(socket, "AF_UNIX") and hasattr(socket, "send_fds")
"""Whether a port can be shared with another process (not on Windows)."""
SERIAL_LIMIT: Final = 256
SOCKET_LIMIT: Final = 1024


def unsent_limit(fileno: int) -> int:
    """How many bytes may lie unsent in the kernel when one more frame is written.

    A heartbeat waits behind them, and goes out after the host has died. 256 bytes and a line are 34 ms at
    115 200 bit/s, within the 60 ms that a heartbeat of 20 ms may be late. TCP counts bytes not yet acknowledged.
    """
    return SOCKET_LIMIT if stat.S_ISSOCK(os.fstat(fileno).st_mode) else SERIAL_LIMIT


def unsent(fileno: int) -> int:
    """Bytes that the kernel holds unsent; 0 where it does not tell (a pty never does)."""
    try:
        return int(struct.unpack("i", fcntl.ioctl(fileno, termios.TIOCOUTQ, b"\0\0\0\0"))[0])
    except OSError:
        return 0


def prefer_this_thread(nice: bool = False) -> str:
    """Ask for the calling thread to be scheduled before others: real time at the lowest priority; else, with `nice`, a
    better nice value of its process.

    Returns:
        Why the system does not grant real time; "" where it does.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(1))
        return ""
    except (OSError, AttributeError) as error:
        why = error.strerror if isinstance(error, OSError) else "the system knows none"
    if nice:
        with contextlib.suppress(OSError, AttributeError):
            os.nice(-10)
    return why or "refused"


def ignore_stop_signals() -> None:
    """SIGINT, SIGTERM and SIGHUP are the bench's to handle; heartbeats go on while it makes the rig safe."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)


def without_delay(fileno: int) -> None:
    """Nonblocking writes; on TCP, small ones leave at once (Nagle and a late ACK cost 40 ms otherwise)."""
    os.set_blocking(fileno, False)
    if stat.S_ISSOCK(os.fstat(fileno).st_mode):
        with contextlib.suppress(OSError), socket.socket(fileno=os.dup(fileno)) as own:
            own.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


def message_pair(queue_bytes: int) -> tuple[socket.socket, socket.socket]:
    """Two connected sockets that keep messages whole and in order, nonblocking, with a short queue."""
    kind = socket.SOCK_SEQPACKET if sys.platform == "linux" else socket.SOCK_DGRAM
    pair = socket.socketpair(socket.AF_UNIX, kind)
    for end in pair:
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, queue_bytes)
        end.setblocking(False)
    return pair


def wait(readable: Sequence[int], writable: Sequence[int], timeout_s: float) -> set[int]:
    """The descriptors that are ready, or have failed; waits for one of them no longer than `timeout_s`."""
    poll = select.poll()  # not select: a bench may have over 1024 descriptors
    for fileno in readable:
        poll.register(fileno, select.POLLIN)
    for fileno in writable:
        poll.register(fileno, select.POLLOUT)
    return {fileno for fileno, _ in poll.poll(max(0.0, timeout_s) * 1e3)}


class Words:
    """Numbers of 64 bits in memory that two processes share: no queue to fill, no message to be late."""

    def __init__(self, fileno: int, count: int) -> None:
        self._words: memoryview | list[int] = memoryview(mmap.mmap(fileno, 8 * count)).cast("Q")

    def __getitem__(self, index: int) -> int:
        return int(self._words[index])

    def __setitem__(self, index: int, value: int) -> None:
        self._words[index] = value

    def close(self) -> None:
        """Give the memory and its descriptor back; the numbers stay as they are."""
        self._words = list(self._words)


class Lines:
    """JSON lines over a stream socket, with descriptors beside them (SCM_RIGHTS). Never waits."""

    def __init__(self, end: socket.socket) -> None:
        end.setblocking(False)
        self._end, self._rest = end, b""

    def fileno(self) -> int:
        return self._end.fileno()

    def send(self, message: dict[str, Any], descriptors: Sequence[int] = ()) -> None:
        """Raises: OSError: the other end is gone, or has not read for long."""
        line = json.dumps(message).encode() + b"\n"
        if socket.send_fds(self._end, [line], list(descriptors)) < len(line):
            raise BlockingIOError("the other end does not read")

    def receive(self) -> tuple[list[dict[str, Any]], list[int]]:
        """Messages and descriptors that have come.

        Raises:
            EOFError: the other end is closed and everything was read.
        """
        taken: list[int] = []
        data = b""
        while True:
            try:
                data, descriptors, _, _ = socket.recv_fds(self._end, 65536, 4)
            except BlockingIOError:
                ended = False
                break
            except ConnectionError:
                data, descriptors = b"", []
            taken += descriptors
            self._rest += data
            if ended := not data:
                break
        *lines, self._rest = self._rest.split(b"\n")
        if ended and not lines:
            raise EOFError
        return [json.loads(line) for line in lines], taken

    def close(self) -> None:
        self._end.close()
