"""What speaks to one client of a served rig: SLCAN byte by byte, packets, lines, and a client that does not read."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from serving_clients import MS, SECOND, SET_UP, T0, adapter

from bench.link.frames import ERROR, FD, empty_batch, frame, payload
from bench.wire import packet, slcan
from sim_backend.serving import connection as connections
from sim_backend.serving.adapter import SlcanAdapter
from sim_backend.serving.connection import Connection
from sim_backend.serving.peers import LONGEST_REQUEST, LinePeer, PacketPeer, Sent

HEARD = b"t1002BEEF\r"


def said(device: SlcanAdapter, data: bytes) -> bytes:
    device.take(data, T0)
    answer = bytes(device.answers)
    device.answers.clear()
    return answer


@pytest.mark.parametrize(
    ("asked", "answered"),
    [
        (b"\r", b"\r"),
        (b"V\r", b"VSIM1\r"),
        (b"N\r", b"NSIM1\r"),
        (b"O\r", b"\a"),  # no bit rate yet
        (b"F\r", b"\a"),  # closed
        (b"t10021122\r", b"\a"),
        (b"S8\rO\rF\r", b"\r\rF80\r"),  # the data bit rate is 2 Mbit/s unless told
        (SET_UP + b"F\r", b"\r\r\rF00\r"),
        (SET_UP + b"O\r", b"\r\r\r\a"),
        (SET_UP + b"S8\r", b"\r\r\r\a"),  # open: too late
        (SET_UP + b"Z1\r", b"\r\r\r\a"),
        (SET_UP + b"C\rS6\rO\rF\r", b"\r\r\r" + b"\r\r\r" + b"F80\r"),
        (SET_UP + b"t10021122\r", b"\r\r\rz\r"),
        (SET_UP + b"T0000010021122\r", b"\r\r\rZ\r"),
        (SET_UP + b"b10821122334455667788\r", b"\r\r\r\a"),  # too long for its DLC
        (SET_UP + b"t1009112233445566778899\r", b"\r\r\r\a"),
        (SET_UP + b"t8000\r", b"\r\r\r\a"),  # 12 bits
        (SET_UP + b"tXYZ0\r", b"\r\r\r\a"),
        (SET_UP + b"r1000\r", b"\r\r\r\a"),  # remote frames are not for this bus
        (b"S9\rY3\rs0\rQ\rVV\r", b"\a\a\a\a\a"),
        (b"x" * 400 + b"\rV\r", b"\aVSIM1\r"),
    ],
)
def test_answers_of_the_adapter(asked: bytes, answered: bytes) -> None:
    whole, single = adapter(), adapter()
    assert said(whole, asked) == answered
    assert b"".join(said(single, bytes((octet,))) for octet in asked) == answered
    assert whole.refused == single.refused == answered.count(b"\a")


def test_frames_pass_both_ways_once_it_is_open() -> None:
    device = adapter()
    sent = Sent(frame(0x100, b"\xbe\xef", t_ns=T0 + 61_234 * MS), 0, brs=True)
    device.hear(sent)
    assert device.answers == b""
    said(device, SET_UP)
    got = device.take(b"b0128" + b"0011223344556677" + b"\rt7FF0\rT1FFFFFFF101\r", T0 + 5)
    assert got["id"].tolist() == [0x12, 0x7FF, 1 << 31 | 0x1FFFFFFF]
    assert got["flags"].tolist() == [FD, 0, 0]
    assert got["t_ns"].tolist() == [T0 + 5] * 3
    assert payload(got[0]).hex() == "0011223344556677"
    device.answers.clear()
    device.hear(sent)
    device.hear(Sent(frame(0x021, bytes(4), flags=FD), 0, brs=True))
    device.hear(Sent(frame(0x021, bytes(4), flags=FD), 0, brs=False))
    assert device.answers == HEARD + b"b021400000000\r" + b"d021400000000\r"


def test_timestamps_are_milliseconds_that_wrap_at_a_minute() -> None:
    device = adapter()
    said(device, b"Z1\r" + SET_UP)
    base = T0 - T0 % (60 * SECOND)
    two = np.concatenate(
        [frame(0x100, b"\x01", t_ns=base + 59_999 * MS), frame(0x100, b"\x02", t_ns=base + 60_001 * MS)]
    )
    device.hear(Sent(two, 0, brs=True))
    assert device.answers == b"t100101EA5F\rt1001020001\r"


def test_at_other_bit_rates_it_hears_nothing_reaches_nobody_and_reports_a_bus_error() -> None:
    device = adapter()
    assert said(device, b"S6\rY5\rO\rF\r") == b"\r\r\rF80\r"
    assert len(device.take(b"t1000\r", T0)) == 0
    device.answers.clear()
    device.hear(Sent(frame(0x100, b""), 0, brs=True))
    assert device.answers == b""


def test_a_destroyed_frame_shows_in_the_status_once_and_an_adapter_off_the_bus_all_the_time() -> None:
    off = [False]
    device = adapter(bus_off=lambda: off[0])
    said(device, SET_UP)
    device.hear(Sent(np.concatenate([frame(0, b"", flags=ERROR), frame(0x100, b"\xbe\xef")]), 0, brs=True))
    assert said(device, b"F\rF\r") == HEARD + b"F80\rF00\r"
    off[0] = True
    assert said(device, b"F\rF\rt1000\r") == b"F80\rF80\rz\r"
    assert not device.hears


@settings(max_examples=80, deadline=None)
@given(
    data=st.one_of(
        st.binary(max_size=300), st.text("StTbBdDrRYOCFVNZ0123456789ABCDEF\r", max_size=300).map(str.encode)
    ),
    cuts=st.lists(st.integers(0, 300), max_size=6),
)
def test_any_bytes_in_any_pieces(data: bytes, cuts: list[int]) -> None:
    """They give the same frames and answers as in one piece: one answer a line, and never more memory than a line."""
    whole, cut = adapter(), adapter()
    frames = whole.take(SET_UP + data, T0)
    bounds = [0, *sorted(min(c, len(data)) for c in cuts), len(data)]
    parts = [cut.take(SET_UP, T0), *(cut.take(data[a:b], T0) for a, b in itertools.pairwise(bounds))]
    assert frames.tobytes() == np.concatenate([empty_batch(), *parts]).tobytes()
    assert whole.answers == cut.answers
    assert whole.answers.count(b"\r") + whole.answers.count(b"\a") == (SET_UP + data).count(b"\r")
    assert len(whole._rest) <= slcan.LONGEST_LINE


def test_the_serial_port_speaks_packets_numbered_from_zero() -> None:
    peer = PacketPeer()
    got = peer.take(packet.packet(5, 0, [(0x011, bytes(8)), (0x010, bytes(8))]), T0)
    assert got["id"].tolist() == [0x011, 0x010]
    peer.hear(Sent(frame(0x023, b"\x01\x00\x02\x00\x01\x00\x00\x00", flags=FD), 0x1_0000_0007, brs=True))
    peer.hear(Sent(frame(0x100, bytes(64), flags=FD), 8, brs=True))
    first, second, rest = bytes(peer.answers).split(b"\0")
    assert rest == b""
    assert packet.unpack(first) == packet.Packet(0, 7, [(0x023, b"\x01\x00\x02\x00\x01\x00\x00\x00")])
    assert packet.unpack(second) == packet.Packet(1, 8, [(0x100, bytes(64))])


def test_an_answer_a_line_and_a_line_too_long_is_refused() -> None:
    asked: list[str] = []

    def request(line: str) -> str:
        asked.append(line)
        return "ok"

    peer = LinePeer(request)
    for octet in b"hang M2\nask \xff\n":
        peer.take(bytes((octet,)), T0)
    assert asked == ["hang M2", "ask \N{REPLACEMENT CHARACTER}"]
    peer.take(b"x" * (LONGEST_REQUEST + 1), T0)
    peer.take(b"x" * 10 + b"\nask\n", T0)
    assert asked[2:] == ["ask"]
    assert peer.answers == b"ok\nok\nerror the request is too long\nok\n"


class Pipe:
    """A stream whose other end takes so many bytes in all and then no more; None: it is gone."""

    def __init__(self, room: int | None) -> None:
        self.room, self.taken = room, b""

    def fileno(self) -> int:
        return -1

    def read(self, count: int) -> bytes | None:
        if self.room is None:
            raise OSError("gone")
        return None

    def write(self, data: bytes) -> int:
        if self.room is None:
            raise OSError("gone")
        if not self.room:
            raise BlockingIOError
        count = min(len(data), self.room, 7)  # in small bites, as a full port does
        self.room -= count
        self.taken += data[:count]
        return count


def open_connection(room: int | None) -> tuple[Pipe, Connection]:
    stream, peer = Pipe(room), adapter()
    peer.take(SET_UP, T0)
    peer.answers.clear()
    return stream, Connection(stream, peer)


def test_a_client_that_does_not_read_loses_whole_frames_which_are_counted() -> None:
    stream, client = open_connection(25)
    sent = Sent(frame(0x100, b"\xbe\xef"), 0, brs=True)
    offered = 0
    while not client.dropped:
        client.hear(sent)
        client.flush()
        offered += 1
    kept = offered - 1
    assert stream.taken == (HEARD * 3)[:25]
    assert connections.BACKLOG_BYTES <= kept * len(HEARD) - 25 < connections.BACKLOG_BYTES + len(HEARD)
    client.hear(Sent(np.concatenate([sent.batch] * 9), 0, brs=True))
    assert client.dropped == 10
    client.peer.take(b"V\r" * 1000, T0)  # asking without reading takes no memory either
    client.flush()
    assert len(client.peer.answers) == 0
    stream.room = 10**9  # it reads again
    while len(stream.taken) < kept * len(HEARD):
        client.flush()
    client.hear(sent)
    client.flush()
    client.flush()
    assert stream.taken == HEARD * (kept + 1)
    assert not client.closed


def test_a_client_that_is_gone_is_closed_whether_it_is_read_or_written() -> None:
    _, client = open_connection(None)
    assert len(client.receive(T0)) == 0
    assert client.closed
    _, other = open_connection(None)
    other.flush()
    assert not other.closed  # nothing to write, nothing noticed
    other.hear(Sent(frame(0x100, b""), 0, brs=True))
    other.flush()
    assert other.closed
