"""Modbus as the simulated devices speak it: TCP, RTU frames over TCP, and RTU on a pty, in the served rig's own loop.

Written from the Modbus Application Protocol 1.1b3, the TCP implementation guide 1.0b and the serial line guide 1.02, and
on purpose not with the library that the drivers use: what both ends take from one place cannot be found wrong.
"""

from __future__ import annotations

import selectors
import struct
from collections.abc import Callable
from typing import Literal

from bench.link.frames import FrameBatch, empty_batch
from bench.rigfile import RigFile, linkurl
from bench.rigfile.registers import RegisterRefused, Table
from sim_backend.devices.registers import RegisterBank, RegisterBankDevice
from sim_backend.serving import ptys
from sim_backend.serving.peers import Sent
from sim_backend.serving.ports import Port, PtyPort, TcpPort

ILLEGAL_FUNCTION, ILLEGAL_VALUE, NO_DEVICE = 1, 3, 11
READS: dict[int, Table] = {3: "holding", 4: "input"}
WRITE_ONE, WRITE_MANY = 6, 16
MOST_READ, MOST_WRITTEN = 125, 123
LONGEST_PDU, LONGEST_RTU = 253, 256
SILENCE_NS = 50_000_000  # on a serial line: what came before a pause like that belongs to no frame that follows

Find = Callable[[int], RegisterBankDevice | None]


def answer(pdu: bytes, device: RegisterBankDevice) -> bytes:
    """The response of a device to a request, both without address and check."""
    code = pdu[0]
    try:
        if code in READS and len(pdu) == 5:
            return _read(code, pdu, device)
        if code == WRITE_ONE and len(pdu) == 5:
            address, word = struct.unpack(">HH", pdu[1:])
            device.write(address, (word,))
            return pdu
        if code == WRITE_MANY and len(pdu) >= 6:
            return _write(pdu, device)
    except RegisterRefused as error:
        return bytes((code | 0x80, error.code))
    known = code in READS or code in (WRITE_ONE, WRITE_MANY)
    return bytes((code | 0x80, ILLEGAL_VALUE if known else ILLEGAL_FUNCTION))


def _read(code: int, pdu: bytes, device: RegisterBankDevice) -> bytes:
    address, count = struct.unpack(">HH", pdu[1:])
    if not 1 <= count <= MOST_READ:
        return bytes((code | 0x80, ILLEGAL_VALUE))
    words = device.read(READS[code], address, count)
    return struct.pack(f">BB{count}H", code, 2 * count, *words)


def _write(pdu: bytes, device: RegisterBankDevice) -> bytes:
    address, count, size = struct.unpack(">HHB", pdu[1:6])
    if not 1 <= count <= MOST_WRITTEN or size != 2 * count or len(pdu) != 6 + size:
        return bytes((WRITE_MANY | 0x80, ILLEGAL_VALUE))
    device.write(address, struct.unpack(f">{count}H", pdu[6:]))
    return pdu[:5]


class TcpPeer:
    """One Modbus TCP client. `malformed` counts bytes that were thrown away because they begin no request."""

    on_bus = False

    def __init__(self, find: Find) -> None:
        self.answers = bytearray()
        self.malformed = 0
        self._find, self._rest = find, b""

    def take(self, data: bytes, t_ns: int) -> FrameBatch:
        """Answer the requests that end in `data`; any split of the bytes gives the same."""
        rest = self._rest + data
        while len(rest) >= 8:
            transaction, protocol, length, unit = struct.unpack(">HHHB", rest[:7])
            if protocol or not 2 <= length <= LONGEST_PDU + 1:  # no way to know where the next request begins
                self.malformed += len(rest)
                rest = b""
                break
            if len(rest) < 6 + length:
                break
            pdu, rest = rest[7 : 6 + length], rest[6 + length :]
            device = self._find(unit)
            said = answer(pdu, device) if device else bytes((pdu[0] | 0x80, NO_DEVICE))
            self.answers += struct.pack(">HHHB", transaction, 0, len(said) + 1, unit) + said
        self._rest = rest
        return empty_batch()

    def hear(self, sent: Sent) -> None:
        """It does not listen to the controller's bus."""


class RtuPeer:
    """One end of an RTU line. Frames for other units are not answered; unit 0 is every device, and none answers."""

    on_bus = False

    def __init__(self, bank: RegisterBank, link: str) -> None:
        self.answers = bytearray()
        self.malformed = 0
        self._bank, self._link = bank, link
        self._rest, self._last_ns = b"", 0

    def take(self, data: bytes, t_ns: int) -> FrameBatch:
        """Answer the requests that end in `data`. A frame whose check fails is dropped, with all up to the next pause."""
        if self._rest and t_ns - self._last_ns > SILENCE_NS:
            self.malformed += len(self._rest)
            self._rest = b""
        rest, self._last_ns = self._rest + data, t_ns
        while rest:
            length = request_length(rest)
            if length is None or len(rest) < length:
                break
            frame, rest = rest[:length], rest[length:]
            if crc16(frame[:-2]) != frame[-2] | frame[-1] << 8:
                self.malformed += len(frame) + len(rest)
                rest = b""
                break
            self._answer(frame[0], frame[1:-2])
        if len(rest) > LONGEST_RTU:
            self.malformed += len(rest)
            rest = b""
        self._rest = rest
        return empty_batch()

    def _answer(self, unit: int, pdu: bytes) -> None:
        if unit == 0:
            for each in self._bank.on(self._link):
                answer(pdu, each)
            return
        device = self._bank.device(self._link, unit)
        if device is not None:
            said = bytes((unit,)) + answer(pdu, device)
            self.answers += said + struct.pack("<H", crc16(said))

    def hear(self, sent: Sent) -> None:
        """It does not listen to the controller's bus."""


def request_length(data: bytes) -> int | None:
    """Bytes of the RTU request that `data` begins with, address and check included; None as long as that is open. A
    function that nobody here knows is taken to end where `data` ends, if the check says so."""
    if len(data) < 2:
        return None
    if data[1] <= 6:
        return 8
    if data[1] in (15, WRITE_MANY):
        return 9 + data[6] if len(data) > 6 else None
    whole = len(data) >= 4 and crc16(data[:-2]) == data[-2] | data[-1] << 8
    return len(data) if whole else None


def _crc_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = byte >> 1 ^ (0xA001 if byte & 1 else 0)
        table.append(byte)
    return tuple(table)


_CRC = _crc_table()


def crc16(data: bytes) -> int:
    """CRC-16/MODBUS: polynomial 0x8005 reflected, initial value 0xFFFF; sent low byte first."""
    crc = 0xFFFF
    for byte in data:
        crc = crc >> 8 ^ _CRC[(crc ^ byte) & 0xFF]
    return crc


def open_fieldbus(
    rig: RigFile, bank: RegisterBank, bind: str, selector: selectors.BaseSelector, ports: list[Port]
) -> None:
    """Open the endpoints of the register devices, into `ports` one by one. The TCP port that the rig file's URL names is
    taken for its scheme; everything else takes any free one.

    Raises:
        ConfigError: a port is in use, or `bind` is no address of this host.
    """
    for link in bank.links:
        url = linkurl.parse(rig.links[link].url)

        def tcp(link: str = link) -> TcpPeer:
            return TcpPeer(lambda unit: bank.device(link, unit))

        def rtu(link: str = link) -> RtuPeer:
            return RtuPeer(bank, link)

        makers: tuple[tuple[Literal["modbus-tcp", "modbus-rtu-tcp"], Callable[[], TcpPeer | RtuPeer]], ...]
        makers = (("modbus-tcp", tcp), ("modbus-rtu-tcp", rtu))
        for scheme, peer in makers:
            port = url.address[1] if url.scheme == scheme else 0
            ports.append(TcpPort(f"{link} {scheme}:{{}}", (bind, port), peer, selector))
        if ptys.AVAILABLE:
            ports.append(PtyPort(f"{link} modbus-rtu:{{}}", rtu, selector))
