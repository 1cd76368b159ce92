"""A machine that does not levitate: its zeros are found, its axes held, sent somewhere, stopped and let go."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

from bench.clock import Clock
from bench.errors import BenchError, InterlockError, StateNotReached
from bench.link.telemetry import TelemetryDecoder
from bench.procedure.roles import RigState
from bench.rigfile import RigFile
from bench.rigfile.stage import StageAxis, axes_of

ANSWER_S = 1.0  # for a state that follows a command at once
BRAKE_S = 30.0  # for set points to come to rest, at most
SPARE_S = 5.0  # beyond the time that a move takes by its rate and rise
ARRIVED = 1e-3  # of a move, and of its way: a set point so near has arrived


class Commanded(Protocol):
    """What is asked of the controller (`drivers.controller.Controller`)."""

    rig: RigFile
    telemetry: TelemetryDecoder

    @property
    def clock(self) -> Clock: ...
    @property
    def mode(self) -> str: ...
    @property
    def state(self) -> RigState: ...
    def enable(self) -> None: ...
    def disable(self) -> None: ...
    def reach(self, name: str, goal: str, timeout_s: float, expected_s: float = 0.0) -> None: ...
    def wait(self, done: Callable[[], bool], timeout_s: float, error: Callable[[], BenchError]) -> None: ...
    def write(self, values: Mapping[str, float]) -> None: ...
    def get(self, parameter: str) -> float: ...
    def reading(self, channel: str) -> float: ...


class Stage:
    """`bench.procedure.roles.Motion`, by a controller's commands and parameters.

    Args:
        controller: of a rig in the role motion.
    """

    def __init__(self, controller: Commanded) -> None:
        self._controller = controller
        self._axes = axes_of(controller.rig)
        self._can = controller.rig.capabilities.positioning

    @property
    def state(self) -> RigState:
        """As `Controller.state`."""
        return self._controller.state

    @property
    def homed(self) -> bool:
        """Whether the controller says that its zeros are known; False where it says nothing of them."""
        bit = None if self._can is None else self._can.homed
        if bit is None:
            return False
        told = int(self._controller.telemetry.latest.get(bit.channel, 0))
        return bool(told & bit.mask if bit.mask else told)

    def enable(self) -> None:
        """OFF to READY."""
        self._controller.enable()

    def home(self) -> None:
        """Find the zeros; nothing where they are known.

        Raises:
            StateNotReached: they were not found, or not in time.
        """
        c = self._controller
        if self.homed or not c.rig.binding.knows("HOME", c.rig.messages):
            return
        longest = self._can.home_time if self._can is not None else BRAKE_S
        c.reach("HOME", "HOMING", ANSWER_S)
        c.wait(lambda: c.mode != "HOMING", longest, lambda: StateNotReached(
            f"the zeros were not found within {longest:g} s (capabilities.positioning.home_time); next: look whether the axes "
            "can move freely"
        ))  # fmt: skip
        if self._can is not None and self._can.homed is not None and not self.homed:
            raise StateNotReached(
                f"the controller has ended its search and knows no zeros: its state is {c.mode}; next: look at the marks of "
                "the encoders, and whether the axes can move freely"
            )

    def hold(self) -> None:
        """READY to HELD."""
        self._controller.reach("HOLD", "HOLDING", ANSWER_S)

    def let_go(self) -> None:
        """HELD to READY."""
        self._controller.reach("LET_GO", "READY", ANSWER_S)

    def disable(self) -> None:
        """READY to OFF."""
        self._controller.disable()

    def move(self, targets: Mapping[str, float]) -> None:
        """Send axes somewhere, m or rad by name, and wait until their set points rest there.

        Raises:
            InterlockError: an axis that there is none of, or out of its travel; nothing was sent.
            StateNotReached: the set points are not there in time.
            BenchError: as `Controller.write`.
        """
        c = self._controller
        if unknown := [name for name in targets if name not in self._axes]:
            raise InterlockError(f"axis {unknown[0]}: the rig has none of that name; nothing was sent")
        axes = [self._axes[name] for name in targets]
        longest = max((self._takes_s(axis, targets[axis.name]) for axis in axes), default=0.0) + SPARE_S
        near = {axis.name: self._near(axis, targets[axis.name]) for axis in axes}
        c.write({axis.target: targets[axis.name] for axis in axes})
        c.clock.sleep(2 * c.telemetry.period_ns * 1e-9)  # the state of before may yet be on its way
        c.wait(lambda: c.mode == "HOLDING" and self._there(targets, near), longest, lambda: StateNotReached(
            f"the set points are not at rest {longest:.1f} s after they were sent: {self._stand(targets)}; the state is "
            f"{c.mode}"
        ))  # fmt: skip

    def play(self) -> None:
        """HELD to MOVING: waves begin."""
        self._controller.reach("MOVE", "MOVING", ANSWER_S)

    def stop(self) -> None:
        """MOVING to HELD."""
        if self._controller.mode != "HOLDING":
            self._controller.reach("STOP", "HOLDING", BRAKE_S)

    def set(self, parameter: str, value: float) -> None:
        """As `Controller.set`."""
        self._controller.write({parameter: value})

    def write(self, values: Mapping[str, float]) -> None:
        """As `Controller.write`."""
        self._controller.write(values)

    def get(self, parameter: str) -> float:
        """As `Controller.get`."""
        return self._controller.get(parameter)

    def reading(self, channel: str) -> float:
        """As `Controller.reading`."""
        return self._controller.reading(channel)

    def _where(self, axis: StageAxis) -> float:
        """The set point, or where that is not told, the axis."""
        return self._controller.telemetry.latest[axis.reference or axis.channel]

    def _takes_s(self, axis: StageAxis, target: float) -> float:
        """How long the set point may take there: at its rate, and to get to that and down again."""
        rate, rise = (self._asked(name) for name in (axis.rate, axis.rise))
        if not rate:
            return 0.0
        return abs(target - self._where(axis)) / rate + (rate / rise if rise else 0.0)

    def _asked(self, parameter: str) -> float:
        """Of a parameter that is bound its value, 0 for none."""
        if not parameter:
            return 0.0
        try:
            return self.get(parameter)
        except BenchError:  # one that can only be written
            return self._controller.rig.parameters[parameter].default

    def _near(self, axis: StageAxis, target: float) -> float:
        """How near a set point is there: what its signal can tell, and a share of the way."""
        counts = axis.pitch.value if axis.pitch is not None else 0.0
        return max(ARRIVED * abs(target - self._where(axis)), 1.5 * counts, 1e-6 * abs(target))

    def _there(self, targets: Mapping[str, float], near: Mapping[str, float]) -> bool:
        told = [axis for name in targets if (axis := self._axes[name]).reference]
        return all(abs(self._where(axis) - targets[axis.name]) <= near[axis.name] for axis in told)

    def _stand(self, targets: Mapping[str, float]) -> str:
        return ", ".join(
            f"{n} at {self._where(self._axes[n]):.6g} of {x:.6g} {self._axes[n].unit}" for n, x in targets.items()
        )
