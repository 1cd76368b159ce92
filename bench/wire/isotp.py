"""ISO-TP (ISO 15765-2:2016): payloads longer than a frame, in segments. Normal addressing, CAN and CAN FD.

Both ends are state machines without time and without input or output: the caller moves the frames, keeps the pause
`pause_ns` between the frames that a Sender hands out, and calls `reset` when the other end is silent for too long.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from typing import Final, Literal

from bench.errors import BenchError
from bench.wire.slcan import LENGTHS

PADDING: Final = 0xCC
LARGEST: Final = 1 << 20
"""Longest payload that a Reassembler takes unless told otherwise, bytes."""
WAITS: Final = 16
"""Flow control frames that say "wait" one after the other before a Sender gives up."""

Failure = Literal["malformed", "too-long", "unexpected", "wrong-sequence", "wrong-length"]
FrameLength = Literal[8, 64]

_SINGLE, _FIRST, _CONSECUTIVE, _FLOW = 0, 1, 2, 3
_CONTINUE, _WAIT, _OVERFLOW = 0, 1, 2
_SHORT_LENGTH: Final = 4095
"""The longest payload whose length fits into 12 bits."""


class TransferError(BenchError):
    """The receiver ended the transfer, or does not follow the protocol."""


def segments(payload: bytes, frame_length: FrameLength = 8) -> tuple[bytes, ...]:
    """The payload as frames: one single frame, or a first frame and its consecutive frames (9.6.2 to 9.6.4).

    Args:
        payload: at least one byte.
        frame_length: the longest frame, bytes: 8 for classic CAN, 64 for CAN FD. Frames over 8 bytes are padded to
            a length that CAN FD has; shorter ones are not padded.

    Raises:
        ValueError: the payload is empty or has over 2^32 - 1 bytes.
    """
    size = len(payload)
    if not 0 < size < 1 << 32:
        raise ValueError(f"payload of {size} bytes; ISO-TP carries 1 to 4294967295")
    if size <= 7:
        return (bytes([size]) + payload,)
    if size <= frame_length - 2:
        return (_padded(bytes([0, size]) + payload),)
    first = (_FIRST << 12 | size).to_bytes(2, "big") if size <= _SHORT_LENGTH else b"\x10\x00" + size.to_bytes(4, "big")
    room, step = frame_length - len(first), frame_length - 1
    rest = (
        _padded(bytes([_CONSECUTIVE << 4 | number & 15]) + payload[at : at + step])
        for number, at in enumerate(range(room, size, step), 1)
    )
    return (first + payload[:room], *rest)


def flow_control(block_size: int = 0, st_min: int = 0, status: int = _CONTINUE) -> bytes:
    """A flow control frame (9.6.5): frames until the next one (0: all of them) and the coded pause between them."""
    return bytes([_FLOW << 4 | status, block_size, st_min])


def _padded(content: bytes) -> bytes:
    if len(content) <= 8:
        return content
    return content + bytes([PADDING]) * (LENGTHS[bisect_left(LENGTHS, len(content))] - len(content))


class Sender:
    """One payload on its way: `start()` gives the first frame, `feed()` what each flow control frame releases."""

    def __init__(self, payload: bytes, frame_length: FrameLength = 8) -> None:
        """As `segments`."""
        self._frames = segments(payload, frame_length)
        self._next = 0
        self._waits = 0
        self.pause_ns = 0
        """Least time between consecutive frames, as the receiver asked for."""

    @property
    def done(self) -> bool:
        """Every frame was handed out."""
        return self._next == len(self._frames)

    def start(self) -> bytes:
        """The single or the first frame."""
        self._next = 1
        return self._frames[0]

    def feed(self, payload: bytes) -> tuple[bytes, ...]:
        """The frames to send now, after a frame from the receiver. Frames that are no flow control release nothing.

        Raises:
            TransferError: the receiver has no room, never stops waiting, or sends a status that does not exist.
        """
        if self.done or self._next == 0 or len(payload) < 3 or payload[0] >> 4 != _FLOW:
            return ()
        status, block_size = payload[0] & 15, payload[1]
        if status == _WAIT:
            self._waits += 1
            if self._waits > WAITS:
                raise TransferError(f"ISO-TP: the receiver said wait {self._waits} times; the transfer is given up")
            return ()
        if status != _CONTINUE:
            reason = "has no room for the payload" if status == _OVERFLOW else f"sent flow status {status}, not 0 to 2"
            raise TransferError(f"ISO-TP: the receiver {reason}; the transfer is given up")
        self._waits, self.pause_ns = 0, _pause_ns(payload[2])
        begin = self._next
        self._next = min(begin + block_size, len(self._frames)) if block_size else len(self._frames)
        return self._frames[begin : self._next]


def _pause_ns(st_min: int) -> int:
    """STmin in ns (9.6.5.4): milliseconds, or 0xF1 to 0xF9 for 100 to 900 us; reserved values mean 127 ms."""
    if 0xF1 <= st_min <= 0xF9:
        return (st_min - 0xF0) * 100_000
    return min(st_min, 0x7F) * 1_000_000


@dataclass(frozen=True, slots=True)
class Event:
    """What a frame led to: a complete payload, a flow control frame to send back, a failure; or nothing of these.

    Failures: `malformed` (no such frame; ignored), `unexpected` (a consecutive frame outside a transfer is ignored; a
    single or first frame inside one ends it and is taken), `wrong-sequence` and `wrong-length` (end the transfer),
    `too-long` (the announced payload is over the limit; `send` tells the other end).
    """

    received: bytes | None = None
    send: bytes | None = None
    failure: Failure | None = None


_NOTHING: Final = Event()
_MALFORMED: Final = Event(failure="malformed")


class Reassembler:
    """Puts the payloads of one sender together. Never raises; holds no more than arrived, and never over `limit`."""

    def __init__(self, *, limit: int = LARGEST, block_size: int = 0, st_min: int = 0) -> None:
        """`block_size` and `st_min` go into the flow control frames: 0 asks for everything at once."""
        self._limit, self._block_size, self._go = limit, block_size, flow_control(block_size, st_min)
        self._buffer = bytearray()
        self._size = 0  # announced; 0 while no transfer is under way
        self._frame_length = 0
        self._number = 0  # of the next consecutive frame, from 1
        self.payloads = 0
        """Complete ones."""

    @property
    def receiving(self) -> bool:
        """A transfer is under way."""
        return self._size > 0

    @property
    def held(self) -> int:
        """Bytes of the transfer under way that have arrived."""
        return len(self._buffer)

    def reset(self) -> None:
        """Drop what arrived: the other end is silent for too long, or the link was lost."""
        self._buffer, self._size = bytearray(), 0

    def feed(self, payload: bytes) -> Event:
        """Take one frame's payload, padding included."""
        kind = payload[0] >> 4 if payload else _FLOW + 1
        if kind > _FLOW or len(payload) not in LENGTHS:
            return _MALFORMED
        if kind == _CONSECUTIVE:
            return self._consecutive(payload)
        if kind == _FLOW:  # for the Sender that may share the identifier
            return _NOTHING
        return self._single(payload) if kind == _SINGLE else self._first(payload)

    def _single(self, payload: bytes) -> Event:
        """9.6.2: the length in the first byte in frames up to 8 bytes, in the second one in longer frames."""
        long = len(payload) > 8
        size, start = (payload[1], 2) if long else (payload[0] & 15, 1)
        if size == 0 or start + size > len(payload) or (long and payload[0] != 0):
            return _MALFORMED
        failure = self._interrupted()
        if size > self._limit:
            return Event(failure="too-long")
        self.payloads += 1
        return Event(received=payload[start : start + size], failure=failure)

    def _first(self, payload: bytes) -> Event:
        """9.6.3: 12 bits of length, or 0 and 32 bits; a payload that fits a single frame has no first frame."""
        if len(payload) < 8:
            return _MALFORMED
        size, start = (payload[0] & 15) << 8 | payload[1], 2
        if size == 0:
            size, start = int.from_bytes(payload[2:6], "big"), 6
            if size <= _SHORT_LENGTH:
                return _MALFORMED
        if size <= (7 if len(payload) == 8 else len(payload) - 2):
            return _MALFORMED
        failure = self._interrupted()
        if size > self._limit:
            return Event(send=flow_control(status=_OVERFLOW), failure="too-long")
        self._size, self._frame_length, self._number = size, len(payload), 1
        self._buffer = bytearray(payload[start:])
        return Event(send=self._go, failure=failure)

    def _consecutive(self, payload: bytes) -> Event:
        """9.6.4: in order, each as long as the first frame but for the last one."""
        if not self._size:
            return Event(failure="unexpected")
        if payload[0] & 15 != self._number & 15:
            self.reset()
            return Event(failure="wrong-sequence")
        missing = self._size - len(self._buffer)
        if len(payload) > self._frame_length or len(payload) - 1 < min(missing, self._frame_length - 1):
            self.reset()
            return Event(failure="wrong-length")
        self._buffer += payload[1 : 1 + missing]
        if len(self._buffer) == self._size:
            received = bytes(self._buffer)
            self.reset()
            self.payloads += 1
            return Event(received=received)
        block_ends = self._block_size and self._number % self._block_size == 0
        self._number += 1
        return Event(send=self._go) if block_ends else _NOTHING

    def _interrupted(self) -> Failure | None:
        """A new transfer begins inside another: the other is lost."""
        if not self._size:
            return None
        self.reset()
        return "unexpected"
