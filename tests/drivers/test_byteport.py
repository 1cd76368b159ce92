"""Byte streams: what they give, how they end, and what it is called when they cannot be opened."""

from __future__ import annotations

import errno
import fcntl
import os
import re
import socket
import struct
import subprocess
import sys
import termios
import threading
from collections.abc import Iterator
from contextlib import suppress

import pytest
import serial
import serial.rfc2217
from far_end import FarEnd, descriptors, far_end, until

from bench.errors import ConfigError, LinkError
from drivers import byteport, portfaults
from drivers.byteport import BytePort
from drivers.pace import Pace

LONG_S = 30.0
KINDS = pytest.mark.parametrize("end", [False, True], indirect=True, ids=["pty", "tcp"])


@pytest.fixture
def port(end: FarEnd) -> Iterator[BytePort]:
    port = BytePort.open(end.where)
    if end.where.startswith("socket"):
        end.wait(lambda f: f.clients == 1)
    yield port
    port.close()


def waiting(port: BytePort) -> int:
    """Bytes that one read would give."""
    return int(struct.unpack("i", fcntl.ioctl(port.fileno() or 0, termios.FIONREAD, b"\0\0\0\0"))[0])


def insist(port: BytePort) -> None:
    """TCP takes a write before it learns."""
    for _ in range(100):
        port.write(b"x" * 1000)


def read(port: BytePort, size: int) -> bytes:
    data = b""
    while len(data) < size:
        part = port.read(LONG_S)
        assert part, "nothing came"
        data += part
    return data


@KINDS
def test_bytes_pass_both_ways(end: FarEnd, port: BytePort) -> None:
    end.write(b"\x00\x03\x04\x11\x13\x1a\r\n\xff")  # what a terminal would take as control characters
    assert read(port, 9) == b"\x00\x03\x04\x11\x13\x1a\r\n\xff"
    port.write(b"\x00\x03\r\n\x13")
    end.wait_for(b"\x00\x03\r\n\x13")


@KINDS
def test_much_arrives_whole(end: FarEnd, port: BytePort) -> None:
    data = os.urandom(300_000)
    writer = threading.Thread(target=end.write, args=(data,))
    writer.start()
    assert read(port, len(data)) == data
    writer.join()
    writer = threading.Thread(target=port.write, args=(data,))
    writer.start()
    end.wait(lambda f: len(f.received) == len(data))
    writer.join()
    assert end.received == data


def test_a_full_buffer_with_nothing_behind_it_is_not_the_end(end: FarEnd, port: BytePort) -> None:
    """A pty gives 4095 bytes at most, so more may wait; when none does, a serial port answers as it would at its end."""
    end.write(b"x" * 4095)
    until(lambda: waiting(port) == 4095)
    assert port.read(LONG_S) == b"x" * 4095
    assert port.read(0.0) == b""


@KINDS
def test_without_data_a_read_ends_by_its_timeout(end: FarEnd, port: BytePort) -> None:
    assert port.read(0.0) == b""
    assert port.read(0.01) == b""


@KINDS
def test_cancel_ends_a_read_that_waits_and_else_the_next(end: FarEnd, port: BytePort) -> None:
    got: list[bytes] = []
    reader = threading.Thread(target=lambda: got.append(port.read(LONG_S)))
    reader.start()
    port.cancel()
    reader.join(LONG_S / 2)
    assert got == [b""]
    port.cancel()
    port.cancel()
    assert port.read(LONG_S) == b""
    end.write(b"on")
    assert read(port, 2) == b"on"


@KINDS
def test_the_other_end_closing_ends_a_read_that_waits(end: FarEnd, port: BytePort) -> None:
    errors: list[str] = []

    def wait() -> None:
        with pytest.raises(LinkError) as caught:
            port.read(LONG_S)
        errors.append(str(caught.value))

    reader = threading.Thread(target=wait)
    reader.start()
    end.hang_up()
    reader.join(LONG_S / 2)
    assert len(errors) == 1
    assert f"port {end.where} was unplugged or its other end closed" in errors[0]
    with pytest.raises(LinkError, match="unplugged or its other end closed"):
        insist(port)


def test_what_came_before_the_end_comes_first() -> None:
    with far_end(True) as end:
        port = BytePort.open(end.where)
        end.wait(lambda f: f.clients == 1)
        data = os.urandom(50_000)
        end.write(data)
        end.hang_up()
        assert read(port, len(data)) == data
        with pytest.raises(LinkError):
            port.read(LONG_S)
        port.close()


def test_what_came_before_a_reset_comes_first() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = BytePort.open(f"socket://127.0.0.1:{server.getsockname()[1]}")
        other, _ = server.accept()
        other.sendall(b"x" * 5000)
        until(lambda: waiting(port) == 5000)
        other.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        other.close()
        assert read(port, 5000) == b"x" * 5000
        with pytest.raises(LinkError, match="unplugged or its other end closed"):
            port.read(LONG_S)
        port.close()


@KINDS
def test_an_end_that_does_not_read_is_an_error(end: FarEnd, port: BytePort, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(byteport, "WRITE_S", 0.05)
    end.reading.clear()
    with pytest.raises(LinkError, match=r"takes no data for 0\.05 s: its other end does not read"):
        port.write(b"x" * 30_000_000)


@KINDS
def test_close_leaves_nothing_open_and_ends_everything(end: FarEnd) -> None:
    before = descriptors()
    port = BytePort.open(end.where)
    if end.where.startswith("socket"):
        end.wait(lambda f: f.clients == 1)
        before |= {d for d in descriptors() if d.split()[0] == str(end._end)}
    assert port.fileno() is not None
    port.close()
    port.close()
    port.cancel()
    assert descriptors() <= before
    assert port.fileno() is None
    for call in (lambda: port.read(LONG_S), lambda: port.write(b"x")):
        with pytest.raises(LinkError, match="is closed"):
            call()


def test_a_descriptor_over_1023_can_be_waited_on(end: FarEnd) -> None:
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard < 1200:
        pytest.skip("this system allows fewer descriptors")
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, 1200), hard))
    filling = [os.dup(0)]
    try:
        while filling[-1] < 1030:
            filling.append(os.dup(0))
        port = BytePort.open(end.where)
        assert (port.fileno() or 0) > 1023
        end.write(b"high")
        assert read(port, 4) == b"high"
        port.close()
    finally:
        for number in filling:
            os.close(number)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_without_a_descriptor_pyserial_reads() -> None:
    """As RFC 2217 and Windows do; `loop://` is pyserial's own port without one."""
    port = BytePort.open("loop://")
    assert port.fileno() is None
    port.write(b"through pyserial")
    assert read(port, 16) == b"through pyserial"
    assert port.read(0.0) == b""
    port.cancel()
    assert port.read(LONG_S) == b""
    port.serial.close()
    with pytest.raises(LinkError, match="unplugged"):
        port.read(LONG_S)
    port.close()


class Rfc2217Server:
    """A device server with an echoing serial port, by pyserial's own server side of the protocol."""

    def __init__(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.where = f"rfc2217://127.0.0.1:{self._listener.getsockname()[1]}"
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def write(self, data: bytes) -> None:
        self.client.sendall(data)

    def _run(self) -> None:
        self.client, _ = self._listener.accept()
        echo = serial.serial_for_url("loop://", timeout=0)
        manager = serial.rfc2217.PortManager(echo, self)
        with suppress(ConnectionResetError):  # the client may close before it has read everything
            while data := self.client.recv(4096):
                if plain := b"".join(manager.filter(data)):
                    self.write(b"".join(manager.escape(plain)))
        self.client.close()

    def hang_up(self) -> None:
        self.client.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        self._thread.join(5.0)
        self._listener.close()


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # pyserial 3.5 names its thread the old way
def test_rfc2217_passes_bytes_and_tells_its_end() -> None:
    server = Rfc2217Server()
    port = BytePort.open(server.where, baudrate=9600)
    assert port.fileno() is None
    port.write(b"\xff\x00over telnet\r\n")
    assert read(port, 15) == b"\xff\x00over telnet\r\n"
    server.hang_up()
    with pytest.raises(LinkError, match="unplugged or its other end closed"):
        until(lambda: port.read(0.1) != b"")
    port.close()
    server.close()


@pytest.mark.parametrize(
    ("where", "says"),
    [
        (
            "/dev/ttyLEV7",
            r"port /dev/ttyLEV7: found no such device; (there are no serial ports|expected one of|did you)",
        ),
        ("/etc/hostname", "found something that is no serial port"),
        ("/", "port /: "),
        ("sokcet://127.0.0.1:28501", r"protocol 'sokcet' not known; expected a device, socket://HOST:PORT or rfc2217"),
        ("socket://127.0.0.1", r"expected socket://HOST:PORT, such as socket://127\.0\.0\.1:28501"),
        ("socket://127.0.0.1:http", "expected socket://HOST:PORT"),
        ("socket://127.0.0.1:65536", "expected socket://HOST:PORT"),
        ("socket://no-such-host.invalid:5", "no host of that name; correct the link's URL"),
        ("socket://" + "a" * 70 + ":5", "port socket://aaa"),
        ("rfc2217://127.0.0.1:1", "port rfc2217://127.0.0.1:1: "),
    ],
)
def test_a_port_that_is_none_says_so_in_one_line(where: str, says: str) -> None:
    before = descriptors()
    with pytest.raises(ConfigError, match=says) as caught:
        BytePort.open(where)
    assert "\n" not in str(caught.value)
    assert descriptors() == before


def test_nobody_listening_names_the_remedy() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        where = f"socket://127.0.0.1:{server.getsockname()[1]}"
    with pytest.raises(ConfigError, match="nobody listens there; start `bench serve`"):
        BytePort.open(where)


def test_a_busy_port_names_its_owner_not_whoever_serves_the_pty(end: FarEnd) -> None:
    holder = "import serial, sys; p = serial.Serial(sys.argv[1], exclusive=True); print('held', flush=True); input(); p.close()"
    command = [sys.executable, "-c", holder, end.where]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"held\n"
        says = rf"port {end.where}: it is in use by process {other.pid} \({re.escape(sys.executable)}.*end that process"
        with pytest.raises(ConfigError, match=says):
            BytePort.open(end.where)
        other.communicate(b"\n")
    BytePort.open(end.where).close()


def test_a_port_that_this_process_holds(port: BytePort) -> None:
    with pytest.raises(ConfigError, match="in use by this process"):
        BytePort.open(port.where)


def test_a_shared_port_can_be_opened_twice(port: BytePort) -> None:
    BytePort.open(port.where, exclusive=False).close()


def test_no_permission_names_the_remedy(end: FarEnd) -> None:
    error = OSError(errno.EACCES, "Permission denied")
    text = str(portfaults.not_opened(end.where, 9600, error, list))
    assert text.startswith(f"port {end.where}: no permission to open it; it belongs to the group ")
    assert "usermod -a -G" in text


def test_windows_says_busy_in_words() -> None:
    error = OSError("could not open port 'COM3': PermissionError(13, 'Access is denied.', None, 5)")
    assert "COM3: it is in use by another process" in str(portfaults.not_opened("COM3", 9600, error, list))


def test_a_near_miss_is_suggested() -> None:
    error = OSError(errno.ENOENT, "No such file")
    text = str(portfaults.not_opened("/dev/ttyACM1", 9600, error, lambda: ["/dev/ttyACM0", "/dev/ttyS0"]))
    assert text.endswith("did you mean /dev/ttyACM0?")


def test_a_single_read_is_never_held_up_and_a_stream_is_taken_in_portions() -> None:
    now, sleeps = [0.0], []

    def sleep(seconds: float) -> None:
        sleeps.append(seconds)
        now[0] += seconds

    pace = Pace(0.001, lambda: now[0], sleep)
    for _ in range(100):  # one every two periods
        now[0] += 0.002
        pace.wait()
    assert sleeps == []
    begun, calls = now[0], 0
    while now[0] < begun + 1.0:  # one every 0.1 ms, if it were let
        now[0] += 0.0001
        pace.wait()
        calls += 1
    assert 900 <= calls <= 1010
