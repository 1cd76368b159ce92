"""The simulated devices' Modbus: requests and responses by hand, any split, any bytes."""

from __future__ import annotations

from functools import cache

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.framer import FramerRTU

from bench.rigfile import RigFile, load_rig
from sim_backend.devices.modbus_server import LONGEST_RTU, SILENCE_NS, RtuPeer, TcpPeer, crc16
from sim_backend.devices.registers import RegisterBank
from sim_backend.machines.tsbs.plant import Plant
from sim_backend.truth import draw

SPLITS = st.lists(st.integers(1, 12), max_size=20)


@cache
def rig() -> RigFile:
    return load_rig("tsbs12")


def bank() -> RegisterBank:
    truth = draw(rig(), 1)
    return RegisterBank(rig(), truth, Plant(truth.plant, 1))


def tcp(of: RegisterBank | None = None) -> TcpPeer:
    devices = of or bank()
    return TcpPeer(lambda unit: devices.device("fieldbus", unit))


def rtu(of: RegisterBank | None = None) -> RtuPeer:
    return RtuPeer(of or bank(), "fieldbus")


def said(peer: TcpPeer | RtuPeer, *parts: str, t_ns: int = 0) -> str:
    """What a peer answers to hexadecimal text."""
    for part in parts:
        peer.take(bytes.fromhex(part), t_ns)
    answer = bytes(peer.answers).hex(" ")
    peer.answers.clear()
    return answer


def test_reads_over_tcp_by_hand() -> None:
    """Supply: 148.00 V is 14800 = 0x39D0, 0.35 A is 35 = 0x23; transaction, protocol, length, unit come back."""
    assert said(tcp(), "00 07 00 00 00 06 02 04 00 64 00 02") == "00 07 00 00 00 07 02 04 04 39 d0 00 23"


def test_writes_over_tcp_by_hand() -> None:
    """955.00 r/min is 95500 = 0x1_750C, low word first as the rig file says; function 16 answers address and count."""
    devices = bank()
    peer = tcp(devices)
    write = "00 08 00 00 00 0b 01 10 00 01 00 02 04 75 0c 00 01"
    assert said(peer, write) == "00 08 00 00 00 06 01 10 00 01 00 02"
    assert said(peer, "00 09 00 00 00 06 01 03 00 01 00 02") == "00 09 00 00 00 07 01 03 04 75 0c 00 01"
    assert said(peer, "00 0a 00 00 00 06 01 06 00 00 00 01") == "00 0a 00 00 00 06 01 06 00 00 00 01"
    assert devices.drives["drive"].state == "running"


@pytest.mark.parametrize(
    ("request_pdu", "response"),
    [
        ("01 03 00 05 00 01", "01 83 02"),  # no such holding register
        ("01 04 00 04 00 02", "01 84 02"),  # runs past the end
        ("01 04 00 00 00 00", "01 84 03"),  # none
        ("01 04 00 00 00 7e", "01 84 03"),  # 126
        ("01 10 00 00 00 01 02 00 09", "01 90 03"),  # command 9 is none
        ("01 10 00 00 00 02 02 00 01", "01 90 03"),  # two registers in two bytes
        ("01 10 00 63 00 01 02 00 01", "01 90 02"),
        ("02 06 00 64 00 01", "02 86 02"),  # an input register's address among the holding registers
        ("01 07", "01 87 01"),  # function 7
        ("01 03 00", "01 83 03"),  # short
        ("09 03 00 00 00 01", "09 83 0b"),  # nobody there
    ],
)
def test_refusals_by_hand(request_pdu: str, response: str) -> None:
    def header(text: str) -> str:
        return f"00 01 00 00 00 {len(bytes.fromhex(text)):02x} {text}"

    assert said(tcp(), header(request_pdu)) == header(response)


def test_a_refused_write_changes_nothing() -> None:
    peer = tcp()
    said(peer, "00 01 00 00 00 0d 01 10 00 00 00 03 06 00 09 11 11 22 22")
    assert said(peer, "00 02 00 00 00 06 01 03 00 00 00 03") == "00 02 00 00 00 09 01 03 06 00 00 00 00 00 00"


@pytest.mark.parametrize("head", ["00 01 00 01 00 06", "00 01 00 00 00 01", "00 01 00 00 01 00"])
def test_what_is_no_modbus_tcp_is_thrown_away(head: str) -> None:
    """Another protocol, too short, too long: nothing tells where the next request begins."""
    peer = tcp()
    assert said(peer, f"{head} 02 04 00 64 00 02") == ""
    assert peer.malformed == 12
    assert said(peer, "00 07 00 00 00 06 02 04 00 64 00 01") == "00 07 00 00 00 05 02 04 02 39 d0"


@pytest.mark.parametrize(("text", "check"), [("01 03 00 00 00 0a", "c5 cd"), ("11 03 00 6b 00 03", "76 87")])
def test_crc_of_the_textbooks(text: str, check: str) -> None:
    assert crc16(bytes.fromhex(text)).to_bytes(2, "little").hex(" ") == check


@given(st.binary(max_size=64))
def test_crc_is_pymodbus_s(data: bytes) -> None:
    assert crc16(data) == int.from_bytes(FramerRTU.compute_CRC(data).to_bytes(2, "big"), "little")


def framed(text: str) -> str:
    data = bytes.fromhex(text)
    return (data + crc16(data).to_bytes(2, "little")).hex(" ")


def test_rtu_answers_its_own_units_alone() -> None:
    peer = rtu()
    assert said(peer, framed("02 04 00 64 00 02")) == framed("02 04 04 39 d0 00 23")
    assert said(peer, framed("09 04 00 64 00 02")) == ""
    assert said(peer, framed("02 07")) == framed("02 87 01")


def test_broadcast_writes_and_is_not_answered() -> None:
    devices = bank()
    assert said(rtu(devices), framed("00 06 00 00 00 01")) == ""
    assert devices.drives["drive"].state == "running"


def test_rtu_goes_on_after_garbage_and_a_pause() -> None:
    peer, good = rtu(), framed("02 04 00 64 00 01")
    assert said(peer, "02 04 00 64 00 01 00 00", t_ns=0) == ""  # wrong check
    assert said(peer, "02 10 00", t_ns=0) == ""  # begins a frame that never ends
    assert said(peer, good, t_ns=SILENCE_NS) == ""  # no pause: belongs to it
    assert said(peer, good, t_ns=3 * SILENCE_NS) == framed("02 04 02 39 d0")
    assert peer.malformed > 8


def in_parts(data: bytes, sizes: list[int]) -> list[bytes]:
    parts = []
    for size in sizes:
        parts.append(data[:size])
        data = data[size:]
    return [*parts, data]


@given(SPLITS)
def test_any_split_gives_the_same(sizes: list[int]) -> None:
    requests = ["02 04 00 64 00 02", "01 10 00 01 00 02 04 75 0c 00 01", "01 03 00 00 00 03", "03 04 00 00 00 0a"]
    over_rtu = bytes.fromhex("".join(framed(r) for r in requests))
    over_tcp = b"".join(
        bytes((0, k, 0, 0, 0, len(pdu))) + pdu for k, pdu in enumerate(bytes.fromhex(r) for r in requests)
    )
    for make, data in ((tcp, over_tcp), (rtu, over_rtu)):
        whole, split = make(DEVICES), make(DEVICES)
        whole.take(data, 0)
        for part in in_parts(data, sizes):
            split.take(part, 0)
        assert split.answers == whole.answers
        assert len(whole.answers) > 30
        assert split.malformed == 0


DEVICES = bank()


@given(st.binary(max_size=600), SPLITS)
def test_any_bytes_do_no_harm(data: bytes, sizes: list[int]) -> None:
    for peer in (tcp(DEVICES), rtu(DEVICES)):
        for part in in_parts(data, sizes):
            peer.take(part, 0)
        assert len(peer._rest) <= LONGEST_RTU + 4
        peer.take(bytes(300), 0)
        peer.answers.clear()
        peer.take(bytes.fromhex("0009 0000 0006 02 04 0064 0001" if isinstance(peer, TcpPeer) else
                                framed("02 04 00 64 00 01")), 10 * SILENCE_NS)  # fmt: skip
        if isinstance(peer, RtuPeer):  # a line comes back after a pause, whatever was on it
            assert bytes(peer.answers) == bytes.fromhex(framed("02 04 02 39 d0"))


@given(st.binary(min_size=1, max_size=253), st.sampled_from([1, 2, 3]))
def test_any_request_is_answered_once_or_refused(pdu: bytes, unit: int) -> None:
    peer = tcp(DEVICES)
    peer.take(b"\0\x2a\0\0" + (len(pdu) + 1).to_bytes(2, "big") + bytes((unit,)) + pdu, 0)
    answer = bytes(peer.answers)
    assert answer[:4] == b"\0\x2a\0\0"
    assert len(answer) == 6 + int.from_bytes(answer[4:6], "big")
    assert answer[6] == unit
    assert answer[7] & 0x7F == pdu[0] & 0x7F
