"""The register devices of a rig: opened and probed, polled while its clock runs, recorded as streams.

with open_lines(rig) as lines:                      # live; in simulation the bank of the simulated devices has ports
    port_of = lambda name: lines[rig.devices[name].link].port(rig.devices[name].unit)
    with open_devices(rig, port_of, clock, envelope, threaded=True) as bus:
        bus.drive.reach(40.0)
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from typing import Any, TypeVar

from bench import runlog
from bench.clock import Clock
from bench.errors import BenchError, DeviceUnreadable, DriveFault, LinkError
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.envelope import Envelope
from bench.rigfile.registers import RegisterPort, RegisterRefused
from bench.samples import StreamLayout
from drivers import advice
from drivers.background import Background
from drivers.fielddrive import FieldDrive
from drivers.monitors import FieldSupply, FieldThermal
from drivers.polling import Poll, PolledStream, Reading
from drivers.registerdevice import RegisterDevice, by_role, register_devices
from drivers.waiting import STALL_NS, Stopwatch

logger = logging.getLogger("drivers.fieldbus")
T = TypeVar("T")
WAIT_SLICE_S = 0.05
PUMP_S = 0.1  # without a thread nothing is polled faster: a clock calls `pump` that often
SILENT_POLLS, SILENT_S = 3, 1.0
LEASE_S = 1.0  # a bench that has not pumped for so long hangs; polls would keep the drive's own watchdog fed
TOLD_S = 5.0  # between two lines of a wait for the shaft without progress
END_S = 2.0  # for the last coast, and for what polls to end


class Fieldbus:
    """Drive, supply and thermal monitor, where the rig has them. `pump` is to be called while its clock runs.

    While `guarded`, `pump` raises on what polling found: a device that is lost or refuses, a drive in fault. `recorder`
    gets the streams of `layouts` and the drive's commands as events. `cleared` names a fault that an earlier run left.

    Args:
        rig: its devices in the roles drive, supply and thermal.
        port_of: gives a device's port by the device's name.
        clock: what waiting sleeps on, and whose time samples have.
        envelope: every set speed passes it.
        threaded: poll in a thread for each link, as a live rig needs; else inside `pump`.

    Raises:
        ConfigError: a device lacks what its role cannot do without, or two devices have one role.
    """

    def __init__(
        self, rig: RigFile, port_of: Callable[[str], RegisterPort], clock: Clock, envelope: Envelope, *,
        threaded: bool = False,
    ) -> None:  # fmt: skip
        names = register_devices(rig)
        self.devices = {n: RegisterDevice(n, rig.devices[n], port_of(n)) for n in names}
        self.guarded, self.cleared = True, ""
        self._clock, self._threaded, self._envelope = clock, threaded, envelope
        self.held: Callable[[], bool] = lambda: False  # whether the controller holds the rotor
        self._held_ns: int | None = None  # since when it does
        self._recorder: Recorder | None = None
        periods = {n: round(max(d.spec.poll_s, 0 if threaded else PUMP_S) * 1e9) for n, d in self.devices.items()}
        self._polls = {n: Poll(d, periods[n], clock) for n, d in self.devices.items()}
        self._streams = {n: PolledStream(d, periods[n]) for n, d in self.devices.items()}
        patience = {n: SILENT_S + SILENT_POLLS * periods[n] * 1e-9 for n in names}
        self._patience = {n: s + rig.links[rig.devices[n].link].reconnect_s for n, s in patience.items()}
        self._latest: dict[str, Mapping[str, float]] = {}
        self._answered = dict.fromkeys(names, 0)
        self._refreshed = dict.fromkeys(names, 0)
        self._trouble: dict[str, BenchError] = {}
        self._arrived: deque[Reading] = deque(maxlen=10_000)
        self._ended = threading.Event()
        self._threads: list[threading.Thread] = []
        self._pumped_s, self._looked_ns = time.monotonic(), clock.now_ns()
        self._hands = Background(clock, "requests to register devices") if threaded else None
        role = by_role(self.devices)
        self.drive = FieldDrive(self, role["drive"], envelope) if "drive" in role else None
        self.supply = FieldSupply(role["supply"], self.latest) if "supply" in role else None
        self.thermal = FieldThermal(role["thermal"], self.latest) if "thermal" in role else None

    @property
    def layouts(self) -> tuple[StreamLayout, ...]:
        """One stream for each device."""
        return tuple(stream.layout for stream in self._streams.values())

    @property
    def recorder(self) -> Recorder | None:
        """What records; None while nothing does."""
        return self._recorder

    @recorder.setter
    def recorder(self, recorder: Recorder | None) -> None:
        self._recorder = recorder
        if recorder is not None:
            for stream in self._streams.values():
                stream.start_counting()

    def connect(self, clear_fault: bool = False) -> None:
        """See that every device has the registers of its map, clear a fault that an earlier run left (only a lost
        connection's, unless `clear_fault`), and begin to poll.

        Raises:
            ConfigError: a register that a device does not have, or a drive with a fault that somebody should look at.
            LinkError: a device does not answer.
            DriveFault: the drive's fault stays.
        """
        for name, device in self.devices.items():
            self._latest[name] = self.ask(device.check)
            self._answered[name] = self._refreshed[name] = self._clock.now_ns()
        if self.drive is not None and self.drive.fault:
            advice.may_clear("drive", self.drive.fault, clear_fault)
            self.cleared = self.drive.fault
            self.drive.reset()
        self._pumped_s, self._looked_ns = time.monotonic(), self._clock.now_ns()
        links: dict[str, list[Poll]] = {}
        for name, poll in self._polls.items():
            poll.start()
            links.setdefault(self.devices[name].spec.link, []).append(poll)
        if self._threaded and not self._threads:
            for link, polls in links.items():
                thread = threading.Thread(target=self._keep_polling, args=(polls,), name=f"poll {link}", daemon=True)
                self._threads.append(thread)
                thread.start()

    def close(self) -> None:
        """End polling; what is stuck on a dead line is left behind. Calling it twice is harmless."""
        self._ended.set()
        deadline = time.monotonic() + END_S
        for thread in self._threads:
            thread.join(max(0.0, deadline - time.monotonic()))
        self._threads.clear()
        if self._hands is not None:
            self._hands.close(max(0.0, deadline - time.monotonic()))

    def ask(self, request: Callable[..., T], *args: Any) -> T:
        """Make a request of a device. On a live rig the clock runs meanwhile."""
        return request(*args) if self._hands is None else self._hands.call(request, *args)

    def send(self, request: Callable[..., object], *args: Any) -> Future[object] | None:
        """Make a request without waiting for it; in simulation it is made at once, and there is nothing to wait for.

        Raises:
            BenchError: in simulation what it raises; else it is closed.
        """
        if self._hands is not None:
            return self._hands.submit(request, *args)
        request(*args)
        return None

    def latest(self, device: str) -> Mapping[str, float]:
        """The newest values of a device, SI by register."""
        return self._latest[device]

    def refresh(self, device: str) -> Mapping[str, float]:
        """Values read now. They are no sample of the stream, which keeps its period.

        Raises:
            LinkError: the device does not answer, or refuses.
        """
        values = self.ask(self.devices[device].read)
        self._latest[device] = values
        self._answered[device] = self._refreshed[device] = self._clock.now_ns()
        return values

    def pump(self) -> None:
        """Take what polling found; poll what is due where no thread does.

        Raises:
            LinkError: a device is lost, refuses, or says what is no number (DeviceUnreadable), while guarded.
            DriveFault: the drive reports a fault (while guarded).
            InterlockError: a reading is outside the envelope (while guarded).
        """
        self._pumped_s = time.monotonic()
        if not self.held():
            self._held_ns = None
        elif self._held_ns is None:
            self._held_ns = self._clock.now_ns()
        if not self._threaded:
            self._poll(self._polls.values())
        while self._arrived:
            self._take(self._arrived.popleft())
        if self.guarded:
            self._check()

    def wait(self, done: Callable[[], bool], timeout_s: float, error: Callable[[], BenchError], what: str = "") -> None:
        """Let the clock run until something is true; a wait for `what` that takes long is told every TOLD_S.

        Raises:
            BenchError: the given one, when time runs out.
        """
        watch, told_s = Stopwatch(self._clock.now_ns), 0.0
        while not done():
            waited_s = watch.look() * 1e-9
            if waited_s >= timeout_s:
                raise error()
            if what and waited_s >= told_s + TOLD_S:
                told_s = waited_s
                runlog.show(logger, f"waiting {waited_s:.0f} s for {what}; {timeout_s - waited_s:.0f} s left")
            self._clock.sleep(WAIT_SLICE_S)
            self.pump()

    def record(self, kind: str, **data: Any) -> None:
        """An event in the recording, where there is one."""
        if self._recorder is not None:
            self._recorder.event(kind, **data)

    @contextmanager
    def unguarded(self) -> Iterator[None]:
        """Raise nothing in `pump` for the block."""
        before, self.guarded = self.guarded, False
        try:
            yield
        finally:
            self.guarded = before

    def _poll(self, polls: Iterable[Poll]) -> None:
        for poll in polls:
            reading = poll.take()
            if reading is not None:
                self._arrived.append(reading)

    def _keep_polling(self, polls: Sequence[Poll]) -> None:
        """One link's devices. Goes on after an error, so that make-safe finds them when they are there again."""
        while not self._ended.wait(max(0.001, (min(p.due_ns for p in polls) - self._clock.now_ns()) * 1e-9)):
            if not self._poll_leased(polls):
                self._ended.wait(WAIT_SLICE_S)

    def _poll_leased(self, polls: Iterable[Poll]) -> bool:
        """Poll, but not for a bench that hangs: then nothing but the drive's own time-out stops the drive."""
        if time.monotonic() - self._pumped_s > LEASE_S:
            return False
        self._poll(polls)
        return True

    def _take(self, reading: Reading) -> None:
        name = reading.device
        if reading.values is None:
            if name not in self._trouble:
                logger.warning("device %s: no reading: %s", name, reading.error)
            self._trouble[name] = reading.error or LinkError(f"device {name}: no reading")
            return
        if name in self._trouble:
            logger.warning("device %s: answers again", name)
            del self._trouble[name]
        if reading.t_ns >= self._refreshed[name]:  # a poll from before a command must not hide what came of it
            self._latest[name] = reading.values
        self._answered[name] = max(self._answered[name], reading.t_ns)
        block = self._streams[name].block(reading)
        if self._recorder is not None and block is not None:
            self._recorder.samples(block)
        if self.guarded:  # a supply that was still off when it was asked may have been switched on for the lift
            held = self._held_ns is not None and reading.t_ns > self._held_ns
            self._envelope.check_reading(name, reading.values, held)

    def _check(self) -> None:
        for error in self._trouble.values():
            if isinstance(error, RegisterRefused):
                raise error
        now, before = self._clock.now_ns(), self._looked_ns
        self._looked_ns = now
        for name, device in self.devices.items():
            if now - before > STALL_NS:  # the bench stood still, and with it its polls
                self._answered[name] = min(now, self._answered[name] + now - before)
            silent = (now - self._answered[name]) * 1e-9
            if silent > self._patience[name]:
                why = f": {self._trouble[name]}" if name in self._trouble else ""
                odd = isinstance(self._trouble.get(name), DeviceUnreadable)
                kind = DeviceUnreadable if odd else LinkError
                raise kind(f"device {name} on link {device.spec.link}: no reading for {silent:.1f} s{why}")
        if self.drive is not None and self.drive.fault:
            raise DriveFault(f"the drive reports {self.drive.fault}; look at it before the next run")
