"""The simulated controller: bytes in, bytes out. Its states, parameters, telemetry and captures around the plant. It has its
own copy of the message map and shares no object with the driver."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import cast

from bench.link.codec import Decoder, encode
from bench.link.fault_injection import Fault
from bench.link.frames import FD, FrameBatch, by_time, frame, joined
from bench.rigfile import RigFile
from bench.rigfile.messages import load_messages
from sim_backend.controller.capture_port import CapturePort
from sim_backend.controller.device_faults import DeviceFaults
from sim_backend.controller.ownership import Ownership
from sim_backend.controller.parameters import Parameters
from sim_backend.controller.states import AT_REST, MOVING, RESTING, States
from sim_backend.controller.telemetry import Span, TelemetryEncoder
from sim_backend.core import PERIOD_TICKS, TICK_S, Array
from sim_backend.machine import TracedPlant, Truth

MAP_VERSION = 2
REST_TICKS = 5000  # it has been on for half a second when the host connects: the rotor lies still on its rings


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
        self._rig, self._map = rig, load_messages(rig.dbc_text)
        handlers = {"Heartbeat": self._heartbeat, "Command": self._command, "ParamSet": self._set,
                    "ParamGet": self._get, "Claim": self._claim}  # fmt: skip
        host = [m for m in self._map.messages.values() if m.sender == "Host"]
        self._handlers = {m.identifier: (Decoder(m), handlers.get(m.name)) for m in host}
        self.truth = truth
        self._machine = truth.machine
        self.plant = self._machine.make(truth.plant, truth.noise, substeps)
        self.plant.run(REST_TICKS)
        self.faults = DeviceFaults(rig, faults) if faults else None
        self.captures: CapturePort | None = None
        self.restart()
        self._owner.heartbeat = 0  # it has been on since then
        self._encoder = TelemetryEncoder(self._map, truth, self.plant.tick)
        self._out: list[FrameBatch] = []
        self._spans: list[Span] = []

    def advance(self, ticks: int, incoming: FrameBatch, t0_ns: int) -> FrameBatch:
        """Run for `ticks`; frames are taken at their `t_ns`, which counts from `t0_ns` at the present tick.

        Returns:
            What the controller sent, with its times.
        """
        if self.faults is None:
            return self.run(ticks, incoming, t0_ns)
        return self.faults.advance(self, ticks, incoming, t0_ns)

    def run(self, ticks: int, incoming: FrameBatch, t0_ns: int) -> FrameBatch:
        """`advance` as if there were no faults."""
        start = self.plant.tick
        self._out, self._spans = [], []
        clock = (t0_ns, start)
        # A heartbeat comes every 20 ms: plain numbers and bytes here, for each look into an array costs ten times as much.
        columns = [incoming[name].tolist() for name in ("t_ns", "id", "length")]
        payloads = incoming["data"].tobytes()
        for k, (t_ns, identifier, length) in enumerate(zip(*columns, strict=True)):
            self._run_to(start + min(max((t_ns - t0_ns) // 100_000, 0), ticks))
            self._receive(identifier, payloads[64 * k : 64 * k + length], clock)
        self._run_to(start + ticks)
        if self.captures is not None and len(blocks := self.captures.sent(self.plant.tick, clock)):
            self._out.append(blocks)
        sent = joined([self._encoder.encode(self._spans, clock), *self._out])
        return by_time(sent) if self._out else sent

    def restart(self) -> None:
        """As after power-on: OFF, nobody's, default parameters. The machine goes on as it is, without currents."""
        self._owner = Ownership(heartbeat=self.plant.tick)
        self.parameters = Parameters(self._rig, self.truth, self.plant)
        planted_s = self.truth.defects["fault_after_s"]
        self.states = States(self.plant, self._machine, self.parameters.values, self._owner, planted_s)
        traced = self._machine.traced(self.truth.defects)
        self.captures = CapturePort(self._rig, self._map, traced) if self._rig.capture is not None and traced else None

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
                deadline = owner.heartbeat + int(self.parameters.values["watchdog_s"] / TICK_S) + 1
                until = min(tick, deadline) if deadline > before else tick
            if self.state in MOVING:
                until = min(until, before + 10 * PERIOD_TICKS)
            rows = self._advanced(until - before)
            self._spans.append(Span(rows, before, self.state, self.fault, owner.heartbeat, owner.armed))
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

    def _receive(self, identifier: int, data: bytes, clock: tuple[int, int]) -> None:
        if identifier not in self._handlers:
            return
        decoder, handler = self._handlers[identifier]
        if len(data) != decoder.message.length:
            return
        values, name = decoder.decode_one(data), decoder.message.name
        if not all(map(math.isfinite, values.values())) and name not in ("ParamSet", "CaptureArm"):
            return
        if handler is not None:
            handler(values, clock)
        elif self.captures is not None:
            self.captures.receive(name, values, self.plant.tick, self._owner, self.state in AT_REST,
                                  lambda answer, told: self._send(answer, told, clock))  # fmt: skip

    def _heartbeat(self, v: dict[str, float], _: tuple[int, int]) -> None:
        self._owner.beat(v, self.plant.tick)

    def _claim(self, v: dict[str, float], clock: tuple[int, int]) -> None:
        self._send("Owner", self._owner.claim(v, self.plant.tick, self.state in AT_REST), clock)

    def _command(self, v: dict[str, float], clock: tuple[int, int]) -> None:
        code = int(v["code"])
        names = self._map["Command"].signal("code").choices
        name = names.get(code, "")
        if not name:
            status = "UNKNOWN"
        elif not self._owner.takes(int(v["session"]), self.plant.tick, self.state in AT_REST):
            status = "WRONG_SESSION"
        elif name == "IDENTIFY" or not (status := self._owner.repeated("Command", v)):
            status = "OK" if self.states.obey(name) else "WRONG_STATE"
            if name not in ("IDENTIFY", "RELEASE"):  # which is answered whole each time, and which ends the owner
                self._owner.answered("Command", v, status)
        if name == "IDENTIFY" and status == "OK":
            self._send("Identity", {"protocol": 1, "map_version": MAP_VERSION, "serial": 0}, clock)
        reply = {"code": code, "token": v["token"], "status": self._status(status),
                 "state": self._map.code("CommandReply", "state", self.state)}  # fmt: skip
        self._send("CommandReply", reply, clock)

    def _set(self, v: dict[str, float], clock: tuple[int, int]) -> None:
        index, mine = int(v["index"]), self._owner.may_write(int(v["session8"]))
        answer = self.parameters.write(index, v["value"], mine, self.state in RESTING)
        self._reply_parameter(index, answer, v["token"], clock)

    def _get(self, v: dict[str, float], clock: tuple[int, int]) -> None:
        index = int(v["index"])
        self._reply_parameter(index, self.parameters.read(index), v["token"], clock)

    def _reply_parameter(self, index: int, answer: tuple[str, float], token: float, clock: tuple[int, int]) -> None:
        values = {"index": index, "status": self._status(answer[0]), "token": token, "value": answer[1]}
        self._send("ParamReply", values, clock)

    def _status(self, name: str) -> int:
        return self._map.code("CommandReply", "status", name)

    def _send(self, message: str, values: Mapping[str, float], clock: tuple[int, int]) -> None:
        m = self._map[message]
        at = clock[0] + (self.plant.tick - clock[1]) * 100_000
        self._out.append(frame(m.identifier, encode(m, values), t_ns=at, flags=FD))
