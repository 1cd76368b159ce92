"""CAN through python-can: any interface that it knows, and our own for SLCAN adapters, opened from a link's URL."""

from __future__ import annotations

import contextlib
import difflib
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import can

from bench.errors import ConfigError, LinkError
from bench.link import LinkStats
from bench.link.frames import ERROR, EXTENDED, FrameBatch, empty_batch
from bench.rigfile import LinkSpec, linkurl
from drivers.canframes import batch_of, messages_of
from drivers.pace import Pace
from drivers.slcan_bus import SlcanBatchBus

MOST = 4096  # messages of one batch
SEND_S = 0.5
SOCKETCAN_BUS_OFF = 0x40  # class of an error frame, linux/can/error.h
HOST_TIME = ("virtual", "slcan", "udp_multicast", "robotell", "iscan", "neousys", "seeedstudio")
"""Interfaces of python-can 4.6 that stamp messages with a host's clock, or send the sender's: nothing of their own."""
SLCAN_OPTIONS = ("bitrate", "data_bitrate", "timestamp", "tty_baudrate")


@dataclass
class CanBus:
    """An open bus: batches in and out, python-can's exceptions turned into ours. `arguments` open it once more."""

    name: str
    bus: can.BusABC
    arguments: Mapping[str, Any]
    now_ns: Callable[[], int]
    brs: bool = False
    stats: LinkStats = field(default_factory=LinkStats)
    _pace: Pace = field(default_factory=Pace)
    _is_off: bool = False

    @property
    def slcan(self) -> SlcanBatchBus | None:
        """The bus, where it is our own interface and so has a byte stream below it."""
        return self.bus if isinstance(self.bus, SlcanBatchBus) else None

    def read(self, timeout_s: float) -> FrameBatch:
        """Frames that came, after waiting for the first no longer than `timeout_s`.

        Raises:
            LinkError: the interface is lost, or the bus is off.
        """
        if self._is_off:
            raise self._bus_off()
        if isinstance(self.bus, SlcanBatchBus):
            batch = self.bus.recv_batch(timeout_s)
            stream = self.bus.stream
            self.stats.malformed, self.stats.refused = stream.malformed, stream.refused
            self.stats.adapter_overruns, self.stats.octets = stream.overruns, self.bus.octets
        else:
            batch = self._drain(timeout_s)
        self.stats.received += len(batch)
        if len(batch):
            self._count_errors(batch)
        elif self._off():
            raise self._bus_off()
        return batch

    def _drain(self, timeout_s: float) -> FrameBatch:
        self._pace.wait()
        messages: list[can.Message] = []
        try:
            message = self.bus.recv(timeout_s)
            while message is not None:
                messages.append(message)
                message = self.bus.recv(0) if len(messages) < MOST else None
        except (can.CanError, OSError, ValueError) as error:
            raise LinkError(f"link {self.name}: the CAN interface is lost: {error}") from error
        if not messages:
            return empty_batch()
        return batch_of(messages, self.now_ns(), own_time=self.arguments["interface"] not in HOST_TIME)

    def _count_errors(self, batch: FrameBatch) -> None:
        errors = batch[batch["flags"] & ERROR != 0]
        self.stats.error_frames += len(errors)
        if self.arguments["interface"] == "socketcan":  # told by the next read: this one's frames are evidence
            self._is_off = bool((errors["id"] & SOCKETCAN_BUS_OFF).any())

    def _off(self) -> bool:
        with contextlib.suppress(can.CanError, NotImplementedError, OSError):
            return self.bus.state is can.BusState.ERROR
        return False

    def _bus_off(self) -> LinkError:
        self.stats.bus_off += 1
        self._is_off = False  # told
        return LinkError(
            f"link {self.name}: the CAN interface reports bus off: too many errors on the bus; check wiring, "
            "termination and bit rates"
        )

    def write(self, batch: FrameBatch) -> None:
        """Send frames, in order.

        Raises:
            LinkError: the interface is lost or takes nothing.
        """
        if isinstance(self.bus, SlcanBatchBus):
            self.bus.send_batch(batch)
        else:
            try:
                for message in messages_of(batch, brs=self.brs):
                    self.bus.send(message, SEND_S)
            except (can.CanError, OSError, ValueError) as error:
                raise LinkError(f"link {self.name}: the CAN interface does not send: {error}") from error
        self.stats.sent += len(batch)

    def cancel(self) -> None:
        """Make a read that waits return at once, where the interface can; others end by their timeout."""
        if isinstance(self.bus, SlcanBatchBus):
            self.bus.port.cancel()

    def close(self) -> None:
        """Release the interface."""
        with contextlib.suppress(can.CanError, OSError):
            self.bus.shutdown()


def open_bus(
    spec: LinkSpec, name: str, identifiers: Sequence[int] = (), now_ns: Callable[[], int] = time.time_ns
) -> CanBus:
    """Open the CAN bus of a link, `slcan:` or `can:`.

    Args:
        spec: URL, bit rates, options.
        name: of the link, for messages.
        identifiers: that shall pass the interface's filters; all when empty or with `filters=off` in the URL. Error
            frames pass whatever they are. SLCAN adapters have no filters, so there all pass and unknown ones are counted.
        now_ns: host clock, UNIX ns.

    Raises:
        ConfigError: it cannot be opened.
    """
    arguments = arguments_of(spec, name, identifiers)
    bus = open_interface(name, arguments, now_ns)
    brs = arguments["fd"] and arguments.get("data_bitrate") not in (None, arguments.get("bitrate"))
    return CanBus(name, bus, arguments, now_ns, brs)


def arguments_of(spec: LinkSpec, name: str, identifiers: Sequence[int] = ()) -> dict[str, Any]:
    """What opens the CAN bus of a link: arguments of `can.Bus`, `open_bus` says which come from where.

    Raises:
        ConfigError: no such interface, or settings that it cannot have.
    """
    url = linkurl.parse(spec.url)
    options = {**{k: _typed(v) for k, v in url.query.items()}, **spec.options}
    options.update({k: int(v) for k in ("bitrate", "data_bitrate") if (v := getattr(spec, k)) is not None})
    fd = bool(options.pop("fd", spec.data_bitrate is not None))
    filters = options.pop("filters", True)
    if url.scheme == "slcan":
        if unknown := sorted(set(options) - set(SLCAN_OPTIONS)):
            expected = ", ".join(SLCAN_OPTIONS)
            raise ConfigError(f"link {name}: SLCAN has no option {', '.join(unknown)}; expected among {expected}")
        if "bitrate" not in options:
            raise ConfigError(f"link {name}: SLCAN needs a bit rate; expected `bitrate` in [links.{name}]")
        return {"interface": "slcan_batch", "channel": url.rest, "fd": fd, **options}
    arguments = {**_interface(name, url.rest), "fd": fd, **options}
    if identifiers and filters not in (False, "off"):
        arguments["can_filters"] = [_filter(i) for i in identifiers]
    return arguments


def open_interface(name: str, arguments: Mapping[str, Any], now_ns: Callable[[], int]) -> can.BusABC:
    """The interface that these arguments open.

    Raises:
        ConfigError: it cannot be opened.
    """
    try:
        if arguments["interface"] == "slcan_batch":
            return SlcanBatchBus(now_ns=now_ns, **{k: v for k, v in arguments.items() if k != "interface"})
        # A can.conf of the user must not change what the rig file says.
        return _with_error_frames(can.Bus(ignore_config=True, **arguments))
    except Exception as error:  # a missing driver or an option that is not theirs: every vendor's module has its own
        if isinstance(error.__cause__, ConfigError):  # our own interface says where by itself
            raise ConfigError(f"link {name}: {error}") from error
        where = f"{arguments['interface']}:{arguments['channel']}"
        raise ConfigError(f"link {name}: the CAN interface {where} cannot be opened: {error}") from error


def _with_error_frames(bus: can.BusABC) -> can.BusABC:
    """python-can's own filters, which all but a few interfaces use, ask error frames for an identifier too; SocketCAN lets
    them pass whatever its filters are, and so it shall be everywhere: they are counted."""
    matches = bus._matches_filters
    setattr(bus, "_matches_filters", lambda message: message.is_error_frame or matches(message))  # noqa: B010
    return bus


def _interface(name: str, rest: str) -> dict[str, Any]:
    interface, colon, channel = rest.partition(":")
    if interface not in can.VALID_INTERFACES:
        close = difflib.get_close_matches(interface, can.VALID_INTERFACES, 1)
        known = f"did you mean {close[0]!r}?" if close else f"expected one of {', '.join(sorted(can.VALID_INTERFACES))}"
        raise ConfigError(f"link {name}: found CAN interface {interface!r}; {known}")
    if not colon or not channel:
        raise ConfigError(f"link {name}: found no channel; expected such as {linkurl.EXAMPLES['can']!r}")
    return {"interface": interface, "channel": channel}


def _filter(identifier: int) -> dict[str, Any]:
    extended = bool(identifier & EXTENDED)
    return {"can_id": identifier & ~EXTENDED, "can_mask": 0x1FFF_FFFF if extended else 0x7FF, "extended": extended}


def _typed(text: str) -> str | int | float | bool:
    """A value of a URL's query as what it looks like."""
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(text)
    return text
