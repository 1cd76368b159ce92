"""The drive on registers: what a rig file's target_speed, actual_speed and fault, and its commands, make of a device."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, suppress
from typing import Any, Protocol, TypeVar

from bench import units
from bench.errors import BenchError, ConfigError, DriveFault, InterlockError, Refused, RotorNotArrived, StateNotReached
from bench.rigfile.envelope import Envelope
from drivers.registerdevice import RegisterDevice

T = TypeVar("T")
TAKEN_S = 1.0  # for a drive to do what it was told
STANDSTILL_RAD_S = 0.5
STOP_S, REACH_S = 25.0, 25.0  # without progress
NEEDED = ("target_speed", "actual_speed", "fault")
COMMANDS = ("run", "coast", "stop")
ACCELERATION = "acceleration"


class Surroundings(Protocol):
    """What the drive needs of the bus that it is on."""

    def latest(self, device: str) -> Mapping[str, float]: ...
    def refresh(self, device: str) -> Mapping[str, float]: ...
    def ask(self, request: Callable[..., T], *args: Any) -> T: ...
    def send(self, request: Callable[..., object], *args: Any) -> object: ...
    def wait(
        self, done: Callable[[], bool], timeout_s: float, error: Callable[[], BenchError], what: str = ""
    ) -> None: ...
    def record(self, kind: str, **data: Any) -> None: ...
    def unguarded(self) -> AbstractContextManager[None]: ...


class FieldDrive:
    """A `roles.Drive`. Registers: target_speed, actual_speed, fault; running and acceleration where the drive has
    them. Commands: run, coast, stop; reset where it has one. `may_run` raises when the shaft must not be driven now."""

    def __init__(self, bus: Surroundings, device: RegisterDevice, envelope: Envelope) -> None:
        """Raises ConfigError: the rig file does not state what a drive cannot do without."""
        self._bus, self._device, self._envelope = bus, device, envelope
        self.name = device.name
        device.require(*NEEDED)
        missing = [c for c in COMMANDS if c not in device.spec.commands]
        if missing:
            found = ", ".join(device.spec.commands) or "none"
            raise ConfigError(f"devices.{self.name}.commands: found {found}; expected {', '.join(missing)} as well")
        device.check_commands()
        unit = device.spec.registers["target_speed"].unit
        if units.unit(unit).si != "rad/s":
            raise ConfigError(f"devices.{self.name}.registers.target_speed.unit: found {unit}; expected r/min or rad/s")
        self.may_run: Callable[[], None] = lambda: None

    @property
    def speed_rad_s(self) -> float:
        """Speed as the drive measures it, at the last poll."""
        return self._bus.latest(self.name)["actual_speed"]

    @property
    def fault(self) -> str:
        """Name of the latched fault, "" without one, at the last poll."""
        return self.fault_of(self._bus.latest(self.name))

    @property
    def running(self) -> bool:
        """Whether it gives torque, as far as it tells."""
        return bool(self._bus.latest(self.name).get("running", 1.0))

    def confirm_off(self) -> bool:
        """Whether a reading made now says that it gives no torque; False where it cannot be read or cannot tell."""
        try:
            return not self._bus.refresh(self.name).get("running", 1.0)
        except BenchError:
            return False

    def let_go(self) -> None:
        """Send coast once more without waiting for what comes of it, on a line that may be lost."""
        self._bus.record("drive", device=self.name, command="coast")
        with suppress(BenchError):
            self._bus.send(self._device.command, "coast")

    def fault_of(self, values: Mapping[str, float]) -> str:
        """The fault that a reading tells of."""
        code = round(values["fault"])
        return self._device.spec.faults.get(str(code), f"fault {code}") if code else ""

    def set_speed(self, rad_s: float) -> None:
        """Set the speed that it holds while it runs; read back.

        Raises:
            InterlockError: beyond the envelope; nothing was sent.
            LinkError: the drive does not answer, or refuses.
            Refused: it reads back something else.
        """
        limit = self._envelope.rig.envelope.max_speed_rad_s
        if not abs(rad_s) <= limit:  # NaN is refused too
            raise InterlockError(
                f"drive speed: found {rad_s:g} rad/s; the envelope allows {limit:g} rad/s; nothing was sent"
            )
        self._bus.record("drive-speed", device=self.name, rad_s=rad_s)
        self._write("target_speed", rad_s, "a speed")

    def set_acceleration(self, rad_s2: float) -> None:
        """Set how fast the speed goes to its target, either way; 0: as fast as the drive does by itself. Read back.

        Raises:
            InterlockError: no finite number of 0 or more; nothing was sent.
            LinkError: the drive does not answer, or refuses: it cannot be so fast.
            BenchError: the rig file states no such register, or it reads back something else.
        """
        if not 0 <= rad_s2 < math.inf:  # NaN is refused too
            raise InterlockError(f"drive acceleration: found {rad_s2:g} rad/s^2; expected 0 or more; nothing was sent")
        self._bus.record("drive-acceleration", device=self.name, rad_s2=rad_s2)
        self._write(ACCELERATION, rad_s2, "an acceleration")

    def _write(self, name: str, value: float, what: str) -> None:
        """Write a register and read it back."""
        self._bus.ask(self._device.write, name, value)
        r = self._device.spec.registers[name]
        unit = units.unit(r.unit)
        back, step = self._bus.refresh(self.name)[name], abs(r.scale * unit.factor)
        near = 1e-6 * abs(value) if r.type == "f32" else step
        if not math.isclose(back, value, rel_tol=0, abs_tol=max(near, 1e-12)):
            raise Refused(f"drive {self.name}: wrote {what} of {value:g} {unit.si}, it reads back {back:g} {unit.si}")

    def run(self) -> None:
        """Let it give torque.

        Raises:
            DriveFault: it is in fault, or goes into it.
            LinkError: it does not answer, or refuses.
            StateNotReached: it does not start.
        """
        self.may_run()
        fault = self.fault_of(self._bus.refresh(self.name))
        if fault:
            raise DriveFault(f"the drive reports {fault}; it was not started")
        self._command("run")
        self._until_running(True)

    def reach(self, rad_s: float, patience_s: float = REACH_S) -> None:
        """Run at a speed, with the drive's own acceleration, and return when the shaft has it, within 1 % or 0.5 rad/s.

        Raises:
            InterlockError: beyond the envelope; nothing was sent.
            DriveFault: the drive is or goes into fault.
            LinkError: it does not answer, or refuses.
            StateNotReached: it does not start.
            RotorNotArrived: the shaft came no nearer, by as much, in `patience_s`.
        """
        if self._bus.latest(self.name).get(ACCELERATION):
            self.set_acceleration(0.0)
        self.set_speed(rad_s)
        self.run()
        near = max(STANDSTILL_RAD_S, 0.01 * abs(rad_s))
        while (apart := abs(self.speed_rad_s - rad_s)) > near:
            self._until_within(rad_s, max(near, apart - near), patience_s)

    def _until_within(self, rad_s: float, apart: float, patience_s: float) -> None:
        self._bus.wait(lambda: abs(self.speed_rad_s - rad_s) <= apart, patience_s, lambda: RotorNotArrived(
            f"the shaft did not reach {rad_s:g} rad/s: it turns at {self.speed_rad_s:.1f} rad/s, and came no nearer within "
            f"{patience_s:g} s. Does something else hold it?"
        ), f"the drive to turn the shaft at {rad_s:g} rad/s")  # fmt: skip

    def coast(self) -> None:
        """Take the torque away.

        Raises:
            LinkError: the drive does not answer, or refuses.
            StateNotReached: it goes on.
        """
        self._command("coast")
        self._until_running(False)

    def brake(self) -> None:
        """Begin to brake; nothing is waited for but that the drive takes it.

        Raises:
            LinkError: the drive does not answer, or refuses.
        """
        self._command("stop")

    def stop(self) -> None:
        """Brake, and return when the shaft stands.

        Raises:
            LinkError: the drive does not answer, or refuses.
            RotorNotArrived: the shaft became no slower for STOP_S.
        """
        self.brake()
        while (speed := abs(self.speed_rad_s)) >= STANDSTILL_RAD_S:
            self._until_below(max(STANDSTILL_RAD_S, 0.99 * speed - 0.1))

    def _until_below(self, rad_s: float) -> None:
        self._bus.wait(lambda: abs(self.speed_rad_s) < rad_s, STOP_S, lambda: RotorNotArrived(
            f"the drive did not stop the shaft: it turns at {self.speed_rad_s:.1f} rad/s, no slower for {STOP_S:g} s"
        ), "the drive to stop the shaft")  # fmt: skip

    def reset(self) -> None:
        """Clear a latched fault.

        Raises:
            DriveFault: it stays, or the rig file states no command for it.
            LinkError: the drive does not answer, or refuses.
        """
        fault = self.fault_of(self._bus.refresh(self.name))
        if not fault:
            return
        if "reset" not in self._device.spec.commands:
            raise DriveFault(f"the drive reports {fault}; the rig file states no command to reset it")
        with self._bus.unguarded():
            self._command("reset")
            self._bus.wait(
                lambda: not self.fault_of(self._bus.refresh(self.name)), TAKEN_S,
                lambda: DriveFault(f"the drive reports {fault}, and its reset did not clear it"),
            )  # fmt: skip

    def _command(self, name: str) -> None:
        self._bus.record("drive", device=self.name, command=name)
        self._bus.ask(self._device.command, name)

    def _until_running(self, running: bool) -> None:
        if "running" not in self._device.spec.registers:
            return

        def done() -> bool:
            values = self._bus.refresh(self.name)
            fault = self.fault_of(values)
            if running and fault:
                raise DriveFault(f"the drive reports {fault}; it did not start")
            return bool(values["running"]) == running

        told, is_so = ("run", "it gives no torque") if running else ("coast", "it still gives torque")
        self._bus.wait(done, TAKEN_S, lambda: StateNotReached(
            f"the drive took the command {told}, and says after {TAKEN_S:g} s that {is_so}"
        ))  # fmt: skip
