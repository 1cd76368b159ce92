"""Between a serial byte stream and frame batches, in packets of `bench.wire.packet`.

COBS and CRC are C calls once a packet; the messages of all packets of a read are then gathered at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from bench.link.frames import ERROR, FD, FRAME, FrameBatch, empty_batch
from bench.wire import packet
from bench.wire.packet import Malformed, WrongCrc


def encode(batch: FrameBatch, sequence: int, tick: int = 0) -> tuple[bytes, int]:
    """Frames as packets, as few as their limit of content allows, in order.

    Args:
        batch: frames with 11-bit identifiers.
        sequence: of the first packet.
        tick: device tick of all packets; 0 from the host.

    Returns:
        The bytes to write and the sequence number of the packet that comes next.

    Raises:
        ValueError: an error frame, an identifier over 11 bits, or a number out of range.
    """
    if (batch["flags"] & ERROR).any():
        raise ValueError("an error frame cannot be sent in a packet")
    if (batch["length"] > packet.PAYLOAD_LIMIT).any():
        raise ValueError(f"a frame of {batch['length'].max()} bytes; expected at most {packet.PAYLOAD_LIMIT}")
    data, width = batch["data"].tobytes(), batch["data"].shape[1]
    out: list[bytes] = []
    messages: list[tuple[int, bytes]] = []
    size = packet.HEADER.size
    for row, (identifier, length) in enumerate(zip(batch["id"].tolist(), batch["length"].tolist(), strict=True)):
        if size + packet.MESSAGE.size + length > packet.LIMIT:
            out.append(packet.packet(sequence, tick, messages))
            sequence, messages, size = (sequence + 1) & 0xFFFF, [], packet.HEADER.size
        messages.append((identifier, data[row * width : row * width + length]))
        size += packet.MESSAGE.size + length
    if messages:
        out.append(packet.packet(sequence, tick, messages))
        sequence = (sequence + 1) & 0xFFFF
    return b"".join(out), sequence


@dataclass
class PacketStream:
    """Takes one direction of a serial link apart. How the bytes are cut into reads changes neither frames nor counts.

    What fails is dropped whole, up to the next delimiter. Empty packets (two delimiters in a row) are not counted: a
    sender may open with a delimiter to end whatever noise came before.
    """

    joining: bool = False
    """The sender may be in the middle of a packet: what stands before the first delimiter need not be one."""
    packets: int = 0  # taken
    crc_errors: int = 0
    malformed: int = 0
    packets_lost: int = 0  # by sequence number, so that those dropped above are among them
    _pending: bytes = field(default=b"", repr=False)
    _skipping: bool = field(default=False, repr=False)  # the rest of a packet that is too long already
    _last: tuple[int, int] | None = field(default=None, repr=False)  # sequence and tick

    @property
    def pending(self) -> int:
        """Bytes kept of a packet that has not ended yet; never more than the longest packet."""
        return len(self._pending)

    def feed(self, data: bytes, t_ns: int) -> FrameBatch:
        """The frames of all packets that end in these bytes, in order, flagged FD.

        Args:
            data: as they were read; any number of bytes.
            t_ns: host time of the read, UNIX ns; all these frames get it.
        """
        *ended, rest = (self._pending + data).split(b"\0")
        if self._skipping and ended:
            del ended[0]
            self._skipping = False
        contents: list[bytes] = []
        places: list[Sequence[int]] = []
        for encoded in ended:
            self._take(encoded, contents, places)
        if not self._skipping and len(rest) > packet.ENCODED_LIMIT:
            self.malformed += 1
            self._skipping, self.joining = True, False
        self._pending = b"" if self._skipping else rest
        return _gathered(contents, places, t_ns) if contents else empty_batch()

    def _take(self, encoded: bytes, contents: list[bytes], places: list[Sequence[int]]) -> None:
        """Check one packet and note where its messages are, or count what is wrong with it."""
        forgiven, self.joining = self.joining and len(encoded) <= packet.ENCODED_LIMIT, False
        if not encoded:
            return
        try:
            content = packet.content_of(encoded)
            found = packet.places(content)
        except WrongCrc:
            self.crc_errors += not forgiven
            return
        except Malformed:
            self.malformed += not forgiven
            return
        contents.append(content)
        places.append(found)
        self.packets += 1
        _, sequence, tick = packet.HEADER.unpack_from(content)
        if self._last is not None:
            self.packets_lost += _lost(*self._last, sequence, tick)
        self._last = sequence, tick


def _lost(last_sequence: int, last_tick: int, sequence: int, tick: int) -> int:
    """Packets missing between two. A tick that went back is a restart of the sender. A tick that stands still tells
    nothing (the host sends 0), so there a sequence that went back, or begins at 0 again, is one."""
    step = (sequence - last_sequence) & 0xFFFF
    moved = ((tick - last_tick + (1 << 31)) & 0xFFFFFFFF) - (1 << 31)
    restarted = moved < 0 or (moved == 0 and (sequence == 0 or step >= 0x8000))
    return 0 if restarted or not step else step - 1


def _gathered(contents: list[bytes], places: list[Sequence[int]], t_ns: int) -> FrameBatch:
    """The messages of several contents as one batch: one gather for each payload length."""
    counts = np.array([len(p) for p in places])
    sizes = np.array([len(c) for c in contents])
    starts = np.fromiter(chain.from_iterable(places), np.intp, int(counts.sum()))
    starts += np.repeat(np.cumsum(sizes) - sizes, counts)
    joined = b"".join(contents)
    octets = np.frombuffer(joined, np.uint8)
    batch = np.zeros(len(starts), FRAME)
    batch["t_ns"], batch["flags"] = t_ns, FD
    batch["id"] = octets[starts] | octets[starts + 1].astype(np.uint32) << 8
    lengths = batch["length"] = octets[starts + 2]
    payloads = starts + packet.MESSAGE.size
    for length in np.unique(lengths[lengths > 0]).tolist():
        windows = np.ndarray((len(joined) - length + 1, length), np.uint8, joined, strides=(1, 1))
        if (lengths == length).all():
            batch["data"][:, :length] = windows[payloads]
        else:
            mine = np.flatnonzero(lengths == length)
            batch["data"][mine, :length] = windows[payloads[mine]]
    return batch
