"""A controller's command line as a wire: messages of the rig's DBC on one side, lines and blocks on the other."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence

from bench.errors import ConfigError, LinkError
from bench.link import LinkStats
from bench.link.codec import places_of
from bench.link.commandstream import CommandStream
from bench.link.frames import FrameBatch
from bench.rigfile import RigFile
from bench.rigfile.commandline import CommandLine
from bench.wire.commandline import Line, Reply, Splitter, read_line, request
from drivers.beat import WriterSpec
from drivers.byteport import BytePort

ANSWER_S = 0.4  # for a line at a rate that may be the wrong one
RATE_TAG = 9999


class CommandLineWire:
    """Implements drivers.wires.Wire on a byte stream."""

    def __init__(self, port: BytePort, rig: RigFile, now_ns: Callable[[], int]) -> None:
        self._port, self._rig, self._now_ns = port, rig, now_ns
        self._stream = CommandStream(rig)
        self._writing = threading.Lock()
        self._say: Callable[[bytes], None] = self._write
        self.stats = LinkStats()
        self._write(self._stream.opening())

    @property
    def simulated(self) -> bool:
        """As Wire says: the reply to IDENTIFY tells."""
        return self._stream.simulated

    def read(self, timeout_s: float) -> FrameBatch:
        """As Wire says."""
        data = self._port.read(timeout_s)
        batch = self._stream.feed(data, self._now_ns())
        if due := self._stream.due():
            self._say(due)
        s, c = self.stats, self._stream.counts
        s.received += len(batch)
        s.octets += len(data)
        s.malformed, s.crc_errors = c.dropped, c.damaged
        return batch

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
        if port.serial is not None and wanted is not None and lines.baudrate_first not in (None, wanted):
            _agree(port, name, lines, wanted)
        return CommandLineWire(port, rig, now_ns)
    except BaseException:
        port.close()
        raise


def _agree(port: BytePort, name: str, lines: CommandLine, wanted: int) -> None:
    """Bring both ends to a rate: that of the last session, or the one of power-up."""
    ask = lines.commands.get("IDENTIFY", "")
    if _answered(port, lines, ask.split()):
        return
    port.serial.baudrate = lines.baudrate_first
    if not _answered(port, lines, lines.baudrate_line.format(baudrate=wanted).split()):
        raise ConfigError(
            f"link {name}: no answer at {wanted} Bd nor at {lines.baudrate_first} Bd, or the rate is refused. Next: is the "
            "controller on, at rest (it changes its rate only then), and the port the right one?"
        )
    port.serial.baudrate = wanted


def _answered(port: BytePort, lines: CommandLine, words: Sequence[str]) -> bool:
    """Whether a line is answered with ok in time; what is no line of its answer is left out."""
    splitter, until = Splitter(), time.monotonic() + ANSWER_S
    try:
        port.write(b"\n\n" + request(RATE_TAG, *words))
        while (left := until - time.monotonic()) > 0:
            for piece in splitter.feed(port.read(left)):
                said = read_line(piece.text, lines.prompt) if isinstance(piece, Line) else None
                if isinstance(said, Reply) and said.tag == RATE_TAG:
                    return said.kind == "ok"
    except LinkError:
        return False
    return False
