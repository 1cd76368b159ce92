"""A served rig in the test's own hands: its clock, its endpoints on real sockets, and hosts at them."""

from __future__ import annotations

import selectors
import socket
import struct
import time
from collections.abc import Callable

import numpy as np

from bench.link.fault_injection import parse
from bench.link.frames import FrameBatch, empty_batch, payload
from bench.link.packetstream import PacketStream
from bench.link.slcanstream import SlcanStream
from bench.rigfile import RigFile, load_rig
from bench.wire import packet, slcan
from sim_backend.controller.controller import SimulatedController
from sim_backend.serving.adapter import SlcanAdapter
from sim_backend.serving.loop import Server
from sim_backend.serving.peers import PacketPeer
from sim_backend.serving.ports import Port, TcpPort
from sim_backend.serving.wirefaults import WireFaults
from sim_backend.truth import draw

SECOND = 1_000_000_000
MS = 1_000_000
T0 = 1_767_225_600 * SECOND
LOOPBACK = ("127.0.0.1", 0)
RIG: RigFile = load_rig("tsbs12")
SET_UP = b"S8\rY5\rO\r"
PATIENCE_S = 10.0  # before a test gives up waiting; nothing takes so long


def adapter(**options: Callable[[], bool]) -> SlcanAdapter:
    return SlcanAdapter(1_000_000, 5_000_000, **options)


def address_of(port: Port) -> tuple[str, int]:
    host, _, number = port.line.partition("//")[2].rpartition(":")
    return host, int(number)


class Hands:
    """A clock that stands still until the test moves it."""

    def __init__(self) -> None:
        self.now = T0

    def now_ns(self) -> int:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += round(seconds * 1e9)


class Bus:
    """A served rig with an SLCAN and a serial endpoint on real sockets, on the test's clock."""

    def __init__(self, selector: selectors.BaseSelector, ports: list[Port], *faults: str) -> None:
        wire = WireFaults([parse(text) for text in faults], 1, [0x100])
        self.slcan = TcpPort("controller slcan:socket://{}", LOOPBACK, lambda: adapter(bus_off=wire.bus_off), selector)
        ports.append(self.slcan)
        self.serial = TcpPort("controller serial:socket://{}", LOOPBACK, lambda: PacketPeer(wire.corrupt), selector)
        ports.append(self.serial)
        self.clock = Hands()
        self.lines: list[str] = []
        self.ticked: list[int] = []
        self.device = SimulatedController(RIG, draw(RIG, 5, {}))
        self.clients: list[Client] = []
        self.server = Server(RIG, self.device, selector, ports, self.clock, self.lines.append, [self], wire)

    def start(self) -> tuple[str, ...]:
        return ()

    def tick(self, now_ns: int) -> None:
        self.ticked.append(now_ns)

    def stop(self) -> None:
        pass

    def client(self, port: TcpPort) -> Client:
        made = Client(self, port)
        self.clients.append(made)
        self.until(lambda: len(port.connections) == len([c for c in self.clients if c.port is port]))
        if port is self.slcan:
            made.send(SET_UP)
        return made

    def run(self, seconds: float, each: Callable[[], object] = lambda: None) -> None:
        """So much wall time, in slices of 2 ms."""
        for _ in range(round(seconds * 500)):
            self.clock.now += 2 * MS
            each()
            self.server.step()
            for client in self.clients:
                client.read()

    def until(self, condition: Callable[[], bool]) -> None:
        """Slices that take no time, for bytes that are on their way."""
        deadline = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < deadline
            self.server.step()
            for client in self.clients:
                client.read()


class Client:
    """A host at one endpoint; takes both formats apart."""

    def __init__(self, bus: Bus, port: TcpPort) -> None:
        self.bus, self.port = bus, port
        self.socket = socket.create_connection(address_of(port), PATIENCE_S)
        self.socket.setblocking(False)
        self.stream: SlcanStream | PacketStream = SlcanStream() if port is bus.slcan else PacketStream()
        self.frames: FrameBatch = empty_batch()
        self.closed, self.reading, self._count = False, True, 0

    def read(self) -> None:
        while self.reading and not self.closed:
            try:
                data = self.socket.recv(1 << 20)
            except BlockingIOError:
                return
            self.closed = not data
            self.frames = np.concatenate([self.frames, self.stream.feed(data, 0)])

    def send(self, data: bytes) -> None:
        """Write; the loop has taken it when this returns."""
        before = self.bus.server.heard
        self.socket.sendall(data)
        lines = data.count(b"b")
        self.bus.until(lambda: self.bus.server.heard >= before + lines)

    def message(self, identifier: int, data: bytes) -> bytes:
        if isinstance(self.stream, PacketStream):
            self._count += 1
            return packet.packet(self._count, 0, [(identifier, data)])
        return slcan.line(identifier, data, fd=True, brs=True)

    def command(self, code: int) -> None:
        self.socket.sendall(self.message(0x011, struct.pack("<IBBH", 0x11, code, code, 0)))
        self.bus.until(lambda: any(r[1] == code for r in self.of(0x021)))

    def beat(self) -> None:
        self._count += 1
        self.socket.sendall(self.message(0x010, struct.pack("<IHH", 0x11, self._count & 0xFFFF, 0)))

    def of(self, identifier: int) -> list[bytes]:
        return [payload(f) for f in self.frames[self.frames["id"] == identifier]]

    def sequences(self) -> list[int]:
        return [int.from_bytes(p[:2], "little") for p in self.of(0x100)]
