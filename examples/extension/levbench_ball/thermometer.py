"""Thermometers on a line of text, as instruments that speak SCPI: a kind of link for register devices.

A rig file has `url = "scpi:HOST:PORT"`. A register's address is the channel of the instrument times two, its type f32, its unit
what the instrument answers in: `MEAS:TEMP? (@3)` is asked for address 6, and `296.15` answered.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
from dataclasses import dataclass

from bench.errors import ConfigError, LinkError
from bench.link import LinkStats
from bench.rigfile import LinkSpec, linkurl
from bench.rigfile.registers import RegisterRefused, Table, Words
from drivers.registerline import DeviceKind

TIMEOUT_S = 0.5
ILLEGAL_ADDRESS = 2
LONGEST = 200  # bytes of an answer


class ScpiLine:
    """One connection; one request at a time. A lost one is opened anew by the next request."""

    def __init__(self, name: str, spec: LinkSpec) -> None:
        """Raises ConfigError: the URL is not scpi:HOST:PORT."""
        self._name, self._url = name, spec.url
        self._address = linkurl.parse(spec.url).address
        self.stats = LinkStats()
        self._lock, self._closed = threading.Lock(), False
        self._socket: socket.socket | None = None

    def open(self) -> None:
        """Raises ConfigError: nobody answers there."""
        try:
            with self._lock:
                self._connect()
        except OSError as error:
            raise ConfigError(f"link {self._name}: {self._url}: nobody answers there: {error}. Next: switch the instrument on, "
                              f"or correct [links.{self._name}] url") from error  # fmt: skip

    def close(self) -> None:
        """Release it; a request that waits ends."""
        self._closed = True
        self._hang_up()

    def port(self, unit: int) -> ScpiPort:
        """The instrument; `unit` means nothing to it."""
        return ScpiPort(self)

    def ask(self, question: str) -> str:
        """Raises LinkError: no answer in time."""
        try:
            with self._lock:
                return self._asked(question)
        except OSError as error:
            self._hang_up()
            raise LinkError(f"link {self._name}: {self._url}: no answer to {question!r}: {error}") from error

    def _asked(self, question: str) -> str:
        if self._closed:
            raise OSError("closed")
        there = self._socket or self._connect()
        there.sendall(f"{question}\n".encode())
        self.stats.sent += 1
        answer = b""
        while not answer.endswith(b"\n"):
            piece = there.recv(LONGEST)
            answer += piece
            if not piece or len(answer) > LONGEST:
                raise OSError("it hung up" if not piece else f"an answer of more than {LONGEST} bytes")
        self.stats.received += 1
        return answer.decode("ascii", "replace").strip()

    def _hang_up(self) -> None:
        if (lost := self._socket) is not None:
            with contextlib.suppress(OSError):
                lost.shutdown(socket.SHUT_RDWR)
            lost.close()
        self._socket = None

    def _connect(self) -> socket.socket:
        self._socket = socket.create_connection(self._address, TIMEOUT_S)
        if self.stats.sent:
            self.stats.reconnects += 1
        return self._socket


@dataclass(frozen=True)
class ScpiPort:
    """A `bench.rigfile.registers.RegisterPort` of one instrument."""

    line: ScpiLine

    def read(self, table: Table, address: int, count: int) -> Words:
        """Two words for each channel, a float; raises LinkError, or RegisterRefused of an address that is no channel."""
        if address % 2 or count % 2:
            raise RegisterRefused(ILLEGAL_ADDRESS, f"registers {address} to {address + count - 1}")
        return tuple(word for k in range(count // 2) for word in self._channel(address // 2 + k))

    def write(self, address: int, words: Words) -> None:
        """It takes nothing."""
        raise RegisterRefused(ILLEGAL_ADDRESS, f"register {address}")

    def _channel(self, number: int) -> tuple[int, int]:
        text = self.line.ask(f"MEAS:TEMP? (@{number})")
        try:
            high, low = struct.unpack(">HH", struct.pack(">f", float(text)))
        except (ValueError, OverflowError):
            raise RegisterRefused(ILLEGAL_ADDRESS, f"channel {number}, which answers {text!r}") from None
        return high, low


SCPI = DeviceKind(ScpiLine)
