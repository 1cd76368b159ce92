"""A controller in C, written from docs/reference/protocol.md alone, against frames written by hand, over SLCAN and
over packets; the same frames against the simulated controller."""

from __future__ import annotations

import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from cobs import cobs

from bench.link.frames import FD, frame, payload
from bench.rigfile import load_rig
from bench.wire import packet
from sim_backend.controller.controller import SimulatedController
from sim_backend.truth import draw

DEADLINE_S = 20.0
TRANSPORTS = ("slcan", "packets")

NAME = "6C 61 62 40 62 65 6E 63 68 37" + " 00" * 44  # lab@bench7
MINE = "D4 C3 B2 A1"  # session 0xA1B2C3D4
OTHER = "44 33 22 11"
BEGUN = "00 B9 55 69"  # 0x6955B900

# What is asked, and what is answered: identifier and payload.
CONVERSATION = [
    ("parameters can be read by anybody: 0x33 = 51 landing_speed, 5 = 0x40A00000",
     (0x013, "33 00 03 00"), [(0x022, "33 00 00 03 00 00 A0 40")]),
    ("and written by nobody while nobody owns it",
     (0x012, "32 00 00 00 80 3F 01 00"), [(0x022, "32 00 04 01 0A D7 A3 3D")]),  # 0.08 = 0x3DA3D70A
    ("Claim", (0x014, f"{MINE} {BEGUN} {NAME} 00 00"), [(0x024, f"{MINE} {BEGUN} {NAME} 00 00")]),
    ("the second is told who has it", (0x014, f"{OTHER} 01 00 00 00" + " 00" * 56), [(0x024, f"{MINE} {BEGUN} {NAME} 00 00")]),
    ("IDENTIFY", (0x011, f"{MINE} 08 07 00 00"), [(0x023, "01 00 02 00 34 12 00 00"), (0x021, "08 07 00 00")]),
    ("watchdog_s = 1 = 0x3F800000", (0x012, "32 00 00 00 80 3F 02 D4"), [(0x022, "32 00 00 02 00 00 80 3F")]),
    ("another's low byte", (0x012, "32 00 00 00 00 3F 02 44"), [(0x022, "32 00 04 02 00 00 80 3F")]),
    ("bias_i = 9 = 0x41100000 is too much, 3 = 0x40400000 stays",
     (0x012, "01 00 00 00 10 41 04 D4"), [(0x022, "01 00 02 04 00 00 40 40")]),
    ("bias_i = 5 = 0x40A00000 is the limit", (0x012, "01 00 00 00 A0 40 04 D4"), [(0x022, "01 00 00 04 00 00 A0 40")]),
    ("index 258 does not exist", (0x012, "02 01 00 00 80 3F 05 D4"), [(0x022, "02 01 01 05 00 00 00 00")]),
    ("nor for reading", (0x013, "02 01 06 00"), [(0x022, "02 01 01 06 00 00 00 00")]),
    ("LEVITATE in OFF", (0x011, f"{MINE} 02 08 00 00"), [(0x021, "02 08 03 00")]),
    ("ENABLE", (0x011, f"{MINE} 01 09 00 00"), [(0x021, "01 09 00 01")]),
    ("ENABLE again, byte for byte: answered again, executed once", (0x011, f"{MINE} 01 09 00 00"), [(0x021, "01 09 00 01")]),
    ("ENABLE with another token", (0x011, f"{MINE} 01 0A 00 00"), [(0x021, "01 0A 03 01")]),
    ("the second commands", (0x011, f"{OTHER} 02 0A 00 00"), [(0x021, "02 0A 04 01")]),
    ("session 0 commands", (0x011, "00 00 00 00 07 0A 00 00"), [(0x021, "07 0A 04 01")]),
    ("code 10 does not exist", (0x011, f"{OTHER} 0A 0B 00 00"), [(0x021, "0A 0B 01 01")]),
    ("a Command of seven bytes is nothing", (0x011, f"{MINE} 00 0B 00"), []),
    ("an identifier of somebody else", (0x7FF, "00"), []),
    ("a Heartbeat is not answered", (0x010, f"{MINE} 01 00 00 00"), []),
    ("MAKE_SAFE", (0x011, f"{MINE} 07 0C 00 00"), [(0x021, "07 0C 00 00")]),
    ("MAKE_SAFE in OFF", (0x011, f"{MINE} 07 0D 00 00"), [(0x021, "07 0D 00 00")]),
    ("RELEASE", (0x011, f"{MINE} 09 0D 00 00"), [(0x021, "09 0D 00 00")]),
    ("RELEASE again", (0x011, f"{MINE} 09 0D 00 00"), [(0x021, "09 0D 00 00")]),
    ("a Command with an unknown code takes nothing", (0x011, f"{OTHER} 0A 0E 00 00"), [(0x021, "0A 0E 01 00")]),
    ("one in a wrong state takes it", (0x011, f"{OTHER} 02 0F 00 00"), [(0x021, "02 0F 03 00")]),
    ("and it obeys that session", (0x014, f"{MINE} {BEGUN} {NAME} 00 00"), [(0x024, f"{OTHER} " + "00 " * 60)]),
    ("which lets it go", (0x011, f"{OTHER} 09 10 00 00"), [(0x021, "09 10 00 00")]),
    ("session 0 claims: there is nobody", (0x014, "00 " * 64), [(0x024, "00 " * 64)]),
]  # fmt: skip

# OFF; both sensor planes 200 um low (-10000 = 0xD8F0), 148 V = 0x39D0, 295 K = 0x733C; no seq, tick and host_age
RESTING = "00 00 F0 D8 00 00 F0 D8" + " 00" * 34 + " D0 39 3C 73 3C 73 3C 73 00 00 00 00 00 00"


class Wire:
    """The host's end of a byte stream to the program, frame by frame."""

    def __init__(self, stream: socket.socket, transport: str) -> None:
        self.stream, self.slcan = stream, transport == "slcan"
        self.other: list[bytes] = []  # lines that are no frames
        self.lengths: set[int] = set()  # of packets' contents
        self._rest, self._sequence = b"", 0
        self._heard = self._tick = 0  # of the next packet, at least
        self._frames: list[tuple[int, bytes]] = []
        stream.settimeout(DEADLINE_S)

    def encoded(self, identifier: int, payload: bytes) -> bytes:
        if self.slcan:
            length = {12: 9, 64: 15}.get(len(payload), len(payload))
            return f"b{identifier:03X}{length:X}{payload.hex().upper()}\r".encode()
        self._sequence += 1
        return packet.packet(self._sequence, 0, [(identifier, payload)])

    def send(self, *messages: tuple[int, str]) -> None:
        self.stream.sendall(b"".join(self.encoded(i, bytes.fromhex(text)) for i, text in messages))

    def receive(self) -> tuple[int, bytes]:
        """The next frame."""
        while not self._frames:
            *units, self._rest = (self._rest + self._read()).split(b"\r" if self.slcan else b"\0")
            for unit in units:
                self._take(unit)
        return self._frames.pop(0)

    def _read(self) -> bytes:
        data = self.stream.recv(65536)
        assert data, "the program has ended"
        return data

    def _take(self, unit: bytes) -> None:
        if not self.slcan:
            if unit:
                taken = packet.unpack(unit)
                assert taken.sequence == self._heard
                assert taken.tick >= self._tick
                self._heard, self._tick = taken.sequence + 1, taken.tick
                self.lengths.add(len(packet.content_of(unit)))
                self._frames += taken.messages
        elif unit.startswith(b"b"):
            self._frames.append((int(unit[1:4], 16), bytes.fromhex(unit[5:].decode())))
            assert (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)[int(unit[4:5], 16)] == len(unit[5:]) // 2
        else:
            self.other.append(unit)

    def answers(self, *messages: tuple[int, str]) -> list[tuple[int, bytes]]:
        """What comes back, telemetry left out; a ParamGet behind them tells the end."""
        self.send(*messages, (0x013, "FF FF EE 00"))
        found = []
        while (frame := self.receive()) != (0x022, bytes.fromhex("FF FF 01 EE 00 00 00 00")):
            if frame[0] != 0x100:
                found.append(frame)
        return found

    def telemetry(self) -> bytes:
        while (frame := self.receive())[0] != 0x100:
            pass
        return frame[1]


@contextmanager
def served(program: Path, transport: str) -> Iterator[Wire]:
    """The program on one end of a socket pair, open and ready to talk."""
    ours, theirs = socket.socketpair()
    with ours, theirs:
        child = subprocess.Popen([program, transport, str(theirs.fileno())], stdin=subprocess.PIPE,
                                 pass_fds=[theirs.fileno()])  # fmt: skip
        with child:
            theirs.close()
            wire = Wire(ours, transport)
            try:
                if transport == "slcan":
                    ours.sendall(b"S8\rY5\rO\r")
                yield wire
            finally:
                assert child.stdin
                child.stdin.close()  # which ends it
        assert child.returncode == 0


@pytest.fixture(params=TRANSPORTS)
def wire(program: Path, request: pytest.FixtureRequest) -> Iterator[Wire]:
    with served(program, request.param) as wire:
        yield wire


def states(wire: Wire, last: int, *beat: tuple[int, str]) -> tuple[list[int], int]:
    """The states until the last one, and the fault then. Each telemetry is answered by the given frames."""
    seen: list[int] = []
    deadline = time.monotonic() + DEADLINE_S
    while not seen or seen[-1] != last:
        assert time.monotonic() < deadline, seen
        m = wire.telemetry()
        if not seen or seen[-1] != m[56]:
            seen.append(m[56])
        wire.send(*beat)
    return seen, m[58]


def test_golden_frames(wire: Wire) -> None:
    for what, asked, answered in CONVERSATION:
        assert wire.answers(asked) == [(i, bytes.fromhex(text)) for i, text in answered], what


def test_the_simulated_controller_says_the_same() -> None:
    rig = load_rig("tsbs12")
    device = SimulatedController(rig, draw(rig, 1, {}))
    for what, (identifier, text), answered in CONVERSATION:
        said = device.advance(0, frame(identifier, bytes.fromhex(text), flags=FD), 0)
        found = [(int(f["id"]), comparable(int(f["id"]), payload(f))) for f in said]
        assert found == [(i, comparable(i, bytes.fromhex(text))) for i, text in answered], what


def comparable(identifier: int, content: bytes) -> bytes:
    """Without the serial number."""
    return content[:4] if identifier == 0x023 else content


def test_telemetry_at_rest(wire: Wire) -> None:
    first = None
    for _ in range(40):
        m = wire.telemetry()
        assert (m[6:62]).hex(" ").upper() == RESTING
        sequence, tick = int.from_bytes(m[:2], "little"), int.from_bytes(m[2:6], "little")
        assert tick == 10 * (sequence + 1)
        assert first is None or sequence == first + 1
        first = sequence
    assert wire.slcan or 141 in wire.lengths  # two messages in a packet, which has a CRC-32


def test_a_heartbeat_takes_nothing(wire: Wire) -> None:
    owned = wire.answers((0x010, f"{OTHER} 00 00 00 00"), (0x014, f"{MINE} {BEGUN} {NAME} 00 00"))
    assert owned == [(0x024, bytes.fromhex(f"{MINE} {BEGUN} {NAME} 00 00"))]


def test_a_silent_owner_at_rest_is_replaced(program: Path) -> None:
    with served(program, "packets") as wire:
        wire.answers((0x014, f"{MINE} {BEGUN} {NAME} 00 00"))
        asks = (0x014, f"{OTHER} 00 00 00 00 {NAME} 00 00")
        assert wire.answers(asks) == [(0x024, bytes.fromhex(f"{MINE} {BEGUN} {NAME} 00 00"))]
        while int.from_bytes(wire.telemetry()[62:64], "little") <= 1000:  # ms since its last sign of life
            pass
        assert wire.answers(asks) == [(0x024, bytes.fromhex(f"{OTHER} 00 00 00 00 {NAME} 00 00"))]


ASKED = "13 00 04 33 00 03 00"  # a ParamGet in a packet
BROKEN_CONTENTS = [
    f"02 00 00 00 00 00 00 {ASKED}",  # another version
    f"01 00 00 00 00 00 00 {ASKED} 13 00 05 33 00 03 00",  # runs past the end
    f"01 00 00 00 00 00 00 {ASKED} 13 00",  # ends in a head
    f"01 00 00 00 00 00 00 {ASKED} 13 08 04 33 00 03 00",  # identifier of 12 bits
    f"01 00 00 00 00 00 00 {ASKED} 10 00 41" + " 00" * 65,  # 65 bytes
    "01 00 00 00 00 00 00",  # no message
]
BROKEN_LINES = [
    *("b0134330003", "b013433000300\n", "b013433000X00", "t0139330003000000000000", "G", "b8134000000", "r0134"),
    *("T000000134330003000", "b" + "0" * 5000, "b0135330003000"),
]  # fmt: skip


def test_noise_and_broken_frames(wire: Wire) -> None:
    good = wire.encoded(0x013, bytes.fromhex("33 00 03 00"))
    if wire.slcan:
        noise = "".join(f"{line}\r" for line in BROKEN_LINES).encode()
    else:
        contents = [bytes.fromhex(text) for text in BROKEN_CONTENTS]
        noise = b"".join(cobs.encode(c + packet.crc(c)) + b"\0" for c in contents)
        wrong_crc = bytes([*good[:2], good[2] ^ 1, *good[3:]])
        noise += b"\x05\x01\0" + wrong_crc + b"\xff" * 5000 + b"\0" + good[:-3] + b"\0" + good[1:]
    wire.stream.sendall(noise)
    assert wire.answers((0x013, "33 00 03 00")) == [(0x022, bytes.fromhex("33 00 00 03 00 00 A0 40"))]


def test_adapter(program: Path) -> None:
    with served(program, "slcan") as wire:
        wire.answers()
        assert wire.other[:3] == [b"", b"", b""]
        wire.other.clear()
        wire.stream.sendall(b"S8\rC\rC\rF\rV\rN\rt0100\rS7\rS8\rY5\rZ1\rZ0\rO\rO\rF\rr0100\rR000000100\r")
        wire.answers()
        assert b"\r".join(wire.other) == (
            b"\a\r\rF00\rV1013\rN0001\r\a\a\r\r\r\r\r\aF00\rz\rZ\rz"  # BEL ends no line; the last is the ParamGet's
        )


def test_heartbeats_that_stand_still_are_a_dead_host(wire: Wire) -> None:
    half_a_second = (0x012, "32 00 00 00 00 3F 02 D4")  # watchdog_s, so that a busy machine is no dead host
    found = wire.answers((0x011, f"{MINE} 01 00 00 00"), half_a_second)
    assert found == [(0x021, bytes.fromhex("01 00 00 01")), (0x022, bytes.fromhex("32 00 00 02 00 00 00 3F"))]
    _, fault = states(wire, 7, (0x010, f"{MINE} 05 00 00 00"))
    assert fault == 4  # HEARTBEAT_LOST


def test_a_dead_host_while_it_spins(wire: Wire) -> None:
    setup = [(0x014, f"{MINE} {BEGUN} {NAME} 00 00"),
             (0x012, "23 00 00 00 20 41 01 D4"), (0x012, "32 00 00 00 00 3F 02 D4"),  # 10 rad/s, 0.5 s
             (0x011, f"{MINE} 01 03 00 00"), (0x011, f"{MINE} 02 04 00 00")]  # fmt: skip
    assert [payload[2] for _, payload in wire.answers(*setup)[1:]] == [0, 0, 0, 0]
    seen, counter = [0], 0
    asked = False
    deadline = time.monotonic() + DEADLINE_S
    while seen[-1] != 4:
        assert time.monotonic() < deadline, seen
        m = wire.telemetry()
        seen += [m[56]] if m[56] != seen[-1] else []
        counter += 1
        wire.send((0x010, f"{MINE} {counter & 255:02X} {counter >> 8:02X} 00 00"))
        if m[56] == 3 and not asked:
            asked = True
            wire.send((0x011, f"{MINE} 04 05 00 00"))  # SPIN
    assert seen[-3:] == [2, 3, 4]
    after, fault = states(wire, 7)
    assert after == [4, 6, 5, 7]  # SPINNING, COASTING, LANDING, FAULT
    assert fault == 4
    assert wire.answers((0x011, f"{MINE} 06 06 00 00")) == [(0x021, bytes.fromhex("06 06 00 00"))]  # CLEAR_FAULT
