"""The served rig: one loop that takes what clients wrote, runs the controller, and sends what it said."""

from __future__ import annotations

import selectors
import time
from collections.abc import Callable, Sequence

import numpy as np

from bench.clock import Clock
from bench.link.frames import FrameBatch, empty_batch, frame
from bench.rigfile import RigFile
from bench.wire import sign
from sim_backend.controller.controller import SimulatedController
from sim_backend.serving.connection import Connection
from sim_backend.serving.pacing import Pacer
from sim_backend.serving.peers import Sent, joined
from sim_backend.serving.ports import Port
from sim_backend.serving.service import Service
from sim_backend.serving.wirefaults import WireFaults

LOOK_NS = 20_000_000
REPORT_NS = 10_000_000_000


class Server:
    """A simulated controller, its ports and services in real time, all in the caller's thread.

    Args:
        rig: what is served.
        controller: the device.
        selector: what the ports registered with.
        ports: the endpoints.
        clock: wall time; nothing else in here asks for the time of day.
        say: takes a line of status.
        services: what else is served.
        faults: injected between the controller and its clients.
    """

    def __init__(
        self, rig: RigFile, controller: SimulatedController, selector: selectors.BaseSelector,
        ports: Sequence[Port], clock: Clock, say: Callable[[str], None], services: Sequence[Service] = (),
        faults: WireFaults | None = None,
    ) -> None:  # fmt: skip
        self.controller, self.ports, self.services = controller, ports, services
        self.pacer = Pacer(clock.now_ns(), controller.tick_ns)
        self.heard = self.sent = self.unknown = 0
        self._lost = 0  # frames that clients no longer here did not read
        self._selector, self._clock, self._say = selector, clock, say
        self._faults = faults or WireFaults()
        self._plugged = True
        self._own_ports = [p for p in ports if p.link == rig.devices["controller"].link]
        self._known = np.array([*controller.hears], np.uint32)
        self._brs = rig.link.data_bitrate is not None
        self._shown = (controller.state, controller.fault)
        self._look_ns = self._told_ns = clock.now_ns()
        self._cpu = time.process_time()
        self._told = (0, 0)
        self._drops = 0
        self._sign_ns = 0  # when the sign of a simulation is due

    def run(self, stopped: Callable[[], bool]) -> None:
        """Serve until told to stop; a signal ends the wait of at most a slice."""
        while not stopped():
            self.step(self.pacer.wait_s(self._clock.now_ns()))

    def step(self, wait_s: float = 0.0) -> None:
        """One slice: it starts when `wait_s` have passed or a client wrote, so that requests are answered at once."""
        events = self._selector.select(wait_s)
        now = self._clock.now_ns()
        heard: list[tuple[Connection, FrameBatch]] = []
        for key, _ in events:
            port, connection = key.data
            if connection is None:
                port.wake()
            else:
                heard.append((connection, connection.receive(now)))
        if now - self._look_ns >= LOOK_NS or now < self._look_ns:
            self._look_ns = now
            self._look()
        self._advance(now, heard)
        for port in self.ports:
            for connection in list(port.connections):
                connection.flush()
                if connection.closed:
                    self._end(port, connection)
        self._tell(now)

    def _advance(self, now: int, heard: list[tuple[Connection, FrameBatch]]) -> None:
        """Run the controller up to now; frames reach it at the tick at which they came."""
        ticks = self.pacer.due(now)
        begin = self.pacer.bench_ns() - ticks * self.pacer.tick_ns
        frames = joined([batch for _, batch in heard])
        self.heard += len(frames)
        frames = self._faults.heard(frames, now)
        known = frames[np.isin(frames["id"], self._known)] if len(frames) else frames
        self.unknown += len(frames) - len(known)
        if ticks or len(known):
            said = self.controller.advance(ticks, known, begin)
            self.sent += len(said)
            self._deliver(joined([said, self._sign()]), now)
        for source, batch in heard:
            if len(batch) and source.peer.on_bus:
                self._pass_on(source, Sent(batch, 0, self._brs))

    def _sign(self) -> FrameBatch:
        """What says that this is a simulation, when it is due."""
        now = self.pacer.bench_ns()
        if now < self._sign_ns:
            return empty_batch()
        self._sign_ns = now + round(sign.PERIOD_S * 1e9)
        return frame(sign.IDENTIFIER, sign.PAYLOAD, t_ns=now)

    def _deliver(self, said: FrameBatch, now: int) -> None:
        """What the controller sent, to everybody who listens."""
        can, serial = self._faults.said(said, now)
        if not len(can) and not len(serial):
            return
        tick = self.controller.plant.tick
        on_can = Sent(can, tick, self._brs)
        on_serial = on_can if serial is can else Sent(serial, tick, self._brs)
        for port in self._own_ports:
            for connection in port.connections:
                connection.hear(on_can if connection.peer.on_bus else on_serial)

    def _pass_on(self, source: Connection, sent: Sent) -> None:
        """An adapter's frames to the other adapters on the bus."""
        for port in self._own_ports:
            for connection in port.connections:
                if connection is not source and connection.peer.on_bus:
                    connection.hear(sent)

    def _end(self, port: Port, connection: Connection) -> None:
        self._lost += connection.dropped
        port.end(connection)

    def _look(self) -> None:
        if self._plugged == self._faults.unplugged:
            self._plugged = not self._plugged
            for port in self._own_ports:
                for connection in list(port.connections):
                    self._end(port, connection)
                port.plug(self._plugged)
                self._say(f"{self._bench_s():.3f} s: {port.line} is {'there again' if self._plugged else 'gone'}")
        for port in self.ports:
            port.look()
        for service in self.services:
            service.tick(self.pacer.bench_ns())

    def _tell(self, now: int) -> None:
        """Status: changes at once; at most every ten seconds what went wrong. No news is good news."""
        shown = (self.controller.state, self.controller.fault)
        if shown != self._shown:
            fault = "" if shown[1] == "NONE" else f", fault {shown[1]}"
            self._say(f"{self._bench_s():.3f} s: {self._shown[0]} -> {shown[0]}{fault}")
            self._shown = shown
        if self.pacer.drops != self._drops:
            self._drops = self.pacer.drops
            self._say(
                f"{self._bench_s():.3f} s: over ten seconds behind wall time; gave up catching up, "
                f"{self.pacer.dropped_ns * 1e-9:.1f} s so far"
            )
        if now - self._told_ns >= REPORT_NS:
            self._told_ns, before, self._told = now, self._told, (self.pacer.overruns, self.unread)
            if self._told != before:
                self._say(self.statistics())

    def _bench_s(self) -> float:
        return self.pacer.ticks * self.pacer.tick_ns * 1e-9

    @property
    def unread(self) -> int:
        """Frames that clients did not read in time."""
        return self._lost + sum(c.dropped for port in self.ports for c in port.connections)

    def statistics(self) -> str:
        """One line: bench time, share of a core, clients, frames, overruns; all since the start."""
        wall = self._clock.now_ns() - self.pacer.start_ns
        load = (time.process_time() - self._cpu) * 1e11 / wall if wall > 0 else 0.0
        p = self.pacer
        return (
            f"bench time {self._bench_s():.1f} s, load {load:.0f} %, clients {sum(len(o.connections) for o in self.ports)}, "
            f"frames sent {self.sent}, received {self.heard} (unknown {self.unknown}), not read {self.unread}, "
            f"overruns {p.overruns} (worst {p.worst_ns * 1e-6:.0f} ms), time given up {p.dropped_ns * 1e-9:.1f} s"
        )
