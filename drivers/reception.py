"""Receptions: transports that are open for listening alone. What they are made of refuses to write.

`open_reception` picks one by the scheme of a link's URL, as `drivers.wires.open_wire` does for links that send.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import can

from bench.errors import ConfigError, LinkError
from bench.link import LinkStats
from bench.link.commandstream import CommandStream
from bench.link.frames import FrameBatch
from bench.link.packetstream import PacketStream
from bench.rigfile import LinkSpec, RigFile, linkurl
from drivers.byteport import BytePort
from drivers.canbus import CanBus, arguments_of, open_interface
from drivers.slcan_reception import SlcanReception
from drivers.wires import open_port, read_packets

LISTEN_ONLY: Mapping[str, Mapping[str, Any]] = {
    "pcan": {"state": can.BusState.PASSIVE}, "systec": {"state": can.BusState.PASSIVE}, "kvaser": {"driver_mode": False},
    "vector": {"listen_only": True}, "nixnet": {"listen_only": True}, "slcan": {"listen_only": True},
    "cantact": {"monitor": True}, "seeedstudio": {"operation_mode": "silent"},
}  # fmt: skip
"""What opens an interface of python-can 4.6 so that it acknowledges nothing. The others offer nothing of the kind."""


class Reception(Protocol):
    """An open transport that has nothing to send with. One thread reads."""

    manner: str
    """How it listens, in words."""
    complaint: str
    """What an adapter said of the bus when it was opened; empty where it said nothing."""

    @property
    def stats(self) -> LinkStats:
        """Counts since it was opened."""
        ...

    def read(self, timeout_s: float) -> FrameBatch:
        """Frames that came, after waiting no longer than that; empty without.

        Raises:
            LinkError: lost, or the bus is off.
        """
        ...

    def cancel(self) -> None:
        """Make a read that waits return."""
        ...

    def close(self) -> None:
        """Release it. Twice is harmless."""
        ...


class MutePort(BytePort):
    """A byte stream that is only read."""

    def write(self, data: bytes) -> None:
        """Refuses.

        Raises:
            LinkError: always.
        """
        raise LinkError(f"port {self.where} is open for listening; nothing is written to it")


class PacketReception:
    """Messages in COBS packets on a byte stream, which is opened and read."""

    complaint = ""

    def __init__(self, port: MutePort, now_ns: Callable[[], int]) -> None:
        self.manner = "the port is read, nothing is written to it"
        self._port, self._now_ns = port, now_ns
        self._stream = PacketStream(joining=True)
        self.stats = LinkStats()

    def read(self, timeout_s: float) -> FrameBatch:
        """As Reception says."""
        return read_packets(self._port.read(timeout_s), self._stream, self._now_ns(), self.stats)

    def cancel(self) -> None:
        """As Reception says."""
        self._port.cancel()

    def close(self) -> None:
        """As Reception says."""
        self._port.close()


class LineReception:
    """A command line that is only read: slow telemetry, where somebody has asked for it. Nothing is asked for."""

    complaint = ""

    def __init__(self, port: MutePort, rig: RigFile, now_ns: Callable[[], int]) -> None:
        self.manner = "the port is read, nothing is written to it; a controller that streams nothing is silent"
        self._port, self._now_ns = port, now_ns
        self._stream = CommandStream(rig)
        self.stats = LinkStats()

    def read(self, timeout_s: float) -> FrameBatch:
        """As Reception says."""
        data = self._port.read(timeout_s)
        batch = self._stream.feed(data, self._now_ns())
        self.stats.received += len(batch)
        self.stats.octets += len(data)
        self.stats.malformed, self.stats.crc_errors = self._stream.counts.dropped, self._stream.counts.damaged
        return batch

    def cancel(self) -> None:
        """As Reception says."""
        self._port.cancel()

    def close(self) -> None:
        """As Reception says."""
        self._port.close()


class CanReception:
    """An interface of python-can whose sending is taken away."""

    complaint = ""

    def __init__(self, bus: CanBus, manner: str) -> None:
        self._bus, self.manner = bus, manner
        setattr(bus.bus, "send", _refuse)  # noqa: B010

    @property
    def stats(self) -> LinkStats:
        """As Reception says."""
        return self._bus.stats

    def read(self, timeout_s: float) -> FrameBatch:
        """As Reception says."""
        return self._bus.read(timeout_s)

    def cancel(self) -> None:
        """As Reception says; a read ends by its timeout."""

    def close(self) -> None:
        """As Reception says."""
        self._bus.close()


def _refuse(*_: Any, **__: Any) -> None:
    raise can.CanOperationError("the interface is open for listening; nothing is sent on it")


def open_reception(
    spec: LinkSpec, name: str, now_ns: Callable[[], int], *, acknowledge: bool = False, rig: RigFile | None = None
) -> Reception:
    """Open the transport of a controller's link for listening.

    Args:
        spec: of the link, from the rig file.
        name: of the link.
        now_ns: host clock, UNIX ns; it stamps frames.
        rig: whose table `commandline` says what a command line's blocks are.
        acknowledge: a CAN adapter acknowledges frames, as on a bus where nobody else does; it still sends none.

    Raises:
        ConfigError: the URL is none of a controller's link, or the port or interface cannot be opened.
    """
    url = linkurl.parse(spec.url)
    if url.scheme == "slcan":
        arguments = arguments_of(spec, name)
        try:
            return SlcanReception(url.rest, arguments, now_ns, acknowledge=acknowledge)
        except ConfigError as error:
            raise ConfigError(f"link {name}: {error}") from error
    if url.scheme == "can":
        return _open_can(arguments_of(spec, name), name, now_ns, acknowledge)
    if url.scheme == "serial":
        return PacketReception(open_port(name, url, MutePort), now_ns)
    if url.scheme == "cli" and rig is not None:
        return LineReception(open_port(name, url, MutePort), rig, now_ns)
    raise ConfigError(
        f"link {name}: found {spec.url!r}, where nothing can be listened to; expected a URL that starts with slcan:, can:, "
        f"serial: or cli:. Next: --link {name}=URL with one that `bench serve` prints, or that of the adapter"
    )


def _open_can(arguments: dict[str, Any], name: str, now_ns: Callable[[], int], acknowledge: bool) -> CanReception:
    interface = arguments["interface"]
    quiet = {} if acknowledge else dict(LISTEN_ONLY.get(interface, {}))
    if quiet:
        manner = "listen-only: the interface acknowledges nothing"
    elif acknowledge:
        manner = "as asked for, the interface acknowledges frames; none is sent"
    else:
        manner = f"python-can has no listen-only for {interface}: it acknowledges frames; none is sent"
    bus = open_interface(name, {**arguments, **quiet}, now_ns)
    return CanReception(CanBus(name, bus, arguments, now_ns), manner)
