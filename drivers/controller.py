"""The controller driver: Levitation and Rotation over any link, by the messages and parameters of the rig file."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from bench.clock import Clock, PumpedClock
from bench.envelope import Envelope
from bench.errors import BenchError, DeviceFault, InterlockError, LinkError
from bench.frames import SENT, FrameBatch
from bench.link import Link
from bench.recorder import Recorder
from bench.rigfile import RigFile
from bench.roles import RigState
from bench.samples import SampleBlock
from bench.session import Session
from bench.telemetry import TelemetryDecoder
from drivers import advice, handshake
from drivers.capture import ControllerCapture
from drivers.capture_upload import Upload
from drivers.dialogue import Dialogue, no_reply
from drivers.orders import Orders

SILENCE_S = 0.5
WAIT_SLICE_S, LONG_SLICE_S, PATIENCE = 0.01, 0.1, 0.2  # a wait looks again after a fifth of how long it has waited
KEPT_S, KEPT_SLICE_S = 0.1, 0.02  # what is to stand or to keep its speed is looked at so often for so long
STALL_NS = 200_000_000  # between two polls, or two slices: they come with every slice
SPIN_S = 60.0
SLOWEST_SLEW = 0.2  # rad/s, of a controller that does not say how fast it turns to an angle
TOUCHED = 0.5  # rad/s, above which a landed shaft is not at rest
HOST_AGE = "host_age"
FIRST_S = 1.5  # for the first telemetry, and for the last owner to be gone
STATES = {"OFF": RigState.OFF, "READY": RigState.READY, "LIFTING": RigState.READY, "LEVITATED": RigState.LEVITATED,
          "SPINNING": RigState.SPINNING, "LANDING": RigState.LEVITATED, "COASTING": RigState.SPINNING,
          "FAULT": RigState.OFF, "UNKNOWN": RigState.SPINNING}  # fmt: skip


class Controller:
    """A controller on a link. `clock` is what procedures sleep on: it polls while they do.

    While `guarded`, polling raises on faults, envelope trips and silence; make-safe switches that off.
    """

    def __init__(self, rig: RigFile, link: Link, base: Clock, session: Session, slice_s: float = 0.1) -> None:
        self.rig, self.link, self._base, self._session = rig, link, base, session
        self.envelope = Envelope(rig)
        self.telemetry = TelemetryDecoder(rig)
        self._recorder: Recorder | None = None
        self._dialogue = Dialogue(rig, link, base.now_ns)
        self._stall_ns = max(STALL_NS, round(2e9 * slice_s))
        self.clock = PumpedClock(base, self.poll, slice_s, lambda: self.telemetry.host.lag_ns)
        self.guarded = True
        self._states, self._faults = rig.choices("state"), rig.choices("fault")
        self._last_ns = self._polled_ns = base.now_ns()
        self._angle = 0.0
        self._reboots = 0
        self.cleared = ""
        self.restored: tuple[str, ...] = ()
        self.serial: int | None = None
        self._host_ids = {rig.messages[name].identifier: name for name in handshake.host_messages(rig)}
        self._others: set[str] = set()  # host messages that came in
        self.host_age_s = 0.0  # the greatest while the machine was on
        self.companions: list[Callable[[], None]] = []  # polled with it: other devices of the rig
        self._orders = Orders(rig, self._dialogue, session, self.envelope, lambda: self.mode, self._wait)
        self.capture: ControllerCapture | None = None
        if rig.capture is not None:
            upload = Upload(rig, link, self._dialogue, self.clock)
            self.capture = ControllerCapture(
                rig, rig.capture, self._dialogue, upload, session, self.telemetry, self.clock, self._wait
            )

    @property
    def recorder(self) -> Recorder | None:
        """What records; None while nothing does."""
        return self._recorder

    @recorder.setter
    def recorder(self, recorder: Recorder | None) -> None:
        self._recorder = self._dialogue.recorder = self._orders.recorder = recorder
        if self.capture is not None:
            self.capture.recorder = recorder
        if recorder is not None:
            self.telemetry.start_counting()

    def connect(self, clear_fault: bool = False) -> None:
        """See that the controller talks, that nobody else owns it, and that it is the one the rig file means; set its
        parameters to the rig file's. `cleared` names a fault that an earlier run left, `restored` parameters that were
        other.

        Args:
            clear_fault: clear whatever fault there is; else only HEARTBEAT_LOST, which says nothing of the machine.

        Raises:
            LinkError: no telemetry, or no answer.
            ConfigError: another host owns it or talks to it, its protocol or message map is another one, or it has a
                fault that somebody should look at.
        """
        self.guarded = False
        if not self._dialogue.has("Claim"):
            self.clock.sleep(handshake.LISTEN_S)
            handshake.alone(self._others, self.link.name)
        self.link.renew_lease()
        silent = (
            f"no telemetry within {FIRST_S:g} s. Is the controller on, the port right, the bit rate that of the bus?"
        )
        self.wait(lambda: bool(self.telemetry.latest), FIRST_S, LinkError(f"link {self.link.name}: {silent}"))
        handshake.claim(self._dialogue, self.rig, self._session, self.clock, self._wait)
        self.serial = handshake.identify(self._dialogue, self.rig, self._session, self._wait)
        if self.mode == "FAULT":
            advice.may_clear("controller", self.fault, clear_fault)
            self.cleared = self.fault
            self._command("CLEAR_FAULT", "OFF", 1.0)
        self.restored = self._orders.restore()
        self._last_ns = self._base.now_ns()
        self.guarded = True

    def catch_up(self) -> None:
        """Let the clock run until telemetry has reached the present, so that what is commanded next cannot act on samples
        of the time before: a controller whose clock has fallen behind gets there later. Silence ends a run by itself."""
        due, begin = self.clock.now_ns() - self.telemetry.period_ns, self._base.now_ns()
        while self.telemetry.newest_ns < due and self._base.now_ns() - begin < SILENCE_S * 1e9:
            self.clock.sleep(WAIT_SLICE_S)

    def release(self) -> None:
        """Let another bench have the controller, which must be at rest."""
        if self._dialogue.has("Claim"):
            self._orders.command("RELEASE")

    def poll(self) -> None:
        """Read the link, record, decode, and look after the machine.

        Raises:
            LinkError: no telemetry for half a second.
            InterlockError: the envelope tripped.
            DeviceFault: the controller reports a fault, or has restarted.
        """
        now = self._base.now_ns()
        if now - self._polled_ns > self._stall_ns:  # the bench stood still: the link has had no chance to be heard
            self._last_ns += now - self._polled_ns
        self._polled_ns = now
        batch = self._marked(self.link.receive())
        if self._recorder is not None:
            self._recorder.frames(self.link.name, batch, lag_ns=self.telemetry.host.lag_ns)
        self._dialogue.take(batch)
        if self.capture is not None:
            self.capture.take(batch)
        blocks = self.telemetry.decode(batch)
        for block in blocks:
            if self._recorder is not None:
                self._recorder.samples(block)
        if blocks:
            self._last_ns = self._base.now_ns()
        if self.guarded:
            self.link.renew_lease()
            for block in blocks:
                self.envelope.check_block(block)
            self._look_at_heartbeat(blocks)
            self._check()
        for pump in self.companions:
            pump()

    def _marked(self, batch: FrameBatch) -> FrameBatch:
        """Frames that a host sent are marked so: another host's, or our own heartbeats that the bus brings back."""
        if not self._host_ids.keys().isdisjoint(batch["id"].tolist()):
            theirs = np.isin(batch["id"], list(self._host_ids))
            batch = batch.copy()
            batch["flags"][theirs] |= SENT
            self._others |= {self._host_ids[int(i)] for i in batch["id"][theirs]}
        return batch

    def require_levitated(self) -> None:
        """Raise unless the rotor is held.

        Raises:
            InterlockError: it is not.
        """
        if self.mode not in ("LEVITATED", "SPINNING"):
            raise InterlockError(f"the shaft must not be driven in state {self.mode}: nothing holds it")

    def require_landed(self) -> None:
        """Raise unless the rotor rests: nobody reaches into the machine else.

        Raises:
            InterlockError: it does not.
        """
        if self.mode not in ("OFF", "READY") or abs(self.speed_rad_s) > TOUCHED:
            raise InterlockError(
                f"nobody may touch the shaft in state {self.mode} at {self.speed_rad_s:.1f} rad/s: land it first"
            )

    def _look_at_heartbeat(self, blocks: Sequence[SampleBlock]) -> None:
        """How old the last heartbeat got in the controller's eyes, where it tells and watches."""
        if self._recorder is not None and self.mode not in ("OFF", "FAULT"):
            ages = [float(b.columns[HOST_AGE].max()) for b in blocks if HOST_AGE in b.columns]
            self.host_age_s = max([self.host_age_s, *ages])

    def _check(self) -> None:
        if self.silent_s > SILENCE_S + (self.rig.link.reconnect_s if self.link.reopening else 0.0):
            text = f"no telemetry for {self.silent_s:.2f} s; the link or the controller is lost"
            raise LinkError(f"link {self.link.name}: {text}")
        if self.telemetry.counters.reboots > self._reboots:
            self._reboots = self.telemetry.counters.reboots
            raise DeviceFault("the controller restarted during the run: its tick began anew; look at its supply")
        fault = self.fault
        if fault != "NONE":
            raise DeviceFault(f"the controller reports {fault}: {advice.ADVICE.get(fault, 'see its documentation')}")
        if self.mode in ("FAULT", "UNKNOWN"):
            code = int(self.telemetry.latest.get("state", 0))
            name = self._states.get(code, f"{code}, which its DBC does not name")
            raise DeviceFault(f"the controller reports no fault, but its state is {name}: see its documentation")

    @property
    def round_trip_ns(self) -> int | None:
        """The least time from a request to its answer."""
        return self._dialogue.round_trip_ns

    @property
    def replies_wrong_length(self) -> int:
        """Replies that do not have the length of the DBC."""
        return self._dialogue.wrong_length

    @property
    def silent_s(self) -> float:
        """How long no telemetry has come."""
        return (self._base.now_ns() - self._last_ns) * 1e-9

    @property
    def mode(self) -> str:
        """What the controller's state amounts to: one of bench.binding.MODES, or UNKNOWN for a state without a name:
        nobody knows what the machine does in it."""
        if not self.telemetry.latest:
            return "OFF"
        name = self._states.get(int(self.telemetry.latest.get("state", 0)))
        return (self.rig.binding.mode(name) if name is not None else None) or "UNKNOWN"

    @property
    def fault(self) -> str:
        """The latched fault, NONE without one."""
        code = int(self.telemetry.latest.get("fault", 0))
        name = self._faults.get(code, f"code {code}" if code else "NONE")
        return "NONE" if name in self.rig.binding.no_fault else name

    @property
    def state(self) -> RigState:
        """The rig state that the controller's state amounts to."""
        return STATES[self.mode]

    def enable(self) -> None:
        """OFF to READY."""
        self._command("ENABLE", "READY", 1.0)

    def levitate(self) -> None:
        """READY to LEVITATED."""
        self._command("LEVITATE", "LEVITATED", self._lift_s + 6.0, self._default("lift_time_s"))

    def land(self) -> None:
        """LEVITATED to READY."""
        self._command("LAND", "READY", self._lift_s + 3.0, self._default("lift_time_s"))

    def disable(self) -> None:
        """READY to OFF."""
        self._command("DISABLE", "OFF", 1.0)

    def make_safe(self) -> None:
        """Ask the controller to coast, land and switch off by itself."""
        self._orders.command("MAKE_SAFE")

    @property
    def _lift_s(self) -> float:
        p = self.rig.parameters.get("lift_time_s")
        return p.default if p else 5.0

    @property
    def speed_rad_s(self) -> float:
        """Rotor speed."""
        return self.telemetry.latest.get("speed", 0.0)

    @property
    def landing_speed(self) -> float:
        """Below this the rotor may be landed, rad/s."""
        p = self.rig.parameters.get("landing_speed")
        return p.default if p else 1.0

    def point(self, angle_rad: float) -> None:
        """Turn the rotor the shorter way to an angle and wait until it stands there.

        Raises:
            LinkError: it does not arrive in time.
        """
        here = self.telemetry.latest.get("angle", 0.0)
        turn = (angle_rad - here + math.pi) % (2 * math.pi) - math.pi
        self._angle += (angle_rad - self._angle + math.pi) % (2 * math.pi) - math.pi
        self.set("angle_ref", self._angle)
        travel_s = abs(turn) / (self._default("angle_slew") or SLOWEST_SLEW)

        def off() -> float:
            return (self.telemetry.latest["angle"] - angle_rad + math.pi) % (2 * math.pi) - math.pi

        def stands() -> bool:
            return abs(off()) < 4e-3 and abs(self.speed_rad_s) < 0.5

        self._keep(stands, travel_s, travel_s + 5.0,
                   lambda: f"the rotor did not reach {angle_rad:.3f} rad: it stands {off():+.4f} rad off")  # fmt: skip

    def spin(self, rad_s: float) -> None:
        """Turn the rotor at a speed; returns when it has kept within 2 % or 0.3 rad/s of it for a tenth of a second.

        Raises:
            LinkError: it does not get there in time.
        """
        self.set("speed_ref", rad_s)
        self._orders.command("SPIN")
        tolerance = max(0.02 * abs(rad_s), 0.3)
        self._keep(lambda: abs(self.speed_rad_s - rad_s) < tolerance, 0.0, SPIN_S,
                   lambda: f"the rotor did not reach {rad_s:.1f} rad/s within {SPIN_S:g} s: it turns at "
                   f"{self.speed_rad_s:.1f} rad/s")  # fmt: skip

    def _default(self, parameter: str) -> float:
        """What a parameter is set to unless a plan says otherwise; 0 where the rig has none."""
        p = self.rig.parameters.get(parameter)
        return p.default if p else 0.0

    def _keep(self, ok: Callable[[], bool], expected_s: float, timeout_s: float, text: Callable[[], str]) -> None:
        """Let the clock run for the time that it should take, and on until something has been true for a tenth of a
        second.

        Raises:
            LinkError: `text`, when time runs out.
        """
        begin, since = self._base.now_ns(), None
        self.clock.sleep(min(expected_s, timeout_s))
        while True:
            now = self._base.now_ns()
            if not ok():
                since = None
            elif since is None:
                since = now
            elif now - since >= KEPT_S * 1e9:
                return
            if now - begin > timeout_s * 1e9:
                raise LinkError(text())
            self.clock.sleep(_pause(now - begin) if since is None else KEPT_SLICE_S)

    def stop(self) -> None:
        """Brake to a stop, and wait until the rotor is below the landing speed."""
        self._orders.command("STOP")
        limit = self.landing_speed
        self._wait(lambda: abs(self.speed_rad_s) < limit, 60.0, f"speed below {limit:g} rad/s")

    def set(self, parameter: str, value: float) -> None:
        """Write a parameter (SI) and check what the controller reads back; `drivers.orders.Orders.set` has the errors."""
        self._orders.set(parameter, value)

    def get(self, parameter: str) -> float:
        """Read a parameter, SI; `drivers.orders.Orders.get` has the errors."""
        return self._orders.get(parameter)

    def reading(self, channel: str) -> float:
        """The newest sample of a channel, SI.

        Raises:
            BenchError: the telemetry has no such channel.
        """
        try:
            return self.telemetry.latest[channel]
        except KeyError:
            raise BenchError(f"the telemetry has no channel {channel}") from None

    def _command(self, name: str, goal: str, timeout_s: float, expected_s: float = 0.0) -> None:
        self._orders.command(name)
        self.clock.sleep(expected_s)
        self._wait(lambda: self.mode == goal, timeout_s, f"state {goal} after {name}")

    def _wait(self, done: Callable[[], bool], timeout_s: float, what: str) -> None:
        self.wait(done, timeout_s, no_reply(self.link.name, what, timeout_s))

    def wait(self, done: Callable[[], bool], timeout_s: float, error: LinkError) -> None:
        """Let the clock run until something is true.

        Raises:
            LinkError: the given one, when time runs out.
        """
        begin = self._base.now_ns()
        while not done():
            waited = self._base.now_ns() - begin
            if waited >= timeout_s * 1e9:
                raise error
            self.clock.sleep(min(_pause(waited), max(timeout_s - waited * 1e-9, 1e-3)))


def _pause(waited_ns: int) -> float:
    """How long to wait before looking again, s."""
    return min(max(PATIENCE * waited_ns * 1e-9, WAIT_SLICE_S), LONG_SLICE_S)
