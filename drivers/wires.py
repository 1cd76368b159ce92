"""Wires: open transports, all with the same face. `open_wire` picks one by the scheme of a link's URL.

A package adds one by the entry point `levbench.links`: its name is the scheme, what it leads to is a `LinkKind`.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

from bench import extensions
from bench.clock import WallClock
from bench.errors import ConfigError, LinkError
from bench.link import LinkStats
from bench.link.frames import FrameBatch
from bench.link.packetstream import PacketStream, encode
from bench.rigfile import LinkSpec, RigFile, linkurl
from drivers.beat import WriterSpec
from drivers.byteport import BytePort
from drivers.canbus import CanBus, open_bus
from drivers.commandlinewire import speak

IN_PROCESS = ("virtual", "serial", "slcan", "seeedstudio", "robotell")
"""CAN interfaces of python-can that another process cannot reach, or that two readers would take bytes from."""


class Wire(Protocol):
    """An open transport: what `LiveLink` needs of it. One thread reads; writes come from any."""

    @property
    def stats(self) -> LinkStats:
        """Counts since it was opened."""
        ...

    @property
    def simulated(self) -> bool:
        """Whether the transport itself says that a simulation is at its other end."""
        ...

    def read(self, timeout_s: float) -> FrameBatch:
        """Frames that came, after waiting no longer than that; empty without.

        Raises:
            LinkError: lost, or the bus is off.
        """
        ...

    def write(self, batch: FrameBatch) -> None:
        """Send frames, in order.

        Raises:
            LinkError: lost, or it takes nothing.
        """
        ...

    def spoken(self, batch: FrameBatch) -> bytes | None:
        """Whole lines of frames for another process that writes; None where that makes its bytes of frames itself."""
        ...

    def writer(self) -> WriterSpec:
        """How another process sends on it; format `none` where none can."""
        ...

    def written_by(self, send_bytes: Callable[[bytes], None]) -> None:
        """Another process is the one writer of the port from now on: what the wire itself has to say goes through
        `send_bytes`, as whole lines."""
        ...

    def cancel(self) -> None:
        """Make a read that waits return."""
        ...

    def close(self) -> None:
        """Release it. Twice is harmless."""
        ...


def read_packets(data: bytes, stream: PacketStream, now_ns: int, stats: LinkStats) -> FrameBatch:
    """The frames that bytes of a packet stream complete, stamped with `now_ns`; `stats` counts on."""
    batch = stream.feed(data, now_ns)
    stats.received += len(batch)
    stats.octets += len(data)
    stats.crc_errors, stats.malformed, stats.packets_lost = stream.crc_errors, stream.malformed, stream.packets_lost
    return batch


class PacketWire:
    """Messages in COBS packets on a byte stream."""

    simulated = False  # a byte stream says nothing by itself

    def __init__(self, port: BytePort, now_ns: Callable[[], int]) -> None:
        self._port, self._now_ns = port, now_ns
        self._stream = PacketStream(joining=True)
        self._sequence = 0
        self._writing = threading.Lock()
        self.stats = LinkStats()

    def read(self, timeout_s: float) -> FrameBatch:
        """As Wire says."""
        return read_packets(self._port.read(timeout_s), self._stream, self._now_ns(), self.stats)

    def write(self, batch: FrameBatch) -> None:
        """As Wire says; a frame that no packet can hold is a LinkError too."""
        with self._writing:
            try:
                data, self._sequence = encode(batch, self._sequence)
            except ValueError as error:
                raise LinkError(f"port {self._port.where}: {error}") from error
            self._port.write(data)
            self.stats.sent += len(batch)

    def spoken(self, batch: FrameBatch) -> bytes | None:
        """As Wire says."""
        return None

    def writer(self) -> WriterSpec:
        """As Wire says."""
        number = self._port.fileno()
        return WriterSpec("none") if number is None else WriterSpec("packet", number)

    def written_by(self, send_bytes: Callable[[bytes], None]) -> None:
        """As Wire says; it says nothing by itself."""

    def cancel(self) -> None:
        """As Wire says."""
        self._port.cancel()

    def close(self) -> None:
        """As Wire says."""
        with self._writing:
            self._port.close()


class CanWire:
    """A CAN bus."""

    def __init__(self, can: CanBus) -> None:
        self._can = can
        self._writing = threading.Lock()

    @property
    def stats(self) -> LinkStats:
        """As Wire says."""
        return self._can.stats

    @property
    def simulated(self) -> bool:
        """As Wire says: SLCAN adapters tell."""
        return self._can.slcan is not None and self._can.slcan.simulated

    def read(self, timeout_s: float) -> FrameBatch:
        """As Wire says."""
        return self._can.read(timeout_s)

    def write(self, batch: FrameBatch) -> None:
        """As Wire says."""
        with self._writing:
            self._can.write(batch)

    def spoken(self, batch: FrameBatch) -> bytes | None:
        """As Wire says."""
        return None

    def writer(self) -> WriterSpec:
        """As Wire says."""
        if (slcan := self._can.slcan) is not None:
            number = slcan.port.fileno()
            return WriterSpec("none") if number is None else WriterSpec("slcan", number, self._can.brs)
        if self._can.arguments["interface"] in IN_PROCESS:
            return WriterSpec("none")
        return WriterSpec("python-can", brs=self._can.brs, arguments={**self._can.arguments, "ignore_config": True})

    def written_by(self, send_bytes: Callable[[bytes], None]) -> None:
        """As Wire says: SLCAN adapters are asked for their status now and then."""
        if (bus := self._can.slcan) is not None:
            bus.ask_through(send_bytes)

    def cancel(self) -> None:
        """As Wire says."""
        self._can.cancel()

    def close(self) -> None:
        """As Wire says."""
        with self._writing:
            self._can.close()


@dataclass(frozen=True, slots=True)
class LinkKind:
    """How a package opens a link of its scheme: of the link's entry in the rig file, its name, the identifiers of the messages
    that the other end sends, and the rig's clock (UNIX ns), which stamps frames. Raises ConfigError where it cannot be."""

    open: Callable[[LinkSpec, str, Sequence[int], Callable[[], int]], Wire]


def link_kind(scheme: str) -> LinkKind | None:
    """What a package brings for a scheme; None where that is ours, or nobody's.

    Raises:
        ConfigError: the scheme is taken twice, or cannot be loaded.
    """
    point = extensions.found(extensions.LINKS, scheme, linkurl.owner(scheme))
    return None if point is None else extensions.load(point, LinkKind)


def open_wire(
    spec: LinkSpec, name: str, identifiers: Sequence[int] = (), now_ns: Callable[[], int] | None = None,
    rig: RigFile | None = None,
) -> Wire:  # fmt: skip
    """Open the transport of a link.

    Args:
        spec: of the link, from the rig file.
        name: of the link.
        identifiers: of the messages that the other end sends: what a CAN interface's filters let pass.
        now_ns: host clock of the rig, UNIX ns; it stamps frames.
        rig: whose table `commandline` says how its messages are said on a command line.

    Raises:
        ConfigError: the URL is none of a controller's link, its scheme has two owners, or the port or interface cannot be
            opened.
    """
    clock = now_ns or WallClock().now_ns
    url = linkurl.parse(spec.url)
    kind = link_kind(url.scheme)
    if url.scheme in ("slcan", "can"):
        return CanWire(open_bus(spec, name, identifiers, clock))
    if url.scheme == "serial":
        return PacketWire(open_port(name, url, BytePort), clock)
    if url.scheme == "cli" and rig is not None:
        return speak(open_port(name, url, BytePort), _baudrate(name, url.query), name, rig, clock)
    if kind is not None:
        return kind.open(spec, name, identifiers, clock)
    raise ConfigError(f"link {name}: found {spec.url!r}; expected a URL that starts with slcan:, can:, serial: or cli:")


P = TypeVar("P", bound=BytePort)


def open_port(name: str, url: linkurl.LinkUrl, kind: type[P]) -> P:
    """The byte stream of a link `serial:` or `cli:`, with the baud rate of its URL.

    Raises:
        ConfigError: it cannot be opened, or the URL has other settings.
    """
    baudrate = _baudrate(name, url.query)
    try:
        return kind.open(url.rest.removeprefix("serial:"), baudrate=baudrate)
    except ConfigError as error:
        raise ConfigError(f"link {name}: {error}") from error


def _baudrate(name: str, query: dict[str, str]) -> int | None:
    text = query.get("baudrate", "")
    if unknown := sorted(set(query) - {"baudrate"}):
        raise ConfigError(f"link {name}: found {', '.join(unknown)} in the URL; expected at most baudrate=N")
    if text and not (text.isascii() and text.isdigit() and int(text)):
        raise ConfigError(f"link {name}: found baudrate={text}; expected a whole number of Bd, such as 3000000")
    return int(text) if text else None
