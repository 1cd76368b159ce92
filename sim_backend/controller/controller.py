"""The simulated controller: bytes in, bytes out. Its states, parameters, telemetry and captures around the plant. It has its
own copy of the message map and shares no object with the driver."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import cast

from bench.link.codec import encode
from bench.link.fault_injection import Fault
from bench.link.frames import FD, FrameBatch, by_time, empty_batch, frame, joined
from bench.link.segments import of_controller
from bench.rigfile import RigFile
from bench.rigfile.messages import load_messages
from sim_backend.controller.bound_telemetry import BoundTelemetry
from sim_backend.controller.capture_port import CapturePort
from sim_backend.controller.device_faults import DeviceFaults
from sim_backend.controller.ownership import Ownership
from sim_backend.controller.parameters import Parameters
from sim_backend.controller.requests import MAP_VERSION, Requests
from sim_backend.controller.states import States
from sim_backend.controller.telemetry import Span, TelemetryEncoder
from sim_backend.core import Array
from sim_backend.machine import TracedPlant, Truth
from sim_backend.spoken import own_words, reading_of, told_as

__all__ = ["MAP_VERSION", "SimulatedController"]
REST_S = 0.5  # it has been on for so long when the host connects: the rotor lies still on its rings


class SimulatedController:
    """The device end of the rig's link.

    Args:
        rig: its message map and parameters.
        truth: which machine it has.
        faults: that happen inside it (`bench.link.fault_injection`): reboot, stuck-heartbeat, mute.
        substeps: integration steps of the plant in a tick.

    Raises:
        ConfigError: a fault of another kind.
    """

    def __init__(self, rig: RigFile, truth: Truth, faults: Sequence[Fault] = (), substeps: int = 2) -> None:
        self._rig, self._map = rig, load_messages(rig.dbc_text, classic=rig.link.classic)
        self.truth = truth
        self._machine = truth.machine
        self.plant = self._machine.make(truth.plant, truth.noise, substeps)
        self.tick_ns = round(self.plant.tick_s * 1e9)
        self.plant.run(round(REST_S / self.plant.tick_s))
        self.faults = DeviceFaults(rig, faults, self.plant) if faults else None
        self.captures: CapturePort | None = None
        self._own_words = own_words(self._map, self._machine, rig.binding)
        self._held = empty_batch()
        self._segments = of_controller(self._map) if rig.link.classic and rig.capture is not None else None
        self.restart()
        self._owner.heartbeat = 0  # it has been on since then
        self._encoder: TelemetryEncoder | BoundTelemetry
        if self._own_words:
            self._encoder = TelemetryEncoder(self._map, truth, self.plant.tick)
        else:
            self._encoder = BoundTelemetry(rig, self._map, truth, self.plant)
        self._out: list[FrameBatch] = []
        self._spans: list[Span] = []

    @property
    def hears(self) -> frozenset[int]:
        """Identifiers of the messages that it takes from hosts."""
        return self._requests.hears

    def advance(self, ticks: int, incoming: FrameBatch, t0_ns: int) -> FrameBatch:
        """Run for `ticks`; frames are taken at their `t_ns`, which counts from `t0_ns` at the present tick.

        Returns:
            What the controller sent, with its times.
        """
        answers = incoming[:0]
        if self._segments is not None:
            incoming, answers = self._segments.incoming(incoming)
        sent = (
            self.run(ticks, incoming, t0_ns)
            if self.faults is None
            else self.faults.advance(self, ticks, incoming, t0_ns)
        )
        if self._segments is None:
            return sent
        return by_time(joined([self._segments.outgoing(sent), answers]))

    def run(self, ticks: int, incoming: FrameBatch, t0_ns: int) -> FrameBatch:
        """`advance` as if there were no faults."""
        start = self.plant.tick
        self._out, self._spans = [], []
        clock = (t0_ns, start)
        tell = partial(self._send, clock)
        # A heartbeat comes every 20 ms: plain numbers and bytes here, for each look into an array costs ten times as much.
        columns = [incoming[name].tolist() for name in ("t_ns", "id", "length")]
        payloads = incoming["data"].tobytes()
        for k, (t_ns, identifier, length) in enumerate(zip(*columns, strict=True)):
            self._run_to(start + min(max((t_ns - t0_ns) // self.tick_ns, 0), ticks))
            self._requests.take(identifier, payloads[64 * k : 64 * k + length], tell)
        self._run_to(start + ticks)
        if self.captures is not None and len(blocks := self.captures.sent(self.plant.tick, clock)):
            self._out.append(blocks)
        sent = joined([self._encoder.encode(self._spans, clock), *self._out])
        if self._own_words:
            return by_time(sent) if self._out else sent
        return self._gone_out(sent, t0_ns + ticks * self.tick_ns)

    def _gone_out(self, sent: FrameBatch, now_ns: int) -> FrameBatch:
        """Of what was to be sent, what has gone out by now: the messages of a sample follow each other on the bus."""
        waiting = by_time(joined([self._held, sent]))
        late = waiting["t_ns"] > now_ns
        self._held = waiting[late]
        return waiting[~late]

    def restart(self) -> None:
        """As after power-on: OFF, nobody's, default parameters. The machine goes on as it is, without currents."""
        self._held = self._held[:0]
        self._owner = Ownership(heartbeat=self.plant.tick, tick_s=self.plant.tick_s)
        self.parameters = Parameters(self._rig, self.truth, self.plant, strict=self._own_words)
        planted_s = self.truth.defects["fault_after_s"]
        states = self._machine.states or States
        self.states: States = states(self.plant, self._machine, self.parameters.own, self._owner, planted_s)
        traced = self._machine.traced(self.truth.defects)
        self.captures = None
        if self._rig.capture is not None and traced:
            known, called = frozenset(traced), dict[str, str]()
            for c in self._rig.capture.channels:
                called[reading_of(self._rig, c) if self._own_words else told_as(self._rig, c, known) or c] = c
            self.captures = CapturePort(self._rig, self._map, [called.get(n, n) for n in traced], self.plant.tick_s)
        self._requests = Requests(
            self._rig, self._map, lambda: self.plant.tick, self._owner, self.parameters, self.states, self.captures
        )

    @property
    def state(self) -> str:
        """The state's name."""
        return self.states.state

    @property
    def fault(self) -> str:
        """The latched fault, NONE without one."""
        return self.states.fault

    def _run_to(self, tick: int) -> None:
        """Run the plant in parts no longer than the state machine or the watchdog may wait."""
        plant, owner = self.plant, self._owner
        before = plant.tick
        while before < tick:
            until = tick
            if self.states.watching:
                deadline = owner.heartbeat + int(self.parameters.own["watchdog_s"] / plant.tick_s) + 1
                until = min(tick, deadline) if deadline > before else tick
            if self.states.stepwise:
                until = min(until, before + 10 * plant.period_ticks)
            self.states.begin()
            rows = self._advanced(until - before)
            self._spans.extend(self.states.spans(rows, before))
            before = plant.tick
            self.states.progress(rows)

    def _advanced(self, ticks: int) -> Array:
        """Let the plant run; what a capture wants of every so many ticks goes there."""
        every, start = (self.captures.memory.every if self.captures is not None else 0), self.plant.tick
        if self.captures is None or not every:
            return self.plant.run(ticks)
        rows, readings = cast(TracedPlant, self.plant).run(ticks, every)
        self.captures.memory.take(-(-start // every) * every, readings)
        return rows

    def _send(self, clock: tuple[int, int], message: str, values: Mapping[str, float]) -> None:
        m = self._map[message]
        at = clock[0] + (self.plant.tick - clock[1]) * self.tick_ns
        known = {s.name for s in m.signals}
        told = {name: value for name, value in values.items() if name in known}
        self._out.append(frame(m.identifier, encode(m, told), t_ns=at, flags=FD if m.fd else 0))
