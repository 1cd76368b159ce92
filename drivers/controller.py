"""The controller driver: Levitation, and Rotation by `rotation`, over any link, by the rig file's messages and parameters."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from bench.clock import Clock, PumpedClock
from bench.errors import BenchError, InterlockError, Refused, StateNotReached
from bench.link import Link
from bench.link.session import Session
from bench.link.telemetry import TelemetryDecoder
from bench.procedure.roles import RigState
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile, roles
from bench.rigfile.envelope import Envelope
from bench.rigfile.stage import is_stage
from drivers import advice, handshake, unheard, waiting
from drivers.capture import ControllerCapture
from drivers.capture_upload import Upload
from drivers.condition import STATES
from drivers.dialogue import Dialogue, no_reply
from drivers.orders import Orders
from drivers.sight import Sight
from drivers.stage import Stage
from drivers.turning import Turning
from drivers.watch import Watch

TOUCHED = 0.5  # rad/s, above which a landed shaft is not at rest
FIRST_S = 1.5  # for the first telemetry, and for the last owner to be gone
BEHIND_S = 15.0  # a controller further behind the host's clock is not waited for


class Controller:
    """A controller on a link. `clock` is what procedures sleep on: it polls while they do.

    While `guarded`, polling raises on faults, envelope trips and silence; make-safe switches that off.
    """

    def __init__(self, rig: RigFile, link: Link, base: Clock, session: Session, slice_s: float = 0.1) -> None:
        self.rig, self.link, self._base, self._session = rig, link, base, session
        self.envelope = Envelope(rig)
        self.telemetry = TelemetryDecoder(rig)
        self._recorder: Recorder | None = None
        self.requests = Dialogue(rig, link, base.now_ns)
        self.clock = PumpedClock(base, self.poll, slice_s, lambda: self.telemetry.host.lag_ns)
        self.guarded = True
        self.watch = Watch(
            rig, link, self.telemetry, session.number, base.now_ns, max(waiting.STALL_NS, round(2e9 * slice_s))
        )
        self.cleared, self.restored = "", tuple[str, ...]()
        self.identity: dict[str, float] = {}  # what it says that it is
        self.owned = False  # until then heartbeats mean nothing, and would alarm its owner
        self.sight = Sight(rig, self.telemetry, lambda: self.mode, base.now_ns)
        self.cut_ns = 0  # the most that a step lacked of its telemetry when it was left
        self.companions: list[Callable[[], None]] = []  # polled with it: other devices of the rig
        self._orders = Orders(rig, self.requests, session, self.envelope, lambda: self.mode, self._wait)
        self.rotation = Turning(rig, self._orders, self.telemetry, self.clock, base.now_ns, self.sight.speeds_rad_s)
        self.stage = Stage(self) if is_stage(rig) else None
        self.capture: ControllerCapture | None = None
        if rig.capture is not None:
            upload = Upload(rig, link, self.requests, self.clock)
            self.capture = ControllerCapture(rig, rig.capture, self.requests, upload, session, self.telemetry, self.clock,
                                             self._wait)  # fmt: skip

    @property
    def recorder(self) -> Recorder | None:
        """What records; None while nothing does."""
        return self._recorder

    @recorder.setter
    def recorder(self, recorder: Recorder | None) -> None:
        self._recorder = self.requests.recorder = self._orders.recorder = recorder
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
            LinkError: no telemetry, or no answer; BytesUnreadable: bytes that are no telemetry.
            ConfigError: another host owns it or talks to it, its protocol or message map is another one, or it has a
                fault that somebody should look at.
        """
        self.guarded = False
        if not self.requests.has("Claim"):
            self.clock.sleep(handshake.LISTEN_S)
            handshake.alone(self.watch.hosts.seen, self.link.name)
            self._own()
        begun = unheard.Heard.of(self.link)
        self.wait(lambda: bool(self.telemetry.latest), FIRST_S, lambda: unheard.error(self.link, begun, FIRST_S,
            f"no telemetry within {FIRST_S:g} s. Is the controller on, the port right, the bit rate that of the bus?",
        ))  # fmt: skip
        handshake.claim(self.requests, self.rig, self._session, self.clock, self._wait)
        self._own()
        self.identity = handshake.identify(self.requests, self.rig, self._session, self._wait)
        self.watch.simulated |= self.identity.get("serial") == 0
        if self.mode == "FAULT":
            advice.may_clear("controller", self.fault, clear_fault)
            self.cleared = self.fault
            self.reach("CLEAR_FAULT", "OFF", 1.0)
        self.restored = self._orders.restore()
        self.watch.begin()
        self.guarded = True

    def _own(self) -> None:
        """The controller is ours: heartbeats begin."""
        self.owned = True
        self.link.renew_lease()

    def catch_up(self) -> None:
        """Let the clock run until telemetry has reached the present, so that what is commanded next cannot act on samples
        of the time before: a controller whose clock has fallen behind gets there later. Silence ends a run by itself."""
        if self.watch.condition.raised:
            return  # whoever left the step has handled it: only the next poll raises it again, and any other fault at once
        due, waited = self.clock.now_ns() - self.telemetry.period_ns, waiting.Stopwatch(self._base.now_ns)
        while (
            self.telemetry.newest_ns < due
            and self.watch.silent_s < self.watch.patience_s
            and waited.look() < BEHIND_S * 1e9
        ):
            self.clock.sleep(waiting.SLICE_S)
        self.cut_ns = max(self.cut_ns, due - self.telemetry.newest_ns)

    def release(self) -> None:
        """Let another bench have the controller, at rest with its amplifiers off; one that cannot be heard is not asked."""
        self.guarded, self.companions = False, []  # the rig's other devices are closed by now
        self.recorder = None  # and so is the recording
        heard = self.watch.silent_s < self.watch.patience_s
        if self.requests.has("Claim") and heard and {self.mode, self.sight.answered} & {"OFF", "FAULT"}:
            self._orders.command("RELEASE")

    def poll(self) -> None:
        """Read the link, record, decode, and look after the machine.

        Raises:
            LinkError: no telemetry for half a second (`drivers.waiting.patience_s`); BytesUnreadable where bytes come.
            InterlockError: the envelope tripped.
            DeviceFault: the controller reports a fault, or has restarted.
            FrozenError, ReadingsStand, StateContradicts, AnotherHost: as `Watch.check` says.
        """
        self.watch.polled()
        batch = self.watch.taken(self.link.receive())
        if self._recorder is not None:
            self._recorder.frames(self.link.name, batch, lag_ns=self.telemetry.host.lag_ns)
        self.requests.take(batch)
        self.sight.frames(batch)
        if self.capture is not None:
            self.capture.take(batch)
        blocks = self.telemetry.decode(batch)
        self.sight.samples(blocks)
        for block in blocks:
            if self._recorder is not None:
                self._recorder.samples(block)
        self.watch.came(blocks, self._recorder is not None)
        if self.guarded:
            self.link.renew_lease()
            for block in blocks:
                self.envelope.check_block(block)
            self.watch.check()
        for pump in self.companions:
            pump()

    def require_levitated(self) -> None:
        """Raise unless the rotor is held.

        Raises:
            InterlockError: it is not.
        """
        if self.mode not in ("LEVITATED", "SPINNING"):
            raise InterlockError(f"the shaft must not be driven in state {self.mode}: nothing holds it")

    def require_landed(self) -> None:
        """Raise unless the rotor rests by state, speed and angle: nobody reaches into the machine else.

        Raises:
            InterlockError: it does not.
        """
        speed = self.sight.speeds_rad_s().get("angle", 0.0)  # within milliseconds: coarser than the speed channel
        speed = speed if speed >= self.rotation.landing_speed else abs(self.rotation.speed_rad_s)
        if self.mode not in ("OFF", "READY") or speed > TOUCHED:
            raise InterlockError(f"nobody may touch the shaft in state {self.mode} at {speed:.1f} rad/s: land it first")

    @property
    def mode(self) -> str:
        """What the controller's state amounts to: one of bench.rigfile.binding.MODES, or UNKNOWN for a state without a name:
        nobody knows what the machine does in it."""
        return self.watch.condition.mode

    @property
    def fault(self) -> str:
        """The latched fault, NONE without one."""
        return self.watch.condition.fault

    @property
    def state(self) -> RigState:
        """The rig state that the controller's state amounts to."""
        return STATES[self.mode]

    def enable(self) -> None:
        """OFF to READY."""
        self.reach("ENABLE", "READY", 1.0)

    def levitate(self) -> None:
        """READY to LEVITATED."""
        self.reach("LEVITATE", "LEVITATED", self._lift_s() + 6.0, self._lift_s(0.0))

    def lift(self) -> None:
        """READY to LIFTING: as `levitate`, without waiting for its end."""
        self.reach("LEVITATE", "LIFTING", 1.0)

    def land(self) -> None:
        """LEVITATED to READY."""
        self.reach("LAND", "READY", self._lift_s() + 3.0, self._lift_s(0.0))

    def disable(self) -> None:
        """READY to OFF."""
        self.reach("DISABLE", "OFF", 1.0)

    def command(self, name: str, slow: Callable[[], bool] | None = None) -> None:
        """Send a command and wait for its reply, not for its effect; `drivers.orders.Orders.command` has the errors. LAND and
        DISABLE are repeated only while what changes says that the shaft is slow, by `slow` where somebody sees more."""
        self.watch.condition.commanded(name)
        fit = {"LAND": "LEVITATED", "DISABLE": "READY"}.get(name)
        try:
            self._orders.command(name, lambda: fit is None or (self.mode == fit and (slow or self._slow)()))
        except Refused:
            self.watch.condition.refused()
            raise

    def _slow(self) -> bool:
        """Whether something that changes says that the shaft is below the landing speed, and nothing that it is not. Readings
        without noise do not change in READY: there the speed channel counts while its telemetry goes on."""
        speeds = list(self.sight.speeds_rad_s().values())
        if not speeds and self.mode == "READY" and not self.watch.condition.stands:
            speeds = [abs(self.rotation.speed_rad_s)]
        return bool(speeds) and max(speeds) < self.rotation.landing_speed

    def ask_state(self) -> None:
        """Ask for a reply, which tells the state, where the controller has one; nothing is waited for."""
        self._orders.ask_state()

    @property
    def landing_s(self) -> float:
        """How long a landing takes: until a shaft of which no pulse comes is known to be slow, and until it is down."""
        return self._lift_s() + 2 * math.pi / self.rotation.landing_speed

    def _lift_s(self, unknown: float = 5.0) -> float:
        """How long the controller takes to lift or to lower the rotor; `unknown` where the rig file does not say."""
        return p.default if (p := self.rig.parameters.get(self.rig.capabilities.lift_time)) else unknown

    def set(self, parameter: str, value: float) -> None:
        """Write a parameter, as `write`."""
        self._orders.write({parameter: value})

    def write(self, values: Mapping[str, float]) -> None:
        """Write parameters (SI), those of one message in one; `drivers.orders.Orders.write` has the errors."""
        self._orders.write(values)

    def get(self, parameter: str) -> float:
        """Read a parameter, SI; `drivers.orders.Orders.get` has the errors."""
        return self._orders.get(parameter)

    def reading(self, channel: str) -> float:
        """The newest sample of a channel or role, SI.

        Raises:
            BenchError: the telemetry has no such channel.
        """
        told = self.telemetry.latest
        try:
            return roles.read_now(self.rig, channel, told) if "." in channel else told[channel]
        except KeyError:
            raise BenchError(f"the telemetry has no channel {channel}") from None

    def reach(self, name: str, goal: str, timeout_s: float, expected_s: float = 0.0) -> None:
        """Send a command and wait for the state that it leads to, so long beyond what it is expected to take; raises
        StateNotReached without it, and as `command`."""
        self.command(name)
        self.clock.sleep(expected_s)
        self.wait(lambda: self.mode == goal, timeout_s, lambda: StateNotReached(
            f"the controller took {name} and is not {goal} after {expected_s + timeout_s:g} s: its state is "
            f"{self.watch.condition.described(self._base.now_ns())}"
        ))  # fmt: skip

    def _wait(self, done: Callable[[], bool], timeout_s: float, what: str) -> None:
        self.wait(done, timeout_s, lambda: no_reply(self.link.name, what, timeout_s))

    def wait(self, done: Callable[[], bool], timeout_s: float, error: Callable[[], BenchError]) -> None:
        """Let the clock run until something is true; raises the given error when time runs out."""
        waiting.until(done, timeout_s, error, self.clock, self._base.now_ns)
