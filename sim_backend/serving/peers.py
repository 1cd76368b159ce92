"""What speaks to one client of an endpoint: bytes in, frames and answers out. No sockets and no time of their own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Protocol

import numpy as np

from bench.link import packetstream, slcanstream
from bench.link.frames import ERROR, FrameBatch, empty_batch
from sim_backend.octets import framed, unframed

LONGEST_REQUEST = 4096


class Sent:
    """Frames that went over the bus, and their encoding, made once for all who hear them.

    Args:
        batch: the frames; error frames among them stand for destroyed ones.
        tick: device tick at which they were sent.
        brs: CAN FD frames switch the bit rate.
    """

    def __init__(self, batch: FrameBatch, tick: int, brs: bool) -> None:
        broken = batch["flags"] & ERROR != 0
        self.errors = int(broken.sum())
        self.batch = batch[~broken] if self.errors else batch
        self.tick, self._brs = tick & 0xFFFFFFFF, brs

    @cached_property
    def lines(self) -> bytes:
        """The frames in SLCAN, without timestamps."""
        return slcanstream.encode(self.batch, brs=self._brs)

    @cached_property
    def stamped(self) -> bytes:
        """The frames in SLCAN with the adapter's milliseconds."""
        stamps = (self.batch["t_ns"] // 1_000_000 % 60_000).tolist()
        texts = self.lines.split(b"\r")
        return b"".join(b"%s%04X\r" % pair for pair in zip(texts, stamps, strict=False))


class Peer(Protocol):
    """One client's counterpart. What it wants to say collects in `answers`."""

    answers: bytearray
    on_bus: bool  # its frames are heard by its fellows on the bus

    def take(self, data: bytes, t_ns: int) -> FrameBatch:
        """Take what the client wrote; returns the frames among it, timed `t_ns`."""
        ...

    def hear(self, sent: Sent) -> None:
        """Put frames of the bus into `answers`."""
        ...


class PacketPeer:
    """The controller's serial port: messages in COBS packets, both ways."""

    on_bus = False

    def __init__(self, corrupt: Callable[[bytes], bytes] | None = None) -> None:
        """`corrupt` may spoil the bytes of packets (an injected fault)."""
        self.answers = bytearray()
        self.stream = packetstream.PacketStream()
        self._corrupt = corrupt
        self._sequence = 0

    def take(self, data: bytes, t_ns: int) -> FrameBatch:
        return self.stream.feed(data, t_ns)

    def hear(self, sent: Sent) -> None:
        data, self._sequence = packetstream.encode(sent.batch, self._sequence, sent.tick)
        self.answers += self._corrupt(data) if self._corrupt is not None else data


class BytesPeer:
    """The controller's serial line as it is: bytes, carried by frames with the identifier BYTES."""

    on_bus = False

    def __init__(self) -> None:
        self.answers = bytearray()

    def take(self, data: bytes, t_ns: int) -> FrameBatch:
        return framed(data, t_ns)

    def hear(self, sent: Sent) -> None:
        self.answers += unframed(sent.batch)


class LinePeer:
    """A request a line, an answer a line."""

    on_bus = False

    def __init__(self, request: Callable[[str], str]) -> None:
        self.answers = bytearray()
        self._request = request
        self._rest = b""
        self._skipping = False

    def take(self, data: bytes, t_ns: int) -> FrameBatch:
        *lines, rest = (self._rest + data).split(b"\n")
        for k, line in enumerate(lines):
            if k == 0 and self._skipping:
                answer = "error the request is too long"
            else:
                answer = self._request(line.decode("utf-8", "replace"))
            self.answers += answer.replace("\n", " ").encode() + b"\n"
        self._skipping = (self._skipping and not lines) or len(rest) > LONGEST_REQUEST
        self._rest = b"" if self._skipping else rest
        return empty_batch()

    def hear(self, sent: Sent) -> None:
        """The operator does not listen to the bus."""


def joined(batches: Sequence[FrameBatch]) -> FrameBatch:
    """Batches as one."""
    filled = [b for b in batches if len(b)]
    if len(filled) > 1:
        return np.concatenate(filled)
    return filled[0] if filled else empty_batch()
