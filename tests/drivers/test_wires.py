"""Wires: which one a URL opens, packets by hand, counts, and how another process may write."""

from __future__ import annotations

import binascii
from collections.abc import Iterator

import numpy as np
import pytest
from cobs import cobs
from far_end import Adapter, FarEnd, far_end, until

from bench.errors import ConfigError, LinkError
from bench.link.frames import ERROR, EXTENDED, FD, FrameBatch, empty_batch, frame, payload
from bench.rigfile import LinkSpec, load_rig
from drivers.wires import CanWire, PacketWire, Wire, open_wire

KINDS = pytest.mark.parametrize("end", [False, True], indirect=True, ids=["pty", "tcp"])


@pytest.fixture
def wire(end: FarEnd) -> Iterator[Wire]:
    wire = open_wire(LinkSpec(url=f"serial:{end.where}"), "serial0", now_ns=lambda: 77)
    if end.where.startswith("socket"):
        end.wait(lambda f: f.clients == 1)
    yield wire
    wire.close()


def packet(sequence: int, *messages: bytes, tick: int = 0) -> bytes:
    """By hand from the layout: version, sequence, tick, messages, CRC-16, COBS, delimiter."""
    content = b"\x01" + sequence.to_bytes(2, "little") + tick.to_bytes(4, "little") + b"".join(messages)
    return cobs.encode(content + binascii.crc_hqx(content, 0xFFFF).to_bytes(2, "little")) + b"\0"


def frames_from(wire: Wire, count: int) -> FrameBatch:
    parts = [empty_batch()]
    until(lambda: parts.append(wire.read(0.1)) or sum(map(len, parts)) >= count)
    return np.concatenate(parts)


@KINDS
def test_packets_become_frames(end: FarEnd, wire: Wire) -> None:
    end.write(
        b"half a pack\0"
        + packet(5, b"\x23\x01\x02\xab\xcd", b"\x00\x01\x00", tick=9)
        + packet(7, b"\x24\x01\x01\x00", tick=19)
    )
    batch = frames_from(wire, 3)
    assert batch["id"].tolist() == [0x123, 0x100, 0x124]
    assert [payload(f) for f in batch] == [b"\xab\xcd", b"", b"\x00"]
    assert batch["t_ns"].tolist() == [77] * 3
    assert batch["flags"].tolist() == [FD] * 3
    s = wire.stats
    assert (s.received, s.packets_lost, s.malformed, s.crc_errors) == (3, 1, 0, 0)  # the first began before we did


def test_damage_is_counted(end: FarEnd, wire: Wire) -> None:
    wrong = bytearray(packet(1, b"\x23\x01\x02\xab\xcd"))
    wrong[8] ^= 0x40
    end.write(packet(0, b"\x23\x01\x00") + bytes(wrong) + b"\x05\x01\0" + packet(2, b"\x23\x01\x00"))
    frames_from(wire, 2)
    assert (wire.stats.crc_errors, wire.stats.malformed, wire.stats.packets_lost) == (1, 1, 1)


@KINDS
def test_frames_become_packets_with_running_numbers(end: FarEnd, wire: Wire) -> None:
    wire.write(np.concatenate([frame(0x011, b"\x01\x02"), frame(0x7FF, b"")]))
    wire.write(frame(0x010, b"\x00"))
    end.wait_for(packet(0, b"\x11\x00\x02\x01\x02", b"\xff\x07\x00") + packet(1, b"\x10\x00\x01\x00"))
    assert wire.stats.sent == 3
    for wrong in (frame(1, b"", flags=ERROR), frame(1 | EXTENDED, b"")):
        with pytest.raises(LinkError, match=f"port {end.where}: "):
            wire.write(wrong)
    assert wire.stats.sent == 3


def test_a_lost_port_is_a_link_error(end: FarEnd, wire: Wire) -> None:
    end.hang_up()
    with pytest.raises(LinkError, match="unplugged"):
        wire.read(20.0)
    wire.close()
    wire.close()
    with pytest.raises(LinkError, match="is closed"):
        wire.write(frame(1, b""))


@KINDS
def test_byte_streams_have_one_writer_by_descriptor(end: FarEnd, wire: Wire) -> None:
    assert isinstance(wire, PacketWire)
    spec = wire.writer()
    assert spec.format == "packet"
    assert isinstance(spec.fileno, int)
    end.answer = Adapter()
    wire.close()
    can_wire = open_wire(LinkSpec(url=f"slcan:{end.where}", bitrate=1e6, data_bitrate=5e6), "can0")
    assert isinstance(can_wire, CanWire)
    spec = can_wire.writer()
    assert (spec.format, spec.brs, isinstance(spec.fileno, int)) == ("slcan", True, True)
    can_wire.close()


def test_what_only_this_process_reaches_has_no_other_writer() -> None:
    for url in ("can:virtual:lev-wires", "serial:loop://"):
        wire = open_wire(LinkSpec(url=url), "can0")
        assert wire.writer().format == "none"
        wire.close()


def test_other_can_interfaces_are_opened_a_second_time() -> None:
    wire = open_wire(LinkSpec(url="can:virtual:lev-wires", bitrate=5e5, data_bitrate=2e6), "can0", [0x100])
    assert isinstance(wire, CanWire)
    wire._can.arguments = {**wire._can.arguments, "interface": "pcan"}  # which this machine has not
    spec = wire.writer()
    assert (spec.format, spec.brs) == ("python-can", True)
    assert spec.arguments == {
        "interface": "pcan", "channel": "lev-wires", "fd": True, "bitrate": 500_000, "data_bitrate": 2_000_000,
        "can_filters": [{"can_id": 0x100, "can_mask": 0x7FF, "extended": False}], "ignore_config": True,
    }  # fmt: skip
    wire.close()


def test_the_requests_of_an_slcan_wire_go_through_the_one_writer() -> None:
    with far_end(answer=Adapter()) as end:
        wire = open_wire(LinkSpec(url=f"slcan:{end.where}", bitrate=1e6), "can0")
        written: list[bytes] = []
        wire.written_by(written.append)
        until(lambda: len(wire.read(0.1)) == 0 and written == [b"F\r"])
        assert end.received.endswith(b"V\rF\r")
        wire.close()


@pytest.mark.parametrize(
    ("url", "says"),
    [
        (
            "modbus-tcp:127.0.0.1:502",
            "link rig0: found 'modbus-tcp:127.0.0.1:502'; expected a URL that starts with slcan:",
        ),
        ("inprocess:", "link rig0: found 'inprocess:'; expected a URL that starts with "),
        ("serial:/dev/ttyLEV1", "link rig0: port /dev/ttyLEV1: found no such device; "),
        (
            "serial:/dev/ttyLEV1?baudrate=fast",
            "link rig0: found baudrate=fast; expected a whole number of Bd, such as ",
        ),
        ("serial:/dev/ttyLEV1?baud=9600", "link rig0: found baud in the URL; expected at most baudrate=N"),
        ("serial:", "link URL 'serial:': found no address; expected such as "),
        ("seriel:/dev/ttyUSB0", "link URL 'seriel:/dev/ttyUSB0': found scheme 'seriel'; did you mean "),
    ],
)
def test_what_is_no_wire_says_so_in_one_line(url: str, says: str) -> None:
    with pytest.raises(ConfigError) as caught:
        open_wire(LinkSpec(url=url), "rig0")
    assert str(caught.value).startswith(says)
    assert "\n" not in str(caught.value)


def test_a_busy_port_names_link_port_and_owner(end: FarEnd, wire: Wire) -> None:
    with pytest.raises(ConfigError, match=f"link serial0: port {end.where}: it is in use by this process"):
        open_wire(LinkSpec(url=f"serial:{end.where}"), "serial0")


@pytest.mark.parametrize(
    ("query", "said"),
    [("baudrate=abc", "a whole number of Bd"), ("speed=3", "at most baudrate=N")],
)
def test_settings_of_a_command_line_are_looked_at_as_those_of_packets(query: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        open_wire(LinkSpec(url=f"cli:serial:/dev/null?{query}"), "controller", rig=load_rig("lira"))
