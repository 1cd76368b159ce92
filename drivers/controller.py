"""The controller driver: Levitation and Rotation over any link, by the messages and parameters of the rig file."""

from __future__ import annotations

import math

import numpy as np

from bench.clock import Clock, PumpedClock
from bench.codec import Decoder, encode
from bench.envelope import Envelope
from bench.errors import BenchError, DeviceFault, LinkError
from bench.frames import FD, SENT, FrameBatch, frame
from bench.link import Link
from bench.recorder import Recorder
from bench.rigfile import RigFile
from bench.roles import RigState
from bench.telemetry import TelemetryDecoder

REPLY_S, SILENCE_S, WAIT_SLICE_S = 0.5, 0.5, 0.01
SESSION = 1
STATES = {"OFF": RigState.OFF, "READY": RigState.READY, "LIFTING": RigState.READY, "LEVITATED": RigState.LEVITATED,
          "SPINNING": RigState.SPINNING, "LANDING": RigState.LEVITATED, "COASTING": RigState.SPINNING,
          "FAULT": RigState.OFF}  # fmt: skip
ADVICE = {
    "CONTACT": "the rotor touched a touchdown bearing; inspect it before levitating again",
    "OVERCURRENT": "look for a short or a load beyond the envelope",
    "OVERSPEED": "check the drive and the speed limit",
    "HEARTBEAT_LOST": "the host or the link stalled; the controller landed the rotor by itself",
    "LEVITATION_LOST": "check sensor signs and wiring, amplifier limits and the load",
    "LIFT_TIMEOUT": "the rotor did not reach its place; check sensors, amplifiers and gains",
    "OVERTEMPERATURE": "let the windings cool",
    "SENSOR": "check the position sensors",
}


class CanController:
    """A controller on a CAN-like link. `clock` is what procedures sleep on: it polls while they do.

    While `guarded`, polling raises on faults, envelope trips and silence; make-safe switches that off.
    """

    def __init__(self, rig: RigFile, link: Link, base: Clock, session: int = SESSION) -> None:
        self.rig, self._link, self._base, self._session = rig, link, base, session
        self.envelope = Envelope(rig)
        self.telemetry = TelemetryDecoder(rig)
        self.recorder: Recorder | None = None
        self.clock = PumpedClock(base, self.poll)
        self.guarded = True
        messages = rig.messages
        self._replies = {n: Decoder(messages[n]) for n in ("CommandReply", "ParamReply")}
        self._answers: list[tuple[str, dict[str, float]]] = []
        self._states = messages["Telemetry"].signal("state").choices
        self._faults = messages["Telemetry"].signal("fault").choices
        self._token = 0
        self._last_ns = base.now_ns()
        self._angle = 0.0

    def poll(self) -> None:
        """Read the link, record, decode, and look after the machine.

        Raises:
            LinkError: no telemetry for half a second.
            InterlockError: the envelope tripped.
            DeviceFault: the controller reports a fault.
        """
        batch = self._link.receive()
        if self.recorder is not None:
            self.recorder.frames(self._link.name, batch)
        for name, decoder in self._replies.items():
            values, _ = decoder.decode(batch)
            for k in range(len(next(iter(values.values())))):
                self._answers.append((name, {s: float(v[k]) for s, v in values.items()}))
        blocks = self.telemetry.decode(batch)
        for block in blocks:
            if self.recorder is not None:
                self.recorder.samples(block)
        if blocks:
            self._last_ns = self._base.now_ns()
        if self.guarded:
            self._link.renew_lease()
            for block in blocks:
                self.envelope.check_block(block)
            self._check()

    def _check(self) -> None:
        silent = (self._base.now_ns() - self._last_ns) * 1e-9
        if silent > SILENCE_S:
            raise LinkError(
                f"link {self._link.name}: no telemetry for {silent:.2f} s; expected one message a millisecond"
            )
        fault = self.fault
        if fault != "NONE":
            raise DeviceFault(f"the controller reports {fault}: {ADVICE.get(fault, 'see its documentation')}")

    @property
    def mode(self) -> str:
        """The controller's own name of its state."""
        return self._states.get(int(self.telemetry.latest.get("state", 0)), "OFF")

    @property
    def fault(self) -> str:
        """The latched fault, NONE without one."""
        return self._faults.get(int(self.telemetry.latest.get("fault", 0)), "NONE")

    @property
    def state(self) -> RigState:
        """The rig state that the controller's state amounts to."""
        return STATES[self.mode]

    def enable(self) -> None:
        """OFF to READY."""
        self._command("ENABLE", "READY", 1.0)

    def levitate(self) -> None:
        """READY to LEVITATED."""
        self._command("LEVITATE", "LEVITATED", self.rig.parameters["lift_time_s"].default + 6.0)

    def land(self) -> None:
        """LEVITATED to READY."""
        self._command("LAND", "READY", self.rig.parameters["lift_time_s"].default + 3.0)

    def disable(self) -> None:
        """READY to OFF."""
        self._command("DISABLE", "OFF", 1.0)

    def make_safe(self) -> None:
        """Ask the controller to coast, land and switch off by itself."""
        self._send_command("MAKE_SAFE")

    @property
    def speed_rad_s(self) -> float:
        """Rotor speed."""
        return self.telemetry.latest.get("speed", 0.0)

    def point(self, angle_rad: float) -> None:
        """Turn the rotor the shorter way to an angle and wait until it stands there.

        Raises:
            LinkError: it does not arrive in time.
        """
        here = self.telemetry.latest.get("angle", 0.0)
        turn = (angle_rad - here + math.pi) % (2 * math.pi) - math.pi
        self._angle += (angle_rad - self._angle + math.pi) % (2 * math.pi) - math.pi
        self.set("angle_ref", self._angle)
        slew = self.rig.parameters["angle_slew"].default
        deadline = self._base.now_ns() + round((abs(turn) / slew + 5.0) * 1e9)
        steady = 0
        while steady < 5:
            self.clock.sleep(0.02)
            now = self.telemetry.latest
            error = (now["angle"] - angle_rad + math.pi) % (2 * math.pi) - math.pi
            steady = steady + 1 if abs(error) < 4e-3 and abs(now["speed"]) < 0.5 else 0
            if self._base.now_ns() > deadline:
                raise LinkError(f"the rotor did not reach {angle_rad:.3f} rad: it stands {error:+.4f} rad off")

    def stop(self) -> None:
        """Brake to a stop, and wait until the rotor is below the landing speed."""
        self._send_command("STOP")
        limit = self.rig.parameters["landing_speed"].default
        self._wait(lambda: abs(self.speed_rad_s) < limit, 60.0, f"speed below {limit:g} rad/s")

    def set(self, parameter: str, value: float) -> None:
        """Write a parameter (SI) and check what the controller reads back.

        Raises:
            InterlockError: the envelope refuses; nothing was sent.
            BenchError: the controller refuses, or reads back something else.
        """
        self.envelope.check_parameter(parameter, value)
        index = self.rig.parameters[parameter].index
        if self.recorder is not None:
            self.recorder.event("parameter", name=parameter, value=value)
        reply = self._ask("ParamSet", {"index": index, "value": value}, "ParamReply", f"the reply to {parameter}")
        status = self._status("ParamReply", reply)
        if status != "OK":
            p = self.rig.parameters[parameter]
            raise BenchError(
                f"the controller refuses {parameter} = {value:g} {p.unit}: {status} in state {self.mode}; in force is "
                f"{reply['value']:g} {p.unit}"
            )
        if not np.isclose(reply["value"], value, rtol=1e-6, atol=1e-12):
            raise BenchError(f"{parameter}: wrote {value!r}, the controller reads back {reply['value']!r}")

    def get(self, parameter: str) -> float:
        """Read a parameter, SI.

        Raises:
            BenchError: the controller does not know it.
        """
        index = self.rig.parameters[parameter].index
        reply = self._ask("ParamGet", {"index": index}, "ParamReply", f"the value of {parameter}")
        if self._status("ParamReply", reply) != "OK":
            raise BenchError(f"the controller does not know parameter {parameter} (index {index})")
        return reply["value"]

    def _command(self, name: str, goal: str, timeout_s: float) -> None:
        self._send_command(name)
        self._wait(lambda: self.mode == goal, timeout_s, f"state {goal} after {name}")

    def _send_command(self, name: str) -> None:
        code = self.rig.messages.code("Command", "code", name)
        if self.recorder is not None:
            self.recorder.event("command", name=name)
        values: dict[str, float] = {"session": self._session, "code": code}
        reply = self._ask("Command", values, "CommandReply", f"the reply to {name}")
        status = self._status("CommandReply", reply)
        if status == "WRONG_SESSION":
            raise BenchError(f"the controller refuses {name}: another host owns it")
        if status != "OK":
            raise BenchError(f"the controller refuses {name}: {status} in state {self.mode}")

    def _status(self, message: str, reply: dict[str, float]) -> str:
        return self.rig.messages[message].signal("status").choices.get(int(reply["status"]), "UNKNOWN")

    def _ask(self, message: str, values: dict[str, float], reply: str, what: str) -> dict[str, float]:
        """Send a request and wait for the reply with its token."""
        self._token = (self._token + 1) & 0xFF
        self._answers.clear()
        m = self.rig.messages[message]
        self._send(frame(m.identifier, encode(m, {**values, "token": self._token}), flags=FD | SENT))
        found: list[dict[str, float]] = []

        def arrived() -> bool:
            found.extend(v for n, v in self._answers if n == reply and v["token"] == self._token)
            return bool(found)

        self._wait(arrived, REPLY_S, what)
        return found[0]

    def _send(self, batch: FrameBatch) -> None:
        batch["t_ns"] = self._base.now_ns()
        self._link.send(batch)
        if self.recorder is not None:
            self.recorder.frames(self._link.name, batch)

    def _wait(self, done: object, timeout_s: float, what: str) -> None:
        assert callable(done)
        deadline = self._base.now_ns() + round(timeout_s * 1e9)
        while not done():
            if self._base.now_ns() >= deadline:
                raise LinkError(f"link {self._link.name}: waited {timeout_s:g} s for {what}; it did not come")
            self.clock.sleep(WAIT_SLICE_S)
