"""Where the heartbeat process writes: a byte stream that it owns, or a second bus of python-can.

No numpy here.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping, Sequence
from typing import Any, Final, Protocol

from bench.errors import ConfigError
from drivers import portable
from drivers.beat import FD, Encoder, Frame, WriterSpec

BUS_SEND_S: Final = 0.002  # how long an interface may take to find room for a frame
BUS_READ: Final = 256  # frames taken from a bus at once


class Writer(Protocol):
    """Where frames go. `full`: wait for `fileno` to be writable."""

    full: bool

    def offer(self, frame: Frame) -> bool:
        """Write a frame if it goes out now; else False, and nothing of it will be written.

        Raises: OSError: the port is lost. ValueError: no such frame exists.
        """

    def tend(self) -> bool:
        """Go on with a line or packet that went out in part; whether nothing is left of it."""

    def fileno(self) -> int: ...
    def close(self) -> None: ...


class PortWriter:
    """One writer of a byte stream; the descriptor is its own."""

    def __init__(self, fileno: int, encoder: Encoder) -> None:
        portable.without_delay(fileno)
        self._fileno, self._encoder = fileno, encoder
        self._limit = portable.unsent_limit(fileno)
        self._rest = b""  # of a line or packet that went out in part
        self.full = False

    def fileno(self) -> int:
        return self._fileno

    def offer(self, frame: Frame) -> bool:
        if not self.tend() or portable.unsent(self._fileno) >= self._limit:
            return False
        unit = self._encoder.encode(frame)
        taken = self._write(unit)
        if taken == 0:
            return False
        self._rest = unit[taken:]
        self._encoder.written()
        return True

    def tend(self) -> bool:
        if self._rest:
            self._rest = self._rest[self._write(self._rest) :]
        return not self._rest

    def _write(self, data: bytes) -> int:
        try:
            taken = os.write(self._fileno, data)
        except BlockingIOError:
            taken = 0
        self.full = taken < len(data)
        return taken

    def close(self) -> None:
        os.close(self._fileno)


class BusWriter:
    """A second bus of python-can, for interfaces that give no byte stream."""

    full = False

    def __init__(self, arguments: Mapping[str, Any], brs: bool) -> None:
        import can

        self._can, self._brs = can, brs
        try:
            self._bus = can.Bus(**arguments)
        except Exception as error:  # every interface has its own
            raise ConfigError(
                f"python-can cannot open {dict(arguments)} a second time, for the heartbeat process: {error}; "
                'where an interface can be opened only once, set heartbeat = "thread" in the link of the rig file'
            ) from error

    def fileno(self) -> int:
        return -1

    def offer(self, frame: Frame) -> bool:
        identifier, payload, flags = frame
        fd = bool(flags & FD)
        message = self._can.Message(arbitration_id=identifier & 0x1FFFFFFF, is_extended_id=bool(identifier >> 31),
                                    data=payload, is_fd=fd, bitrate_switch=fd and self._brs)  # fmt: skip
        try:
            self._bus.send(message, timeout=BUS_SEND_S)
        except self._can.CanError:  # full, or off the bus: the interface may recover by itself
            return False
        return True

    def tend(self) -> bool:
        with contextlib.suppress(self._can.CanError):  # what others send must not fill the interface's queue
            for _ in range(BUS_READ):
                if self._bus.recv(0) is None:
                    break
        return True

    def close(self) -> None:
        self._bus.shutdown()


def open_writer(spec: WriterSpec, encoder: Encoder, descriptors: Sequence[int]) -> Writer | None:
    """The writer that a specification asks for; None for a byte stream without a descriptor.

    Raises:
        ConfigError: python-can cannot open the interface.
    """
    if not spec.bytewise:
        return BusWriter(spec.arguments, spec.brs)
    return PortWriter(descriptors[0], encoder) if descriptors else None
