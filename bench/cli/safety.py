"""The ordered make-safe of a rig: stop what turns the rotor, land it, switch the amplifiers off; if that fails, leave it
to the controller, first by command and at last by withholding the heartbeat.

Levitation is not released while the rotor turns above the landing speed: the controller refuses.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bench.clock import Clock
from bench.errors import InterlockError, LinkError
from bench.opened import WatchedClock
from bench.roles import Drive
from bench.supervisor import SafeStep

if TYPE_CHECKING:
    from drivers.controller import Controller

RESTING = ("OFF", "READY", "FAULT")
SAFE = ("OFF", "FAULT")
LAND_S, STOP_S, COMMAND_S = 20.0, 90.0, 5.0
ALONE_S = STOP_S + LAND_S - 5.0  # a little less than the supervisor gives it
BLIND_S = 5.0  # the heartbeat's lease, the watchdog and a landing take less


def safe_steps(controller: Controller, base: WatchedClock, drive: Drive | None = None) -> tuple[SafeStep, ...]:
    """The steps for a controller whose heartbeat `base` renews, and an external drive on its shaft."""
    way = _Way(controller, base, drive)
    return (
        SafeStep("see where the machine stands", way.look, COMMAND_S),
        *([SafeStep("stop the drive", way.brake, STOP_S)] if drive is not None else []),
        SafeStep("stop the rotor", way.then(way.stop), STOP_S),
        SafeStep("land the rotor", way.then(way.land), LAND_S),
        SafeStep("switch the amplifiers off", way.then(way.disable), COMMAND_S),
        SafeStep("the controller's own make-safe", way.then(way.own), STOP_S + LAND_S),
        SafeStep("the controller's watchdog", way.then(way.watchdog), STOP_S + LAND_S),
    )


@dataclass
class _Way:
    """What each step does; `off`: whether the drive has been seen off."""

    controller: Controller
    base: WatchedClock
    drive: Drive | None
    off: bool = False

    def look(self) -> None:
        self.controller.clock.sleep(0.02)  # a command may have been sent whose effect nobody has seen yet

    def brake(self) -> None:
        if self.drive is None or self.drive.confirm_off():  # the last poll may be from before a run command
            self.off = True
            return
        try:
            self.drive.stop()
        finally:
            self.drive.coast()
        self.off = self.drive.confirm_off()

    def then(self, do: Callable[[], None]) -> Callable[[], None]:
        """A later step. A drive that nobody saw off is told again: its line may be there again."""

        def step() -> None:
            if self.drive is not None and not self.off:
                self.drive.let_go()
            do()

        return step

    def stop(self) -> None:
        if self.controller.mode == "SPINNING":
            self.controller.stop()

    def land(self) -> None:
        c = self.controller
        _until(lambda: c.mode != "SPINNING", c.clock)  # it says so a while after the shaft was stopped
        if c.mode == "LEVITATED":
            c.land()
        elif c.mode == "LIFTING":
            c.make_safe()
        _until(lambda: c.mode in RESTING, c.clock)

    def disable(self) -> None:
        if self.controller.mode == "READY":
            self.controller.disable()

    def own(self) -> None:
        c = self.controller
        if c.mode not in SAFE:
            c.make_safe()
            _until(lambda: c.mode in SAFE, c.clock)

    def watchdog(self) -> None:
        c = self.controller
        if c.mode in SAFE:
            return
        self.base.renewing = False
        end_ns = c.clock.now_ns() + round(ALONE_S * 1e9)
        _until(lambda: c.mode in SAFE or _blind(c) or c.clock.now_ns() > end_ns, c.clock)
        if c.mode not in SAFE and _blind(c):
            raise LinkError(
                "the machine cannot be seen. No heartbeat goes out any more, so that its controller lands it by itself; "
                "look at it before going near"
            )
        if c.mode not in SAFE:
            raise LinkError(
                f"the controller still says {c.mode}: the rotor is up, and the controller does not take it to be slow. "
                "Switch the amplifiers off by hand once you see that the shaft stands"
            )


def may_touch(controller: Controller, drive: Drive | None) -> Callable[[], None]:
    """What raises InterlockError while nobody may reach into the machine: the rotor is not landed, or its drive is on."""

    def check() -> None:
        controller.require_landed()
        if drive is not None and not drive.confirm_off():
            raise InterlockError("nobody may touch the shaft: its drive does not say that it is off")

    return check


def _blind(controller: Controller) -> bool:
    """Nothing comes from the controller, and nothing will."""
    try:
        controller.poll()
    except LinkError:
        return True
    return controller.silent_s > BLIND_S


def _until(done: Callable[[], bool], clock: Clock) -> None:
    """Wait; the supervisor ends it when the step runs out of time."""
    while not done():
        clock.sleep(0.05)
