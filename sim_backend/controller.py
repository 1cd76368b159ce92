"""The simulated controller: bytes in, bytes out. A state machine, parameters, telemetry, faults and a watchdog around
the plant. It has its own copy of the message map and shares no object with the driver."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import cast

import numpy as np

from bench.codec import Decoder, encode
from bench.faults import Fault
from bench.frames import FD, FrameBatch, by_time, frame, joined
from bench.messages import load_messages
from bench.rigfile import RigFile
from sim_backend import core
from sim_backend.capture_port import CapturePort
from sim_backend.core import PERIOD_TICKS, TICK_S
from sim_backend.device_faults import DeviceFaults
from sim_backend.machine import TracedPlant
from sim_backend.ownership import Ownership
from sim_backend.telemetry import Span, TelemetryEncoder
from sim_backend.truth import Truth

SETTLED_M, SETTLED_S = 20e-6, 0.05
LIFT_TIMEOUT_S = 5.0
MAP_VERSION = 2
REST_TICKS = 5000  # it has been on for half a second when the host connects: the rotor lies still on its rings
RESTING = ("OFF", "READY")
AT_REST = (*RESTING, "FAULT")
WITHOUT_CURRENT = ("OFF", "FAULT")
MOVING = ("LIFTING", "LANDING", "COASTING")
TURNING = ("LEVITATED", "SPINNING", "COASTING")


class SimulatedController:
    """The device end of the rig's link.

    Args:
        rig: its message map and parameters.
        truth: which machine it has.
        faults: that happen inside it (`bench.faults`): reboot, stuck-heartbeat, mute.
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
        self._parameters = {p.index: (name, p) for name, p in rig.parameters.items()}
        self.truth = truth
        self._machine = truth.machine
        self.plant = self._machine.make(truth.plant, truth.seed, substeps)
        self.plant.run(REST_TICKS)
        self.faults = DeviceFaults(rig, faults) if faults else None
        self.captures: CapturePort | None = None
        self.restart()
        self._owner = Ownership()
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
        self.state, self.fault = "OFF", "NONE"
        self._since, self._steady = self.plant.tick, 0
        self._leaving = False  # MAKE_SAFE: OFF when the rotor has landed
        self._owner = Ownership(heartbeat=self.plant.tick)
        self.plant.mode = core.OFF
        self.plant.clear_trips()
        self._brake()
        traced = self._machine.traced(self.truth.defects)
        self.captures = CapturePort(self._rig, self._map, traced) if self._rig.capture is not None and traced else None
        self._own = {name: p.default for name, p in self._parameters.values()}
        for name, value in self._own.items():
            self._apply(name, value)

    def _run_to(self, tick: int) -> None:
        """Run the plant in parts no longer than the state machine or the watchdog may wait."""
        plant, owner = self.plant, self._owner
        before = plant.tick
        while before < tick:
            until = tick
            if self._watching():
                deadline = owner.heartbeat + int(self._own["watchdog_s"] / TICK_S) + 1
                until = min(tick, deadline) if deadline > before else tick
            if self.state in MOVING:
                until = min(until, before + 10 * PERIOD_TICKS)
            rows = self._advanced(until - before)
            self._spans.append(Span(rows, before, self.state, self.fault, owner.heartbeat, owner.armed))
            before = plant.tick
            self._progress(rows, before)

    def _advanced(self, ticks: int) -> core.Array:
        """Let the plant run; what a capture wants of every so many ticks goes there."""
        every, start = (self.captures.memory.every if self.captures is not None else 0), self.plant.tick
        if self.captures is None or not every:
            return self.plant.run(ticks)
        rows, readings = cast(TracedPlant, self.plant).run(ticks, every)
        self.captures.memory.take(-(-start // every) * every, readings)
        return rows

    def _watching(self) -> bool:
        return self._owner.armed and self.state not in ("OFF", "FAULT")

    def _progress(self, rows: core.Array, tick: int) -> None:
        """What the state machine does by itself by `tick`: trips, watchdog, end of lift, landing and coasting."""
        plant = self.plant
        defect = self.truth.defects["fault_after_s"]
        if plant.trips or (defect and tick * TICK_S > defect and self.fault == "NONE"):
            self._trip()
        elif self._watching() and (tick - self._owner.heartbeat) * TICK_S > self._own["watchdog_s"]:
            self._lose_host()
        if self.state == "LIFTING" and len(rows):
            still = bool((np.abs(rows[:, self._machine.radial]) < SETTLED_M).all()) and plant.moved
            self._steady = self._steady + len(rows) if still else 0
            if self._steady * PERIOD_TICKS * TICK_S >= SETTLED_S:
                plant.mode = core.LEVITATE
                self._enter("LEVITATED")
            elif (tick - self._since) * TICK_S > LIFT_TIMEOUT_S + self._own["lift_time_s"]:
                self._fail("LIFT_TIMEOUT")
        elif self.state == "LANDING" and plant.moved:
            if self.fault != "NONE":
                self._switch_off("FAULT")
            elif self._leaving:
                self._switch_off("OFF")
            else:
                plant.mode = core.READY
                self._enter("READY")
        elif self.state == "COASTING" and abs(plant.speed) < self._own["landing_speed"]:
            self._land()
        elif self.state in ("LEVITATED", "SPINNING"):
            turning = abs(plant.speed) > self._own["landing_speed"]
            self.state = "SPINNING" if turning else "LEVITATED"

    def _trip(self) -> None:
        bits = self.plant.trips
        name = next((n for bit, n in core.TRIPS.items() if bits & bit), "SENSOR")
        self._fail(name)

    def _fail(self, fault: str) -> None:
        self.fault = fault if self.fault == "NONE" else self.fault
        self.plant.clear_trips()
        if fault in ("OVERCURRENT", "OVERSPEED", "SENSOR") and self.state in TURNING:
            self._safe()
        else:
            self._switch_off("FAULT")

    def _lose_host(self) -> None:
        self.fault = "HEARTBEAT_LOST" if self.fault == "NONE" else self.fault
        self._owner.armed = False
        self._safe()

    def _safe(self) -> None:
        """Coast while turning fast, then land; amplifiers off where the rotor rests already."""
        if self.state in TURNING:
            self._torque(0.0)
            self._brake()
            if abs(self.plant.speed) > self._own["landing_speed"]:
                self._enter("COASTING")
            else:
                self._land()
        elif self.state == "LIFTING":
            self._land()
        elif self.state in RESTING:
            self._switch_off("OFF" if self.fault == "NONE" else "FAULT")

    def _brake(self) -> None:
        """Aim at standstill, where the controller has a motor."""
        if self._machine.turns:
            self.plant.set("speed_ref", 0.0)

    def _torque(self, on: float) -> None:
        if self._machine.turns:
            self.plant.set("torque_on", on)

    def _switch_off(self, state: str) -> None:
        self.plant.mode = core.OFF
        self._owner.armed = False
        self._enter(state)

    def _land(self) -> None:
        self.plant.mode = core.LAND
        self._enter("LANDING")

    def _enter(self, state: str) -> None:
        self.state, self._since, self._steady = state, self.plant.tick, 0

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
        else:
            status = "OK" if self._obey(name) else "WRONG_STATE"
        if name == "IDENTIFY" and status == "OK":
            self._send("Identity", {"protocol": 1, "map_version": MAP_VERSION, "serial": 0}, clock)
        reply = {"code": code, "token": v["token"], "status": self._status(status),
                 "state": self._map.code("CommandReply", "state", self.state)}  # fmt: skip
        self._send("CommandReply", reply, clock)

    def _obey(self, name: str) -> bool:
        """Carry out a command, or refuse it in this state."""
        state, plant = self.state, self.plant
        if name == "IDENTIFY":
            return True
        if name == "MAKE_SAFE":
            self._leaving = True
            self._safe()
            return True
        if name == "RELEASE" and state in WITHOUT_CURRENT:
            self._owner.release()
        elif name == "CLEAR_FAULT" and state == "FAULT":
            self.fault = "NONE"
            plant.clear_trips()
            self._enter("OFF")
        elif name == "ENABLE" and state == "OFF":
            self._leaving = False
            self._owner.arm(plant.tick)
            plant.mode = core.READY
            self._enter("READY")
        elif name == "DISABLE" and state in RESTING:
            self._switch_off("OFF")
        elif name == "LEVITATE" and state == "READY":
            self._torque(1.0)
            plant.mode = core.LIFT
            self._enter("LIFTING")
        elif name == "LAND" and state == "LEVITATED" and abs(plant.speed) <= self._own["landing_speed"]:
            self._torque(0.0)  # a run-up that has just begun ends here
            self._brake()
            self._land()
        elif name == "SPIN" and state in ("LEVITATED", "SPINNING") and self._machine.turns:
            plant.set("speed_ref", self._own["speed_ref"])
        elif name == "STOP" and state in ("LEVITATED", "SPINNING"):
            self._brake()
        else:
            return False
        return True

    def _set(self, v: dict[str, float], clock: tuple[int, int]) -> None:
        index, value = int(v["index"]), v["value"]
        if index not in self._parameters:
            self._reply_parameter(index, "UNKNOWN", v["token"], 0.0, clock)
            return
        name, p = self._parameters[index]
        if not self._owner.may_write(int(v["session8"])):
            status = "WRONG_SESSION"
        elif not np.isfinite(value) or (
            not p.low <= round(value, 12) <= p.high and not np.isclose(value, (p.low, p.high), rtol=1e-6).any()
        ):
            status = "OUT_OF_RANGE"
        elif p.when == "resting" and self.state not in RESTING:
            status = "WRONG_STATE"
        else:
            status = "OK"
            self._own[name] = value
            self._apply(name, value)
        self._reply_parameter(index, status, v["token"], self._own[name], clock)

    def _get(self, v: dict[str, float], clock: tuple[int, int]) -> None:
        index = int(v["index"])
        known = self._parameters.get(index)
        value = self._own[known[0]] if known else 0.0
        self._reply_parameter(index, "OK" if known else "UNKNOWN", v["token"], value, clock)

    def _apply(self, name: str, value: float) -> None:
        if name in ("watchdog_s", "landing_speed", "speed_ref"):
            return  # the interface's own; speed_ref acts on SPIN
        if name in self._machine.integral_gains:
            value *= self.truth.defects["integrator_factor"]
        self.plant.set(name, value * self.truth.defects.get(f"factor_{name}", 1.0))

    def _reply_parameter(self, index: int, status: str, token: float, value: float, clock: tuple[int, int]) -> None:
        self._send(
            "ParamReply", {"index": index, "status": self._status(status), "token": token, "value": value}, clock
        )

    def _status(self, name: str) -> int:
        return self._map.code("CommandReply", "status", name)

    def _send(self, message: str, values: Mapping[str, float], clock: tuple[int, int]) -> None:
        m = self._map[message]
        at = clock[0] + (self.plant.tick - clock[1]) * 100_000
        self._out.append(frame(m.identifier, encode(m, values), t_ns=at, flags=FD))
