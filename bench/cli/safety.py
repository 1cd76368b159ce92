"""The ordered make-safe of a rig: stop what turns the rotor, land it, switch the amplifiers off; if that fails, leave it
to the controller, first by command and at last by withholding the heartbeat.

Levitation is not released while the rotor turns above the landing speed: the controller refuses.
"""

from __future__ import annotations

from collections.abc import Callable
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
BLIND_S = 5.0  # the heartbeat's lease, the watchdog and a landing take less


def safe_steps(controller: Controller, base: WatchedClock, drive: Drive | None = None) -> tuple[SafeStep, ...]:
    """The steps for a controller whose heartbeat `base` renews, and an external drive on its shaft."""

    off = False

    def look() -> None:
        controller.clock.sleep(0.02)  # a command may have been sent whose effect nobody has seen yet

    def brake() -> None:
        nonlocal off
        if drive is None or drive.confirm_off():  # the last poll may be from before a run command
            off = True
            return
        try:
            drive.stop()
        finally:
            drive.coast()
        off = drive.confirm_off()

    def then(do: Callable[[], None]) -> Callable[[], None]:
        """A later step. A drive that nobody saw off is told again: its line may be there again."""

        def step() -> None:
            if drive is not None and not off:
                drive.let_go()
            do()

        return step

    def stop() -> None:
        if controller.mode == "SPINNING":
            controller.stop()

    def land() -> None:
        _until(
            lambda: controller.mode != "SPINNING", controller.clock
        )  # it says so a while after the shaft was stopped
        if controller.mode == "LEVITATED":
            controller.land()
        elif controller.mode == "LIFTING":
            controller.make_safe()
        _until(lambda: controller.mode in RESTING, controller.clock)

    def disable() -> None:
        if controller.mode == "READY":
            controller.disable()

    def own() -> None:
        if controller.mode not in SAFE:
            controller.make_safe()
            _until(lambda: controller.mode in SAFE, controller.clock)

    def watchdog() -> None:
        if controller.mode not in SAFE:
            base.renewing = False
            _until(lambda: controller.mode in SAFE or _blind(controller), controller.clock)
        if controller.mode not in SAFE:
            raise LinkError(
                "the machine cannot be seen. No heartbeat goes out any more, so that its controller lands it by itself; "
                "look at it before going near"
            )

    return (
        SafeStep("see where the machine stands", look, COMMAND_S),
        *([SafeStep("stop the drive", brake, STOP_S)] if drive is not None else []),
        SafeStep("stop the rotor", then(stop), STOP_S),
        SafeStep("land the rotor", then(land), LAND_S),
        SafeStep("switch the amplifiers off", then(disable), COMMAND_S),
        SafeStep("the controller's own make-safe", then(own), STOP_S + LAND_S),
        SafeStep("the controller's watchdog", then(watchdog), STOP_S + LAND_S),
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
