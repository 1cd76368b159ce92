"""SLCAN bytes to frame batches and back. Any split of the bytes gives the same frames."""

from __future__ import annotations

import re
from binascii import hexlify
from struct import Struct
from typing import Final

import numpy as np

from bench.link.frames import ERROR, FD, FRAME, REMOTE, SWITCHED, FrameBatch, empty_batch
from bench.wire.slcan import BEL, CR, EXTENDED, FRAME_LETTERS, LENGTHS, LONGEST_LINE, LOSSES, WRAP_MS, head, parse

REPLIES: Final = 256
"""Lines kept for the caller; older ones are dropped."""
_ROW: Final = Struct("<qqIBB64s")  # one record of FRAME
_WRAP_NS: Final = WRAP_MS * 1_000_000
_REPLY: Final = re.compile(rb"[G-Zg-z][ -~]{0,63}|[CF]")
"""Commands and answers. Hex letters start none but C and F: the tail of a frame that lost its head is no answer."""
_STATUS: Final = re.compile(rb"F([0-9A-Fa-f]{2})")
_REMOTE: Final = tuple(
    re.compile(rb"(r[0-7][0-9A-Fa-f]{2}|R[01][0-9A-Fa-f]{7})[0-8]" + end) for end in (b"", b"[0-9A-Fa-f]{4}")
)
_FLAGS: Final = {(False, False): 0, (True, False): FD, (True, True): FD | SWITCHED}
_ACKS: Final = frozenset((b"", b"z", b"Z"))


def encode(batch: FrameBatch, *, brs: bool) -> bytes:
    """The batch as lines, in order.

    Args:
        batch: frames; those flagged FD become CAN FD lines.
        brs: CAN FD frames switch the bit rate.

    Raises:
        ValueError: an error frame, or a frame with an identifier or a length that no CAN frame has.
    """
    if (batch["flags"] & ERROR).any():
        raise ValueError("an error frame cannot be sent")
    digits = hexlify(batch["data"].tobytes()).upper()
    heads: dict[tuple[int, int, bool], bytes] = {}
    out: list[bytes] = []
    rows = zip(batch["id"].tolist(), batch["length"].tolist(), (batch["flags"] & FD != 0).tolist(), strict=True)
    for at, row in enumerate(rows):
        start = heads.get(row)
        if start is None:
            start = heads[row] = _head(*row, brs=brs)
        out += (start, digits[128 * at : 128 * at + 2 * row[1]], CR)
    return b"".join(out)


def _head(identifier: int, length: int, fd: bool, *, brs: bool) -> bytes:
    if length not in (LENGTHS if fd else LENGTHS[:9]):
        raise ValueError(f"payload of {length} bytes; a {'CAN FD' if fd else 'classic CAN'} frame cannot have it")
    return head(identifier, LENGTHS.index(length), fd=fd, brs=brs)


class SlcanStream:
    """Takes bytes as they come and gives the frames of the lines that they complete. Never raises, whatever comes.

    A line is an acknowledgement (ignored), a data frame, a remote frame (counted: it has no bytes), the answer
    to F, another printable line that starts like a command or an answer (kept in `replies`), or malformed.
    """

    def __init__(self, *, timestamp: bool = False, remotes: bool = False) -> None:
        """
        Args:
            timestamp: the adapter was told Z1; its milliseconds go to `hw_ns`, unwrapped with the help of `t_ns`.
            remotes: remote frames are among those that `feed` gives.
        """
        self._remotes = remotes
        self.malformed = 0
        """Lines that fit nothing."""
        self.refused = 0
        """BEL: the adapter did not take a command or a frame."""
        self.remote = 0
        """Remote frames."""
        self.answered = 0
        """Bytes of lines that are no frames and that the adapter may say: acknowledgements, answers."""
        self.status: int | None = None
        """The last answer to F: bits as in bench.wire.slcan."""
        self.overruns = 0
        """Answers to F that tell of frames the adapter lost: a full queue, in or out, or an overrun."""
        self.replies: list[bytes] = []
        """Other lines, oldest first, at most REPLIES of them; the caller may clear it."""
        self._timestamp = timestamp
        self._rest = b""
        self._clock: tuple[int, int] | None = None  # t_ns and hw_ns of the last frame

    @property
    def pending(self) -> int:
        """Bytes kept of a line that has not ended yet; never more than one over the longest line."""
        return len(self._rest)

    def feed(self, data: bytes, t_ns: int) -> FrameBatch:
        """Frames of the lines that end in `data`, in order.

        Args:
            data: any piece of the stream.
            t_ns: host time of receipt, UNIX ns; every frame gets it.
        """
        if BEL in data:  # it ends a line as CR does; the mark stays to tell them apart
            data = data.replace(BEL, b"\a\r")
        lines = (self._rest + data).split(CR)
        # An endless line costs no memory: one character too many makes it malformed already.
        self._rest = lines.pop()[: LONGEST_LINE + 1]
        rows = []
        for text in lines:
            parsed = parse(text, timestamp=self._timestamp)
            if parsed is None:
                before = self.malformed
                if text not in _ACKS and (row := self._other(text, t_ns)):
                    rows.append(row)
                else:
                    self.answered += (len(text) + (text[-1:] != BEL)) * (self.malformed == before)
                continue
            identifier, payload, fd, ms, brs = parsed
            hw_ns = 0 if ms < 0 else self._unwrapped(ms * 1_000_000, t_ns)
            rows.append(_ROW.pack(t_ns, hw_ns, identifier, _FLAGS[fd, brs], len(payload), payload))
        # A bytearray, because callers may write into the batch.
        return np.frombuffer(bytearray(b"".join(rows)), FRAME) if rows else empty_batch()

    def _other(self, text: bytes, t_ns: int) -> bytes:
        """A line that is no data frame; the record of a remote frame, where they are wanted."""
        if text.endswith(BEL):
            self.refused += 1
            self.malformed += text != BEL
        elif _REMOTE[self._timestamp].fullmatch(text):
            self.remote += 1
            if self._remotes:
                return self._remote_frame(text, t_ns)
        elif found := _STATUS.fullmatch(text):
            self.status = int(found[1], 16)
            self.overruns += bool(self.status & LOSSES)
        elif text[0] not in FRAME_LETTERS and _REPLY.fullmatch(text):
            self.replies.append(text)
            del self.replies[:-REPLIES]
        else:
            self.malformed += 1
        return b""

    def _remote_frame(self, text: bytes, t_ns: int) -> bytes:
        digits = 8 if text[:1] == b"R" else 3
        identifier = int(text[1 : 1 + digits], 16) | (EXTENDED if digits == 8 else 0)
        hw_ns = self._unwrapped(int(text[2 + digits :], 16) * 1_000_000, t_ns) if self._timestamp else 0
        return _ROW.pack(t_ns, hw_ns, identifier, REMOTE, int(text[1 + digits : 2 + digits], 16), b"")

    def _unwrapped(self, ns: int, t_ns: int) -> int:
        """The adapter's time that fits the host time passed since the last frame best; starts at 60 s, never 0."""
        last_t, last_hw = self._clock or (t_ns, ns + _WRAP_NS)
        due = last_hw + t_ns - last_t
        hw_ns = due + (ns - due + _WRAP_NS // 2) % _WRAP_NS - _WRAP_NS // 2
        self._clock = (t_ns, hw_ns)
        return hw_ns
