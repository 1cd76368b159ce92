"""What a controller's newest telemetry says of its condition: mode, fault, restarts, counters that stand."""

from __future__ import annotations

from bench.errors import DeviceFault, FrozenError, StateContradicts
from bench.link.stillness import STILL_S
from bench.link.telemetry import TelemetryDecoder
from bench.procedure.roles import RigState
from bench.rigfile import RigFile
from bench.rigfile.binding import HELD, UNKNOWN
from bench.rigfile.roles import SPEED, told_in
from bench.rigfile.stage import is_stage
from drivers import advice

SET_DOWN = ("LAND", "LET_GO", "DISABLE", "MAKE_SAFE")
TAKE_HOLD = ("LEVITATE", "HOLD")
STATES = {"OFF": RigState.OFF, "READY": RigState.READY, "LIFTING": RigState.READY, "LEVITATED": RigState.LEVITATED,
          "SPINNING": RigState.SPINNING, "LANDING": RigState.LEVITATED, "COASTING": RigState.SPINNING,
          "HOMING": RigState.READY, "HOLDING": RigState.HELD, "MOVING": RigState.MOVING, "STOPPING": RigState.MOVING,
          "FAULT": RigState.OFF, UNKNOWN: RigState.SPINNING}  # fmt: skip
"""What a state of the controller, by its mode, is of the rig."""
UNASKED_S = 0.1  # for which a state that nobody asked for is more than a wrong sample


class Condition:
    """State and fault by the names of the rig file, out of what `telemetry` decoded last."""

    def __init__(self, rig: RigFile, telemetry: TelemetryDecoder) -> None:
        self._binding, self._telemetry, self._axes = rig.binding, telemetry, is_stage(rig)
        self._states, self._faults = rig.choices("state"), rig.choices("fault")
        self._speed = told_in(rig, SPEED)
        self._reboots = 0
        self._raised: tuple[str, int] | None = None  # the fault that `check` raised last, while it stands
        self._code, self._since_ns = 0, 0  # of the state, and since when it is that
        self._unknown_ns: int | None = None  # since when its state has no name, by the frames that came
        self._held = self._asked_down = self._asked_before = False  # it has held the rotor; it was asked to set it down
        self._unasked_ns: int | None = None  # since when it rests unasked, by the frames that came

    @property
    def mode(self) -> str:
        """`Controller.mode`."""
        if not self._telemetry.latest:
            return "OFF"
        name = self._states.get(int(self._telemetry.latest.get("state", 0)))
        return (self._binding.mode(name) if name is not None else None) or UNKNOWN

    def fault_text(self) -> str:
        """The latched fault and what to do about it."""
        return f"the controller reports {self.fault}: {advice.ADVICE.get(self.fault, 'see its documentation')}"

    def look(self, now_ns: int) -> None:
        """Note since when the state is what it is; after each look at the telemetry."""
        code = int(self._telemetry.latest.get("state", 0))
        if code != self._code or not self._since_ns:
            self._code, self._since_ns = code, now_ns
        if not self._asked_down and self.mode in HELD:
            self._held = True
        if self.fault == "NONE" and self.mode not in ("FAULT", UNKNOWN):
            self._raised = None  # what comes after that is a fault of its own, also one of the same name

    def commanded(self, name: str) -> None:
        """A command is about to be sent."""
        self._asked_before = self._asked_down
        if name == "CLEAR_FAULT":
            self._raised = None
        if name in TAKE_HOLD:
            self._held = self._asked_down = False
        elif name in SET_DOWN:
            self._asked_down = True

    def refused(self) -> None:
        """The last command was refused: what it asked for was not begun."""
        self._asked_down = self._asked_before

    @property
    def stands(self) -> str:
        """What has stood for a second while telemetry came: tick, sequence or both; "" while both go on."""
        return self._telemetry.stillness.frozen

    @property
    def unasked(self) -> bool:
        """Whether it says that the rotor rests, though it held it, told no fault, and nobody asked for that."""
        return self._held and not self._asked_down and self.mode in ("OFF", "READY") and self.fault == "NONE"

    def described(self, now_ns: int) -> str:
        """The state by its name in the rig file and in the DBC, and since when: `OFF (aus) since 12.3 s`."""
        name = self._states.get(self._code, f"code {self._code}, which the DBC does not name")
        own = "" if name == self.mode else f" ({name})"
        return f"{self.mode}{own} since {max(0, now_ns - self._since_ns) * 1e-9:.1f} s"

    @property
    def fault(self) -> str:
        """`Controller.fault`."""
        code = int(self._telemetry.latest.get("fault", 0))
        name = self._faults.get(code, f"code {code}" if code else "NONE")
        return "NONE" if name in self._binding.no_fault else name

    @property
    def raised(self) -> bool:
        """Whether a fault stands that `check` has raised already, and none but that one: who left a step without it has handled
        it. A restart is raised once and does not stand."""
        return self._raised is not None and self._raised == self._standing

    @property
    def _standing(self) -> tuple[str, int]:
        """What tells a fault from another: its name, or the state where it has none, after so many restarts. A fault keeps its
        name while the state goes on from lifting to failed."""
        name = self.fault if self.fault != "NONE" else f"state {int(self._telemetry.latest.get('state', 0))}"
        return name, self._telemetry.counters.reboots

    def check(self) -> None:
        """Raise unless all is well.

        Raises:
            DeviceFault: a restart since the last look, a fault, a state that says so, or one that nobody knows for a second.
            FrozenError: tick or sequence have stood for a second while telemetry came.
            StateContradicts: it says that the rotor rests, though it held it and nobody asked for that.
        """
        if stands := self.stands:
            raise FrozenError(
                f"telemetry is frozen: frames come, but the controller's {stands} has stood for {STILL_S:g} s or more; "
                "nobody knows what the machine does"
            )
        if self._telemetry.counters.reboots > self._reboots:
            self._reboots = self._telemetry.counters.reboots
            self._held = False
            raise DeviceFault("the controller restarted during the run: its tick began anew; look at its supply")
        if self.fault != "NONE":
            self._raised = self._standing
            raise DeviceFault(self.fault_text())
        if self.mode == "FAULT" or self._lost_its_name():
            self._raised = self._standing
            code = int(self._telemetry.latest.get("state", 0))
            name = self._states.get(code, f"{code}, which its DBC does not name")
            raise DeviceFault(f"the controller reports no fault, but its state is {name}: see its documentation")
        if self._rests_unasked():
            raise StateContradicts(self.unasked_text(self._telemetry.stillness.newest_ns))

    def unasked_text(self, now_ns: int) -> str:
        """What is wrong with a state of rest that nobody asked for."""
        speed = self._telemetry.latest.get(self._speed)
        turning = "" if speed is None else f"; its speed channel says {speed:.1f} rad/s"
        told, asked = ("axes", "let them go") if self._axes else ("rotor", "land")
        said = f"the controller says {self.described(now_ns)}, though it held the {told}"
        return f"{said} and nobody asked it to {asked}{turning}"

    def _rests_unasked(self) -> bool:
        """Whether it has for longer than a wrong sample takes."""
        now = self._telemetry.stillness.newest_ns
        if not self.unasked:
            self._unasked_ns = None
        elif self._unasked_ns is None:
            self._unasked_ns = now
        return self._unasked_ns is not None and now - self._unasked_ns >= UNASKED_S * 1e9

    def _lost_its_name(self) -> bool:
        """Whether the state has had no name for a second of frames."""
        now = self._telemetry.stillness.newest_ns
        if self.mode != UNKNOWN:
            self._unknown_ns = None
        elif self._unknown_ns is None:
            self._unknown_ns = now
        return self._unknown_ns is not None and now - self._unknown_ns >= STILL_S * 1e9
