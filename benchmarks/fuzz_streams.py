"""Fuzz targets for the decoders of byte streams, and their oracles: written apart from the decoders, slow and plain."""

from __future__ import annotations

import binascii
import re
import zlib
from typing import Final

import numpy as np
from cobs import cobs

from bench.link import slcanstream
from bench.link.frames import FD, FrameBatch
from bench.link.packetstream import PacketStream
from bench.link.slcanstream import SlcanStream
from bench.wire.slcan import LENGTHS, LONGEST_LINE
from benchmarks.fuzz_draws import INPUTS, LENGTH_CHOICES, T_NS, Block, Draw, batch_of, mutated, noise, pieces

# SLCAN ------------------------------------------------------------------------------------------------------------


def _grammar(stamp: bytes) -> re.Pattern[bytes]:
    """Every data frame, spelled out: the line must begin after a delimiter and end with CR."""
    digit = rb"[0-9A-Fa-f]"
    bodies = [b"%X%s{%d}" % (code, digit, 2 * n) if n else b"%X" % code for code, n in enumerate(LENGTHS)]
    bodies = [b"[%s%s]%s" % (b[:1], b[:1].lower(), b[1:]) for b in bodies]
    standard, extended = rb"[0-7]%s{2}" % digit, rb"[01]%s{7}" % digit
    classic, fd = b"|".join(bodies[:9]), b"|".join(bodies)
    one = rb"(?:t%s|T%s)(?:%s)|(?:[db]%s|[DB]%s)(?:%s)" % (standard, extended, classic, standard, extended, fd)
    return re.compile(rb"(?<![^\r\a])((?:%s)%s)\r" % (one, stamp))


_GRAMMAR: Final = {False: _grammar(b""), True: _grammar(rb"[0-9A-Fa-f]{4}")}
_CHARACTERS: Final = b"tTrRdDbBzZFVNCOSY0123456789ABCDEFabcdef\r\a"
_EVERY: Final = bytes(range(256))


def slcan_block(draw: Draw) -> Block:
    """Noise, or frames of both kinds with changes."""
    stamped = bool(draw.random() < 0.3)
    what = draw.integers(0, 4)
    if what < 2:
        data = noise(draw, _EVERY if what else _CHARACTERS, 13, INPUTS)
    else:
        batch = batch_of(draw, INPUTS, LENGTH_CHOICES[: 4 if what == 2 else None].tolist(), 0x800)
        batch["flags"] = np.where((batch["length"] > 8) | (draw.random(INPUTS) < 0.3), FD, 0)
        extended = draw.random(INPUTS) < 0.3
        batch["id"][extended] = (1 << 31) + draw.integers(0, 1 << 29, int(extended.sum()))
        data = slcanstream.encode(batch, brs=bool(draw.random() < 0.5))
        if stamped:
            data = data.replace(b"\r", b"%04X\r" % int(draw.integers(0, 61_000)))
        data = mutated(data, draw)
    count = data.count(b"\r") + data.count(b"\a") + 1
    whole, split = SlcanStream(timestamp=stamped), SlcanStream(timestamp=stamped)
    frames, findings = whole.feed(data, T_NS), list[str]()
    cut = np.concatenate([_fed(split, piece, findings, LONGEST_LINE + 1) for piece in pieces(data, draw)])
    if frames.tobytes() != cut.tobytes() or _slcan_state(whole) != _slcan_state(split):
        findings.append("a split of the bytes changes frames or counts")
    if (got := _as_lines(frames)) != (expected := _expected_lines(data, stamped)):
        findings.append(f"{len(got)} frames, not the {len(expected)} that the grammar finds")
    if whole.refused != data.count(b"\a") or len(frames) + whole.malformed + whole.remote > count:
        findings.append("other counts than lines")
    return count, len(frames), findings


def _fed(stream: SlcanStream | PacketStream, piece: bytes, findings: list[str], bound: int) -> FrameBatch:
    frames = stream.feed(piece, T_NS)
    if stream.pending > bound:
        findings.append(f"{stream.pending} bytes kept, over {bound}")
    return frames


def _slcan_state(stream: SlcanStream) -> tuple[object, ...]:
    return stream.malformed, stream.refused, stream.remote, stream.status, stream.replies, stream.pending


def _expected_lines(data: bytes, stamped: bool) -> list[bytes]:
    found = _GRAMMAR[stamped].findall(data)
    if stamped:
        found = [text[:-4] for text in found if int(text[-4:], 16) < 60_000]
    return [text[:1].replace(b"b", b"d").replace(b"B", b"D") + text[1:].upper() for text in found]


def _as_lines(frames: FrameBatch) -> list[bytes]:
    return slcanstream.encode(frames, brs=False).split(b"\r")[:-1]


# Serial packets ---------------------------------------------------------------------------------------------------

_LONGEST_PACKET: Final = 1028 + 5
"""Content and CRC, and one byte of COBS for each 254 begun."""


def serial_block(draw: Draw) -> Block:
    """Noise, packets with changes, or packets with a right CRC around random content."""
    what = draw.integers(0, 4)
    if what == 0:
        data = noise(draw, _EVERY, 0, INPUTS)
    elif what == 1:
        data = b"".join(_wrapped(content) for content in _strange_contents(draw, INPUTS))
    else:
        most = 3 if what == 2 else 60
        contents = _contents(draw, max(INPUTS * 2 // most, 200), most)
        data = mutated(b"".join(_wrapped(content) for content in contents), draw)
    joining = bool(draw.random() < 0.3)
    whole, split, findings = PacketStream(joining=joining), PacketStream(joining=joining), list[str]()
    frames = whole.feed(data, T_NS)
    cut = np.concatenate([_fed(split, piece, findings, _LONGEST_PACKET) for piece in pieces(data, draw)])
    if (
        frames.tobytes() != cut.tobytes()
        or _counts(whole) != _counts(split)
        or whole.packets_lost != split.packets_lost
    ):
        findings.append("a split of the bytes changes frames or counts")
    packets, wrong, malformed, expected = _expected_messages(data, joining)
    if (packets, wrong, malformed) != _counts(whole):
        findings.append(f"counts {_counts(whole)}, not {(packets, wrong, malformed)}")
    names = zip(frames["id"].tolist(), frames["length"].tolist(), strict=True)
    octets = frames["data"].tobytes()
    if [(n, size, octets[64 * i : 64 * i + 64]) for i, (n, size) in enumerate(names)] != expected:
        findings.append(f"other frames than the {len(expected)} that pass their CRC")
    return data.count(b"\0") + 1, len(frames), findings


def _counts(stream: PacketStream) -> tuple[int, int, int]:
    return stream.packets, stream.crc_errors, stream.malformed


def _wrapped(content: bytes) -> bytes:
    """COBS with the CRC that the content's length calls for, whatever the content."""
    crc = zlib.crc32(content).to_bytes(4, "little")
    if len(content) <= 128:
        crc = binascii.crc_hqx(content, 0xFFFF).to_bytes(2, "little")
    return bytes(cobs.encode(content + crc)) + b"\0"


def _contents(draw: Draw, count: int, most: int) -> list[bytes]:
    """Right contents of 1 to `most` messages, as far as 1024 bytes go."""
    sizes = draw.integers(0, 9 if most < 4 else 20, (count, most)).tolist()
    names = draw.integers(0, 0x800, (count, most)).tolist()
    numbers = draw.integers(1, most + 1, count).tolist()
    pool = draw.bytes(4096)
    contents = []
    for at, number in enumerate(numbers):
        parts = [b"\x01" + at.to_bytes(2, "little") + pool[at % 4000 : at % 4000 + 4]]
        for name, size in zip(names[at][:number], sizes[at][:number], strict=True):
            parts += (name.to_bytes(2, "little"), bytes([size]), pool[name : name + size])
        contents.append(b"".join(parts)[:1024])  # what is cut off here is malformed
    return contents


def _strange_contents(draw: Draw, count: int) -> list[bytes]:
    """Contents with a right CRC that are wrong in version, lengths or identifiers as often as not."""
    pool = draw.bytes(8192)
    lengths = np.where(draw.random(count) < 0.02, draw.integers(0, 1200, count), draw.integers(0, 40, count)).tolist()
    starts, firsts = draw.integers(0, 6900, count).tolist(), draw.integers(0, 8, (count, 3)).tolist()
    out = []
    for size, start, (version, high, length) in zip(lengths, starts, firsts, strict=True):
        head = bytes([version if version == 2 else 1]) + pool[start : start + 7] + bytes([high, length * 4])
        out.append((head + pool[start + 10 : start + size])[:size])
    return out


def _expected_messages(data: bytes, joining: bool) -> tuple[int, int, int, list[tuple[int, int, bytes]]]:
    """Packets, CRC errors, malformed ones, and the messages as (identifier, length, 64 bytes)."""
    packets, wrong, malformed, messages = 0, 0, 0, list[tuple[int, int, bytes]]()
    *ended, rest = data.split(b"\0")
    if joining and ended and len(ended[0]) <= _LONGEST_PACKET and not _expected_messages(ended[0] + b"\0", False)[0]:
        del ended[0]  # the tail of a packet that began earlier
    for encoded in filter(None, ended):
        try:
            decoded = cobs.decode(encoded) if len(encoded) <= _LONGEST_PACKET else b""
        except cobs.DecodeError:
            decoded = b""
        size = len(decoded) - (2 if len(decoded) <= 130 else 4)
        if not 10 <= size <= 1024 or len(decoded) in (131, 132):
            malformed += 1
        elif not _crc_holds(decoded, size):
            wrong += 1
        elif (found := _messages(decoded[:size])) is None:
            malformed += 1
        else:
            packets += 1
            messages += found
    return packets, wrong, malformed + (len(rest) > _LONGEST_PACKET), messages


def _crc_holds(decoded: bytes, size: int) -> bool:
    if size <= 128:
        return binascii.crc_hqx(decoded[:size], 0xFFFF) == int.from_bytes(decoded[size:], "little")
    return zlib.crc32(decoded[:size]) == int.from_bytes(decoded[size:], "little")


def _messages(content: bytes) -> list[tuple[int, int, bytes]] | None:
    if content[0] != 1:
        return None
    found, at = [], 7
    while at < len(content):
        name, length = int.from_bytes(content[at : at + 2], "little"), content[at + 2 : at + 3]
        payload = content[at + 3 : at + 3 + length[0]] if length else b""
        if not length or name > 0x7FF or length[0] > 64 or len(payload) != length[0]:
            return None
        found.append((name, length[0], payload.ljust(64, b"\0")))
        at += 3 + length[0]
    return found
