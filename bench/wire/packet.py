"""Serial packets, bytes only: several messages under one sequence number, one tick and one CRC, framed by COBS.

    content = version u8 | sequence u16 | tick u32 | one or more of (identifier u16, length u8, payload)
    packet  = COBS(content | crc) 0x00

Everything is little endian. The CRC is CRC-16/CCITT-FALSE up to 128 bytes of content and CRC-32 (zlib) above, where
16 bits would miss too much. COBS leaves no 0x00 inside, so that a receiver finds its feet at the next delimiter.
No numpy here: the heartbeat process, which must start fast and never stall, writes packets too.
"""

from __future__ import annotations

import binascii
import struct
import zlib
from collections.abc import Sequence
from typing import Final, NamedTuple

from cobs import cobs

VERSION: Final = 1
LIMIT: Final = 1024
"""Bytes of content that one packet may hold."""
SHORT: Final = 128
"""Bytes of content up to which the CRC has 16 bits."""
ENCODED_LIMIT: Final = (LIMIT + 4) + -(-(LIMIT + 4) // 254)
"""Bytes of the longest packet after COBS, delimiter not counted."""
HEADER: Final = struct.Struct("<BHI")
MESSAGE: Final = struct.Struct("<HB")
PAYLOAD_LIMIT: Final = 64
IDENTIFIERS: Final = 0x800
"""Identifiers have 11 bits."""


class Malformed(ValueError):
    """Bytes between two delimiters that no sender could have made a packet of."""


class WrongCrc(ValueError):
    """A packet whose content and CRC do not belong together."""


class Packet(NamedTuple):
    """What one packet holds."""

    sequence: int
    tick: int
    messages: list[tuple[int, bytes]]


def crc(content: bytes) -> bytes:
    """The CRC of a packet's content as it is sent: two bytes, or four above 128 bytes of content."""
    if len(content) <= SHORT:
        return binascii.crc_hqx(content, 0xFFFF).to_bytes(2, "little")
    return zlib.crc32(content).to_bytes(4, "little")


def packet(sequence: int, tick: int, messages: Sequence[tuple[int, bytes]]) -> bytes:
    """One packet with its delimiter, ready to write.

    Args:
        sequence: counts the packets of one direction, 0..65535.
        tick: device tick when the packet was closed, 32 bits; 0 from the host.
        messages: identifier (11 bits) and payload (at most 64 bytes), in order.

    Raises:
        ValueError: a number out of range, no message, or more than 1024 bytes of content.
    """
    if not 0 <= sequence <= 0xFFFF or not 0 <= tick <= 0xFFFFFFFF:
        raise ValueError(f"sequence {sequence} or tick {tick} out of range; they have 16 and 32 bits")
    if not messages:
        raise ValueError("a packet holds at least one message")
    parts = [HEADER.pack(VERSION, sequence, tick)]
    for identifier, payload in messages:
        if not 0 <= identifier < IDENTIFIERS:
            raise ValueError(f"identifier 0x{identifier:X}; a packet carries identifiers of 11 bits")
        if len(payload) > PAYLOAD_LIMIT:
            raise ValueError(f"message 0x{identifier:X}: payload of {len(payload)} bytes; expected at most 64")
        parts += (MESSAGE.pack(identifier, len(payload)), payload)
    content = b"".join(parts)
    if len(content) > LIMIT:
        raise ValueError(f"content of {len(content)} bytes; a packet holds at most {LIMIT}")
    return bytes(cobs.encode(content + crc(content))) + b"\0"


def check(content_and_crc: bytes) -> bytes:
    """The content, if the CRC that its length calls for holds and the version is known.

    Raises:
        Malformed: an impossible length, or an unknown version under a right CRC.
        WrongCrc: the CRC does not hold.
    """
    size = len(content_and_crc)
    content = content_and_crc[: size - (2 if size <= SHORT + 2 else 4)]
    if len(content) < HEADER.size + MESSAGE.size or len(content) > LIMIT or size in (SHORT + 3, SHORT + 4):
        raise Malformed(f"{size} bytes; a packet holds 12 to 130 or 133 to {LIMIT + 4}")
    if crc(content) != content_and_crc[len(content) :]:
        raise WrongCrc(f"CRC of {size} bytes does not hold")
    if content[0] != VERSION:
        raise Malformed(f"version {content[0]}; expected {VERSION}")
    return content


def content_of(encoded: bytes) -> bytes:
    """The checked content of what stood between two delimiters.

    Raises:
        Malformed: not COBS, or see `check`.
        WrongCrc: the CRC does not hold.
    """
    try:
        decoded = cobs.decode(encoded)
    except cobs.DecodeError as error:
        raise Malformed(f"not COBS: {error}") from None
    return check(decoded)


def places(content: bytes) -> Sequence[int]:
    """Where the messages of a checked content begin.

    Raises:
        Malformed: a message runs past the end, is longer than 64 bytes, or has an identifier over 11 bits.
    """
    size, first = len(content), HEADER.size
    length = content[first + 2]
    stride = MESSAGE.size + length
    count, rest = divmod(size - first, stride)
    if not rest and length <= PAYLOAD_LIMIT and content[first + 2 :: stride] == bytes((length,)) * count:
        if max(content[first + 1 :: stride]) >= IDENTIFIERS >> 8:
            raise Malformed("an identifier over 11 bits")
        return range(first, size, stride)  # all of one length: no need to walk
    at, found = first, []
    while at < size:
        found.append(at)
        if at + MESSAGE.size > size or content[at + 1] >= IDENTIFIERS >> 8 or content[at + 2] > PAYLOAD_LIMIT:
            raise Malformed(f"message {len(found)} is cut off, or its identifier or length is out of range")
        at += MESSAGE.size + content[at + 2]
    if at > size:
        raise Malformed(f"message {len(found)} runs {at - size} bytes past the end")
    return found


def unpack(encoded: bytes) -> Packet:
    """One packet, given without its delimiter, message by message.

    Raises:
        Malformed, WrongCrc: it is none.
    """
    content = content_of(encoded)
    _, sequence, tick = HEADER.unpack_from(content)
    messages = []
    for at in places(content):
        identifier, length = MESSAGE.unpack_from(content, at)
        messages.append((identifier, content[at + MESSAGE.size : at + MESSAGE.size + length]))
    return Packet(sequence, tick, messages)
