"""A controller's command line as a wire: messages of the rig's DBC on one side, lines and blocks on the other."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from bench.errors import ConfigError
from bench.link import LinkStats
from bench.link.codec import places_of
from bench.link.commandstream import CommandStream
from bench.link.frames import FrameBatch
from bench.rigfile import RigFile
from drivers import linerate
from drivers.beat import WriterSpec
from drivers.byteport import BytePort


class CommandLineWire:
    """Implements drivers.wires.Wire on a byte stream; `rate` Bd was agreed on with a controller that begins at another."""

    def __init__(self, port: BytePort, rig: RigFile, now_ns: Callable[[], int], rate: int | None = None) -> None:
        self._port, self._rig, self._now_ns = port, rig, now_ns
        self._stream = CommandStream(rig)
        self._writing = threading.Lock()
        self._told = 0
        self._say: Callable[[bytes], None] = self._write
        self.stats = LinkStats()
        lines = rig.commandline
        self._rate = None if rate is None or lines is None else linerate.Rate(self._at, lines, rate, time.monotonic())
        self._write(self._stream.opening())

    @property
    def simulated(self) -> bool:
        """As Wire says: the reply to IDENTIFY tells."""
        return self._stream.simulated

    def read(self, timeout_s: float) -> FrameBatch:
        """As Wire says."""
        data = self._port.read(timeout_s)
        batch = self._stream.feed(data, self._now_ns())
        s, c = self.stats, self._stream.counts
        if self._rate is not None:
            self._look(self._rate, data, bool(len(batch)) or c.told != self._told)
        if due := self._stream.due():
            self._say(due)
        s.received += len(batch)
        s.octets += len(data)
        s.malformed, s.crc_errors = c.dropped, c.damaged
        return batch

    def _look(self, rate: linerate.Rate, data: bytes, understood: bool) -> None:
        """See whether both ends are at one rate, and go on with a controller that had to be brought back to it."""
        found, self._told = rate.found, self._stream.counts.told
        if due := rate.look(data, understood, time.monotonic()):
            self._say(due)
        if rate.found > found:
            self._stream.begin_anew()
            self.stats.reconnects += 1

    def _at(self, rate: int) -> None:
        self._port.serial.baudrate = rate

    def write(self, batch: FrameBatch) -> None:
        """As Wire says."""
        self._write(self._stream.encode(batch))
        self.stats.sent += len(batch)

    def spoken(self, batch: FrameBatch) -> bytes | None:
        """As Wire says."""
        self.stats.sent += len(batch)
        return self._stream.encode(batch)

    def writer(self) -> WriterSpec:
        """As Wire says."""
        number = self._port.fileno()
        if number is None:
            return WriterSpec("none")
        b = self._rig.binding
        places = places_of(self._rig.messages[b.heartbeat].signal(b.heartbeat_counter))
        assert self._rig.commandline is not None
        return WriterSpec(
            "lines", number, arguments={"heartbeat": self._rig.commandline.heartbeat, "places": [*places]}
        )

    def written_by(self, send_bytes: Callable[[bytes], None]) -> None:
        """As Wire says: the opening is said again after a restart."""
        self._say = send_bytes

    def cancel(self) -> None:
        """As Wire says."""
        self._port.cancel()

    def close(self) -> None:
        """As Wire says."""
        with self._writing:
            self._port.close()

    def _write(self, data: bytes) -> None:
        with self._writing:
            self._port.write(data)


def speak(port: BytePort, wanted: int | None, name: str, rig: RigFile, now_ns: Callable[[], int]) -> CommandLineWire:
    """The wire on an open port, which is its own from now on; a serial port whose controller starts at another rate than is
    `wanted` is brought to that.

    Raises:
        ConfigError: the rig file has no table `commandline`, or nobody answers at either rate.
    """
    lines = rig.commandline
    try:
        if lines is None:
            raise ConfigError(f"link {name}: a cli: link needs the table [commandline] in the rig file; found none")
        if port.serial is None or wanted is None or lines.baudrate_first in (None, wanted):
            return CommandLineWire(port, rig, now_ns)
        linerate.agree(port, name, lines, wanted)
        return CommandLineWire(port, rig, now_ns, wanted)
    except BaseException:
        port.close()
        raise
