"""Packets out of a byte stream: any split, any noise. The oracle decodes with its own COBS, CRC and walk."""

from __future__ import annotations

from dataclasses import astuple, dataclass
from itertools import pairwise

import numpy as np
import pytest
from cobs import cobs
from hypothesis import given
from hypothesis import strategies as st
from test_packet import HEARTBEAT, HEARTBEAT_PACKET, crc16, crc32

from bench.link.frames import ERROR, EXTENDED, FD, FRAME, FrameBatch, frame, payload
from bench.link.packetstream import PacketStream, encode
from bench.wire import packet

Messages = list[tuple[int, bytes]]
messages = st.tuples(st.integers(0, 0x7FF), st.binary(max_size=64))
equal_lengths = st.integers(0, 64).flatmap(
    lambda n: st.lists(st.tuples(st.integers(0, 0x7FF), st.binary(min_size=n, max_size=n)), min_size=1, max_size=15)
)
contents = st.one_of(st.lists(messages, min_size=1, max_size=15), equal_lengths)


@dataclass
class Expected:
    """What the oracle says."""

    messages: Messages
    packets: int = 0
    crc_errors: int = 0
    malformed: int = 0


def oracle(data: bytes) -> Expected:
    """Byte by byte, from the description of the format alone; all of `data` has been delimited."""
    out = Expected([])
    for piece in data.split(b"\0")[:-1]:
        whole = decobs(piece)
        if not piece:
            continue
        if whole is None or not (12 <= len(whole) <= 130 or 133 <= len(whole) <= 1028):
            out.malformed += 1
            continue
        width = 2 if len(whole) <= 130 else 4
        inner, found = whole[:-width], int.from_bytes(whole[-width:], "little")
        if found != (crc16(inner) if width == 2 else crc32(inner)):
            out.crc_errors += 1
            continue
        parts = walk(inner)
        if parts is None:
            out.malformed += 1
            continue
        out.packets += 1
        out.messages += parts
    return out


def decobs(piece: bytes) -> bytes | None:
    out, at = bytearray(), 0
    while at < len(piece):
        code = piece[at]
        if at + code > len(piece):
            return None
        out += piece[at + 1 : at + code]
        at += code
        if code != 255 and at < len(piece):
            out.append(0)
    return bytes(out)


def walk(inner: bytes) -> Messages | None:
    out, rest = [], inner[7:]
    while rest:
        if len(rest) < 3 or rest[1] > 7 or rest[2] > 64 or len(rest) < 3 + rest[2]:
            return None
        out.append((rest[0] + 256 * rest[1], rest[3 : 3 + rest[2]]))
        rest = rest[3 + rest[2] :]
    return out if inner[0] == 1 else None


def taken(batches: list[FrameBatch]) -> Messages:
    """What the frames hold; checks on the way what is the same in all of them."""
    batch = np.concatenate(batches)
    assert batch.dtype == FRAME
    assert not batch["hw_ns"].any()
    assert (batch["flags"] == FD).all()
    beyond = np.arange(64) >= batch["length"][:, None]
    assert not batch["data"][beyond].any()
    return [(int(row["id"]), payload(row)) for row in batch]


def batch_of(parts: Messages) -> FrameBatch:
    return np.concatenate([np.zeros(0, FRAME), *(frame(i, p) for i, p in parts)])


def cut(data: bytes, places: list[int]) -> list[bytes]:
    edges = [0, *sorted(p % (len(data) + 1) for p in places), len(data)]
    return [data[a:b] for a, b in pairwise(edges)]


def counts(stream: PacketStream) -> tuple[int, ...]:
    return stream.packets, stream.crc_errors, stream.malformed, stream.packets_lost, stream.pending


def test_golden() -> None:
    stream = PacketStream()
    (got,) = stream.feed(HEARTBEAT_PACKET, 123)
    assert (int(got["id"]), payload(got)) == HEARTBEAT
    assert (got["t_ns"], got["length"], got["flags"]) == (123, 8, FD)
    assert encode(frame(*HEARTBEAT), 7) == (HEARTBEAT_PACKET, 8)


@given(st.lists(contents, min_size=1, max_size=6), st.lists(st.integers(0, 10_000), max_size=8))
def test_any_split_gives_the_same_frames(parts: list[Messages], places: list[int]) -> None:
    data = b"".join(packet.packet(k, k, p) for k, p in enumerate(parts))
    stream = PacketStream()
    got = [stream.feed(piece, k) for k, piece in enumerate(cut(data, places))]
    assert taken(got) == [m for p in parts for m in p]
    assert counts(stream) == (len(parts), 0, 0, 0, 0)


noise = st.one_of(
    st.binary(max_size=40),
    st.builds(lambda k, p: packet.packet(k, 0, p), st.integers(0, 0xFFFF), contents),
    st.builds(lambda x: bytes(cobs.encode(x + crc16(x).to_bytes(2, "little"))) + b"\0", st.binary(max_size=128)),
    st.just(b"\xff" * 1500),
)


@given(
    st.lists(noise, max_size=6),
    st.lists(st.tuples(st.integers(0, 10_000), st.integers(1, 255)), max_size=3),
    st.lists(st.integers(0, 10_000), max_size=8),
)
def test_noise(pieces: list[bytes], hits: list[tuple[int, int]], places: list[int]) -> None:
    """Garbage, packets and packets with bytes changed: what is delivered, and counted, is what the format says, however
    the bytes are cut, and no more is kept than the longest packet."""
    data = bytearray(b"".join(pieces) + b"\0")
    for at, change in hits:
        data[at % (len(data) - 1) if len(data) > 1 else 0] ^= change
    data[-1:] = b"\0"
    expected, whole, stream = oracle(bytes(data)), PacketStream(), PacketStream()
    at_once = whole.feed(bytes(data), 5)
    got = []
    for piece in cut(bytes(data), places):
        got.append(stream.feed(piece, 5))
        assert stream.pending <= packet.ENCODED_LIMIT
    assert taken(got) == taken([at_once]) == expected.messages
    assert counts(stream) == counts(whole)
    assert (stream.packets, stream.crc_errors, stream.malformed) == astuple(expected)[1:]


@given(st.lists(st.binary(max_size=3000), max_size=8))
def test_no_delimiter_no_memory(pieces: list[bytes]) -> None:
    stream = PacketStream()
    for piece in pieces:
        stream.feed(piece.replace(b"\0", b"\1"), 0)
        assert stream.pending <= packet.ENCODED_LIMIT
    assert stream.malformed == (sum(map(len, pieces)) > packet.ENCODED_LIMIT)
    stream.feed(b"\0", 0)
    assert len(stream.feed(HEARTBEAT_PACKET, 0)) == 1


def test_garbage_before_a_packet_costs_one_packet() -> None:
    stream = PacketStream()
    assert len(stream.feed(b"garbage" + HEARTBEAT_PACKET, 0)) == 0
    assert len(stream.feed(HEARTBEAT_PACKET, 0)) == 1
    assert stream.crc_errors + stream.malformed == 1


@pytest.mark.parametrize("kept", range(len(HEARTBEAT_PACKET)))
def test_joining_in_mid_packet_is_no_error(kept: int) -> None:
    """A controller that talks already is joined anywhere; only what comes after the first delimiter must be packets."""
    stream = PacketStream(joining=True)
    assert len(stream.feed(HEARTBEAT_PACKET[-1 - kept : -1], 0)) == 0
    stream.feed(b"\0", 0)
    assert (stream.crc_errors, stream.malformed) == (0, 0)
    stream.feed(HEARTBEAT_PACKET[3:], 0)
    assert stream.crc_errors + stream.malformed == 1


@pytest.mark.parametrize("places", [[], [1000], [2000], [1033, 1034]])
def test_joining_forgives_no_endless_packet(places: list[int]) -> None:
    stream = PacketStream(joining=True)
    for piece in cut(b"\1" * 2000 + b"\0", places):
        stream.feed(piece, 0)
    assert stream.malformed == 1
    stream.feed(b"\1\0", 0)
    assert stream.malformed == 2


def test_joining_takes_a_whole_first_packet() -> None:
    assert len(PacketStream(joining=True).feed(HEARTBEAT_PACKET, 0)) == 1


def test_delimiters_alone_are_not_counted() -> None:
    stream = PacketStream()
    assert len(stream.feed(b"\0\0" + HEARTBEAT_PACKET + b"\0\0", 0)) == 1
    assert counts(stream) == (1, 0, 0, 0, 0)


@pytest.mark.parametrize(
    ("sent", "lost"),
    [
        ([(5, 10), (6, 20), (7, 30)], 0),
        ([(5, 10), (7, 30)], 1),
        ([(0xFFFE, 10), (0xFFFF, 20), (0, 30), (1, 40)], 0),
        ([(0xFFFE, 10), (1, 40)], 2),
        ([(5, 10), (5, 10)], 0),  # the same again
        ([(5, 10), (7, 30), (6, 20), (8, 40)], 2),  # out of order: 6 was missing, then 7 behind 6
        ([(100, 10), (40_000, 0xFFFF_0000)], 0),  # the tick went back: a restart
        ([(40_000, 90_000), (0, 10), (1, 20)], 0),
        ([(5, 10), (40_005, 400_000)], 39_999),  # a tick that went on: all of them lost
        ([(5, 0xFFFF_FFF0), (6, 4), (8, 20)], 1),  # the tick wraps
        ([(5, 0), (6, 0), (9, 0)], 2),  # from the host, without ticks
        ([(5, 0), (6, 0), (0, 0), (1, 0)], 0),  # the host began anew
        ([(40_000, 0), (3, 0)], 25_538),  # cannot be told from a loss
        ([(1000, 0), (40_000, 0)], 0),
        ([(40_000, 0), (0, 0), (1, 0)], 0),
        ([(0xFFFF, 0), (0, 0), (1, 0)], 0),
    ],
)
def test_lost_packets(sent: list[tuple[int, int]], lost: int) -> None:
    stream = PacketStream()
    for sequence, tick in sent:
        assert len(stream.feed(packet.packet(sequence, tick, [HEARTBEAT]), 0)) == 1
    assert stream.packets_lost == lost


def test_a_corrupt_packet_is_also_a_lost_one() -> None:
    stream = PacketStream()
    made = [bytearray(packet.packet(k, k, [HEARTBEAT])) for k in range(3)]
    made[1][-2] ^= 0x10
    stream.feed(b"".join(made), 0)
    assert counts(stream) == (2, 1, 0, 1, 0)


@given(st.lists(messages, max_size=80), st.integers(0, 0xFFFF), st.integers(0, 0xFFFFFFFF))
def test_encode(parts: Messages, sequence: int, tick: int) -> None:
    """All frames, in order, in packets none of which could take the first frame of the next."""
    data, after = encode(batch_of(parts), sequence, tick)
    made = [packet.unpack(p) for p in data.split(b"\0")[:-1]]
    assert [m for p in made for m in p.messages] == parts
    assert [p.sequence for p in made] == [(sequence + k) & 0xFFFF for k in range(len(made))]
    assert {p.tick for p in made} <= {tick}
    assert after == (sequence + len(made)) & 0xFFFF
    sizes = [7 + sum(3 + len(m) for _, m in p.messages) for p in made]
    assert all(s + 3 + len(p.messages[0][1]) > 1024 for s, p in zip(sizes, made[1:], strict=False))


def test_encode_fills_a_packet_to_the_last_byte() -> None:
    full = [(1, bytes(64))] * 15 + [(2, bytes(9))]
    assert encode(batch_of(full), 0)[1] == 1
    assert encode(batch_of([*full[:-1], (2, bytes(10))]), 0)[1] == 2


def test_encode_refuses() -> None:
    with pytest.raises(ValueError, match="0x80000001"):
        encode(frame(1 | EXTENDED, b""), 0)
    with pytest.raises(ValueError, match="error frame"):
        encode(frame(1, b"", flags=ERROR), 0)
    long = frame(1, b"")
    long["length"] = 65
    with pytest.raises(ValueError, match="65 bytes"):
        encode(long, 0)
