"""The heartbeat without its port: what it looks like, when it is due, how frames become bytes. No input or output.

The controller lands the rotor when the last heartbeat is older than its watchdog (80 ms by default). A heartbeat says
that the host lives *now*, so none is ever made before it can be written, and none is made up for: after a late wake-up,
a full port or a lapsed lease exactly one goes out at once, and the next one a period later.
No numpy here: the heartbeat process imports this module.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from bench.errors import ConfigError
from bench.wire import commandline, packet, slcan

FD: Final = 2
"""Flag of a frame: CAN FD. The same as in bench.link.frames, which would bring numpy along."""
RAW: Final = 0x80
"""Flag of what is no frame: `data` is whole lines, written as they are."""
RECORD: Final = struct.Struct("<IBB64s")
"""A frame on its way to the heartbeat process: identifier, flags, length, data."""
LEASE, BEATS, FRAMES, GAP, REFUSED, WORDS = range(6)
"""Numbers that bench and heartbeat process share: when the lease was renewed (written by the bench), heartbeats and
frames written, longest gap in ns, frames refused; and how many numbers there are."""

Frame = tuple[int, bytes, int]
"""Identifier, payload, flags."""


@dataclass(frozen=True)
class Beat:
    """A heartbeat message.

    `payload` is its template; `counter` are the places of the bits that count the heartbeats, the least significant first:
    place n is bit n % 8 of byte n // 8, so that a little-endian word at byte 4 is range(32, 48). Without a renewal heartbeats
    end after `lease_s`.
    """

    identifier: int
    payload: bytes
    counter: Sequence[int]
    fd: bool
    period_s: float = 0.02
    lease_s: float = 1.0

    def __post_init__(self) -> None:
        if not self.counter or not all(0 <= at < 8 * len(self.payload) for at in self.counter):
            found = f"at the bits {', '.join(map(str, self.counter))}" if self.counter else "without a bit"
            raise ConfigError(f"heartbeat counter {found}: the payload has {len(self.payload)} bytes")
        if not 0.001 <= self.period_s <= self.lease_s:
            raise ConfigError(f"heartbeat period {self.period_s} s: expected 0.001 s up to the lease, {self.lease_s} s")

    def frame(self, counter: int) -> Frame:
        """The heartbeat with this number, which wraps where its bits end."""
        payload = bytearray(self.payload)
        for n, at in enumerate(self.counter):
            byte, bit = at >> 3, 1 << (at & 7)
            payload[byte] = payload[byte] | bit if counter >> n & 1 else payload[byte] & ~bit
        return self.identifier, bytes(payload), FD if self.fd else 0


@dataclass(frozen=True)
class WriterSpec:
    """How heartbeats reach the wire.

    `slcan`, `lines` and `packet` write to the descriptor `fileno`, `brs` with bit-rate switch; `python-can` opens a second bus
    from `arguments` (of `can.Bus`, JSON); with `none` no other process reaches it. Of `lines`, a command line, `arguments` say
    the line of a heartbeat and the places of its counter's bits in the message.
    """

    format: Literal["slcan", "packet", "lines", "python-can", "none"]
    fileno: int | None = None
    brs: bool = False
    arguments: Mapping[str, Any] = field(default_factory=dict)

    @property
    def bytewise(self) -> bool:
        """Whether it writes to a byte stream, which can have one writer only."""
        return self.format in ("slcan", "packet", "lines")


class Schedule:
    """When the next heartbeat is due. Times are CLOCK_MONOTONIC, ns."""

    def __init__(self, beat: Beat) -> None:
        self._period, self._lease = round(beat.period_s * 1e9), round(beat.lease_s * 1e9)
        self._last: int | None = None
        self.count = 0
        self.longest_gap_ns = 0

    def wait_ns(self, now_ns: int, renewed_ns: int) -> int | None:
        """Time until the next heartbeat is due: 0 when it is, None while no lease is valid.

        `renewed_ns` is when the bench renewed the lease, by its own reading of the clock; 0: never.
        """
        if renewed_ns == 0 or abs(now_ns - renewed_ns) >= self._lease:
            return None
        return 0 if self._last is None else max(0, self._last + self._period - now_ns)

    def sent(self, now_ns: int) -> None:
        """A heartbeat was written. The next one is due a period from now, whatever was missed before."""
        if self._last is not None:
            self.longest_gap_ns = max(self.longest_gap_ns, now_ns - self._last)
        self._last = now_ns
        self.count += 1


class Encoder:
    """Frames as lines or packets. The packets' sequence numbers run on over heartbeats, frames and changes of port."""

    def __init__(self, spec: WriterSpec) -> None:
        self._packets, self._brs = spec.format == "packet", spec.brs
        self._line: str = spec.arguments["heartbeat"] if spec.format == "lines" else ""
        self._places: Sequence[int] = spec.arguments["places"] if self._line else ()
        self._sequence = 0

    def encode(self, frame: Frame) -> bytes:
        """The bytes of one line or packet.

        Raises:
            ValueError: the format knows no such frame.
        """
        identifier, payload, flags = frame
        if flags & RAW:
            return payload
        if self._line:
            count = sum(1 << n for n, at in enumerate(self._places) if payload[at >> 3] >> (at & 7) & 1)
            return commandline.beat(self._line.replace("{counter}", str(count)))
        if self._packets:
            return packet.packet(self._sequence, 0, [(identifier, payload)])
        return slcan.line(identifier, payload, fd=bool(flags & FD), brs=self._brs)

    def written(self) -> None:
        """What was encoded last has gone out, at least its beginning."""
        self._sequence = (self._sequence + 1) & 0xFFFF
