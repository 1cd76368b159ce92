"""`bench serve` as a process of its own: endpoints, bytes on real sockets and ptys, signals, and what it refuses."""

from __future__ import annotations

import json
import os
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from bench.cli.__main__ import main
from bench.link.frames import empty_batch, payload
from bench.link.packetstream import PacketStream
from bench.link.slcanstream import SlcanStream
from bench.wire import packet, slcan
from sim_backend.serving import ptys

ROOT = Path(__file__).resolve().parents[2]
FREE = (
    "--link", "controller=slcan:socket://127.0.0.1:0", "--link", "fieldbus=modbus-tcp:127.0.0.1:0",
    "--link", "operator=line:127.0.0.1:0",
)  # fmt: skip
PATIENCE_S = 30.0  # before a test gives up waiting
IDENTITY = bytes.fromhex("0100 0200 00000000")  # protocol 1, map version 2, serial 0: simulated


@dataclass
class Served:
    """A running `bench serve` that has said `ready`."""

    child: subprocess.Popen[str]
    endpoints: list[str]

    def where(self, beginning: str) -> str:
        (found,) = [line.removeprefix(beginning) for line in self.endpoints if line.startswith(beginning)]
        return found

    @contextmanager
    def connected(self, beginning: str) -> Iterator[socket.socket]:
        host, _, port = self.where(beginning).rpartition(":")
        with socket.create_connection((host, int(port)), PATIENCE_S) as client:
            yield client

    def ended_by(self, number: signal.Signals) -> tuple[int, str]:
        """Exit status and standard error."""
        self.child.send_signal(number)
        _, err = self.child.communicate(timeout=PATIENCE_S)
        return self.child.returncode, err


@contextmanager
def serving(tmp_path: Path, *arguments: str, rig: str = "tsbs12") -> Iterator[Served]:
    with subprocess.Popen(
        [sys.executable, "-m", "bench.cli", "serve", rig, *FREE, *arguments], cwd=tmp_path, text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as child:  # fmt: skip
        assert child.stdout is not None
        try:
            lines: list[str] = []
            for line in child.stdout:
                if line == "ready\n":
                    break
                lines.append(line.rstrip("\n"))
            else:
                raise AssertionError(child.communicate()[1])
            yield Served(child, lines)
        finally:
            child.kill()


def heard(read: Callable[[], bytes], stream: SlcanStream | PacketStream, telemetry: int) -> list[np.void]:
    """Frames until that many telemetry messages and an Identity have come."""
    frames: list[np.void] = []
    count, identified = 0, False
    while count < telemetry or not identified:
        data = read()
        assert data, "the endpoint closed"
        batch = stream.feed(data, 0)
        count += int((batch["id"] == 0x100).sum())
        identified |= bool((batch["id"] == 0x023).any())
        frames += list(batch)
    return frames


def check(frames: list[np.void]) -> None:
    """The Identity, and telemetry without a gap: sequence +1, tick +10."""
    assert IDENTITY in [payload(f) for f in frames if f["id"] == 0x023]
    heads = [struct.unpack("<HI", payload(f)[:6]) for f in frames if f["id"] == 0x100]
    (first, tick), count = heads[0], len(heads)
    assert heads == [((first + k) & 0xFFFF, tick + 10 * k) for k in range(count)]


def identify(token: int) -> tuple[int, bytes]:
    return 0x011, struct.pack("<IBBH", 0x1100, 8, token, 0)


def test_hosts_on_tcp_and_an_operator_at_one_rig_until_ctrl_c(tmp_path: Path) -> None:
    with serving(tmp_path, "--seed", "4", "--visit", "2", "--truth", "K_i=70", "--truth-file", "truth.json") as rig:
        with (
            rig.connected("controller slcan:socket://") as can,
            rig.connected("controller serial:socket://") as serial,
            rig.connected("operator line:") as operator,
            rig.connected("fieldbus modbus-tcp:") as fieldbus,
        ):
            can.sendall(b"V\rS8\rY5\rO\r" + slcan.line(*identify(1), fd=True, brs=True) + b"F\r")
            serial.sendall(packet.packet(0, 0, [identify(2)]))
            stream = SlcanStream()
            check(heard(lambda: can.recv(65536), stream, 300))
            assert (stream.replies, stream.status, stream.malformed, stream.refused) == ([b"VSIM1"], 0, 0, 0)
            packets = PacketStream()
            check(heard(lambda: serial.recv(65536), packets, 300))
            assert (packets.crc_errors, packets.malformed, packets.packets_lost) == (0, 0, 0)
            fieldbus.sendall(bytes.fromhex("0007 0000 0006 02 04 0064 0001"))  # unit 2, input register 100: 148.00 V
            with fieldbus.makefile("rb") as answer:
                assert answer.read(11) == bytes.fromhex("0007 0000 0005 02 04 02 39D0")
            operator.sendall(b"hang M2\nask all right?\nhang M99\n")
            with operator.makefile() as answers:
                assert [next(answers) for _ in range(3)] == ["ok 0.3\n", "yes\n", "error cannot 'hang M99'\n"]
        status, err = rig.ended_by(signal.SIGINT)
    assert status == 0
    last = err.splitlines()[-1]
    assert last.startswith("SIGINT: stopped, controller OFF; bench time ")
    assert "received 2 (unknown 0)" in last
    assert "overruns" in last
    truth = json.loads((tmp_path / "truth.json").read_text())
    assert (truth["seed"], truth["visit"]) == (4, 2)
    assert truth["quantities"]["K_i"] == pytest.approx(70)


def test_the_amb_stand_is_served_like_the_other_rig(tmp_path: Path) -> None:
    with serving(tmp_path, "--truth", "supply_V=12", "--truth-file", "truth.json", rig="amb5dof") as rig:
        with (
            rig.connected("controller serial:socket://") as serial,
            rig.connected("operator line:") as operator,
            rig.connected("fieldbus modbus-tcp:") as fieldbus,
        ):
            serial.sendall(packet.packet(0, 0, [identify(2)]))
            check(heard(lambda: serial.recv(65536), PacketStream(), 100))
            fieldbus.sendall(bytes.fromhex("0007 0000 0006 02 04 0064 0001"))  # unit 2, input register 100: 12.00 V
            with fieldbus.makefile("rb") as answer:
                assert answer.read(11) == bytes.fromhex("0007 0000 0005 02 04 02 04B0")
            operator.sendall(b"ask all right?\nhang M2\n")
            with operator.makefile() as answers:
                assert [next(answers) for _ in range(2)] == ["yes\n", "error cannot 'hang M2'\n"]
        assert rig.ended_by(signal.SIGINT)[0] == 0
    assert json.loads((tmp_path / "truth.json").read_text())["values"]["supply_V"] == 12


@pytest.mark.skipif(not ptys.AVAILABLE, reason="no ptys here")
def test_hosts_on_ptys_and_a_fault_from_the_command_line_until_sigterm(tmp_path: Path) -> None:
    with serving(tmp_path, "--fault", "mute@0.2", "--fault", "drop=0.5@3600") as rig:
        can = os.open("/" + rig.where("controller slcan:/"), os.O_RDWR | os.O_NOCTTY)
        serial = os.open("/" + rig.where("controller serial:/"), os.O_RDWR | os.O_NOCTTY)
        try:
            packets = PacketStream()
            early = packets.feed(os.read(serial, 65536), 0)  # it is served from here on
            os.write(can, b"S8\rY5\rO\r" + slcan.line(*identify(1), fd=True, brs=True))
            check(heard(lambda: os.read(can, 65536), SlcanStream(), 300))
            others = heard(lambda: os.read(serial, 65536), packets, 300)  # it heard the other host's answer
            check([*early, *others])
            os.write(serial, packet.packet(0, 0, [identify(2)]))  # and is not answered any more
            late = empty_batch()
            while (late["id"] == 0x100).sum() < 700:
                late = np.concatenate([late, packets.feed(os.read(serial, 65536), 0)])
            assert not (late["id"] == 0x021).any()
        finally:
            os.close(can)
            os.close(serial)
        status, err = rig.ended_by(signal.SIGTERM)
    assert status == 0
    assert err.startswith("faults were injected on purpose: drop=0.5@3600, mute@0.2\n")
    assert "received 2 (unknown 0)" in err


@pytest.fixture
def busy() -> Iterator[int]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


def test_a_busy_port_is_a_usage_error_with_a_remedy(busy: int, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["serve", "tsbs12", *FREE, "--link", f"operator=line:127.0.0.1:{busy}"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"bench: link operator: port {busy} of 127.0.0.1: found it in use, perhaps by another")
    assert "--link operator=URL with port 0 takes any free one" in err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--bind", "203.0.113.7"), "expected an address of this host"),
        (
            ("--link", "controller=slcan:/dev/ttyACM0"),
            "expected controller=slcan:socket://HOST:PORT or serial:socket://HOST:PORT",
        ),
        (("--link", "controller=slcan:socket://127.0.0.1"), "HOST:PORT"),
        (("--link", "controller=slcan:socket://127.0.0.1:66000"), "HOST:PORT"),
        (("--link", "operator=modbus-tcp:127.0.0.1:1"), "expected operator=line:HOST:PORT"),
        (("--link", "fieldbus=modbus-rtu:/dev/ttyUSB0"), "expected fieldbus=modbus-tcp:HOST:PORT or modbus-rtu-tcp:"),
        (("--link", "controler=slcan:socket://127.0.0.1:0"), "NAME one of controller"),
        (("--link", "controller=slacn:socket://127.0.0.1:0"), "did you mean 'slcan:"),
        (("--truth", "K_x=70"), "--truth K_x: no such value"),
        (("--truth", 'K_i="much"'), "expected a number"),
        (("--fault", "drop=2"), "expected a share"),
        (("--fault", "dorp=0.2"), "did you mean 'drop'"),
        (("--truth-file", "no/such/folder/truth.json"), "--truth-file no/such/folder/truth.json: cannot be written"),
    ],
)
def test_what_cannot_be_served_is_a_usage_error(
    capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], told: str
) -> None:
    assert main(["serve", "tsbs12", *FREE, *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert told in err
    assert len(err.splitlines()) == 1


def test_no_such_rig(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["serve", "tsbs13"]) == 2
    assert "tsbs13" in capsys.readouterr().err
