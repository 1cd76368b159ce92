"""The ordered make-safe of a rig: stop what turns the rotor, land it, switch the amplifiers off; where that cannot be, leave
it to the controller, first by command and at last by withholding the heartbeat.

What is safe at any speed goes at once. LAND goes only when a source that still changes says that the shaft is below the
landing speed, and OFF only to a controller that says READY. There is one measure of time: how long nothing has gone forward.
A speed that falls, a state that changes and a command that is accepted are progress. Without any, the controller is told to
make itself safe after GIVE_UP_S, the heartbeat is withheld after twice and make-safe ends after three times as long.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from bench.cli import forward
from bench.cli.forward import END_S, GIVE_UP_S, LOOK_S, SAFE
from bench.cli.patience import Patience
from bench.cli.witness import RESTING, Witness
from bench.errors import BenchError, InterlockError, LinkError
from bench.findings import Finding
from bench.procedure.roles import Drive
from bench.rigfile.binding import UNKNOWN, UNSEEN
from bench.run.job import WatchedClock
from bench.run.supervisor import SafeStep

if TYPE_CHECKING:
    from drivers.controller import Controller

logger = logging.getLogger("bench.make-safe")
UNTOLD = (UNSEEN, UNKNOWN)
LOOKS = 3  # at a state of rest that something contradicts, before that is believed
LANDED_S = 3.0  # beyond its own time, for a landing to show


def making_safe(
    controller: Controller, base: WatchedClock, drive: Drive | None = None
) -> tuple[tuple[SafeStep, ...], Callable[[], tuple[Finding, ...]]]:
    """The steps for a controller whose heartbeat `base` renews, and an external drive on its shaft; and what tells afterwards
    what the machine did meanwhile: a fault, amplifiers that went off at speed, a state that cannot be believed."""
    way = _Way(controller, base, drive)
    steps = (
        SafeStep("take the torque away", way.at_once),
        SafeStep("wait for the rotor to be slow", way.then(way.slow)),
        SafeStep("land the rotor", way.then(way.land)),
        SafeStep("switch the amplifiers off", way.then(way.disable)),
        SafeStep("the controller's own make-safe", way.then(way.own)),
        SafeStep("the controller's watchdog", way.then(way.watchdog)),
    )
    return steps, way.seen.findings


@dataclass
class _Way:
    """What each step does. `off`: the drive has been seen off; `driven`: it ran when make-safe began; `asked`: the controller
    has been told to make itself safe; `heard`: it answered that; `seen`: what the machine does meanwhile."""

    controller: Controller
    base: WatchedClock
    drive: Drive | None
    off: bool = False
    driven: bool = False
    asked: bool = False
    heard: bool = True
    patience: Patience = field(init=False)
    seen: Witness = field(init=False)

    def __post_init__(self) -> None:
        self.seen = Witness(self.controller, lambda: self.base.renewing)

    @property
    def mode(self) -> str:
        """What the controller is taken to be: a state of rest that something contradicts is none, until answers say one."""
        return UNKNOWN if self.seen.doubtful(self.patience) else self.seen.mode

    def at_once(self) -> None:
        """What is safe at any speed: no torque from the drive nor the motor; of a machine that nobody sees, its own way."""
        c = self.controller
        if self.drive is not None:
            self.driven = self.drive.running
            self.drive.let_go()
        c.sight.forget()
        self.patience = Patience(c, self.base, self.drive)  # what was forgotten is no progress
        self.seen.begin(self.patience)
        c.clock.sleep(0.02)  # a command may have been sent whose effect nobody has seen yet
        mode = self._settled()
        if c.sight.mode in RESTING and mode == UNKNOWN:
            # It says that it rests, and something says that it does not: a motor that obeys brakes the rotor first.
            if c.sight.mode == "FAULT" or not (self.patience.fast and forward.obeyed(c, self.patience, "STOP")):
                self._own_way()
        elif mode in (*UNTOLD, "LIFTING"):
            self._own_way()
        elif mode == "SPINNING" or (mode == "LEVITATED" and self.patience.fast):
            self._send("STOP")

    def _settled(self) -> str:
        """The mode, where one look could be deceived by a single sample looked at again."""
        for _ in range(LOOKS):
            if (mode := self.mode) != UNKNOWN or self.controller.sight.mode == UNKNOWN:
                return mode
            self.controller.clock.sleep(LOOK_S)
        self.seen.believe_not(self.patience)
        return self.mode

    def then(self, do: Callable[[], None]) -> Callable[[], None]:
        """A later step. A drive that nobody saw off is told again: its line may be there again."""

        def step() -> None:
            if self.drive is not None and not self.off:
                self.drive.let_go()
            do()

        return step

    def slow(self) -> None:
        """Brake with the drive where it answers, and wait."""
        c, p = self.controller, self.patience
        if self.asked or self.mode in (*RESTING, "LANDING"):
            return
        if self.drive is not None:
            if self.driven and p.fast:
                self._brake(self.drive)
            self.off = self.drive.confirm_off()
        limit = c.rotation.landing_speed
        self._until(lambda: p.slow or self._rests(fast=p.fast), GIVE_UP_S, f"under {limit:g} rad/s")

    def _rests(self, *, fast: bool) -> bool:
        """Whether nothing is to be waited for before the landing: it rests, or it says so and the shaft is not fast."""
        return self.mode in RESTING or (self.controller.sight.mode in RESTING and not fast)

    def _brake(self, drive: Drive) -> None:
        try:
            drive.brake()
            self._until(lambda: abs(drive.speed_rad_s) < 1.0 or self.patience.slow, GIVE_UP_S, "the drive's brake")
        except BenchError as error:
            logger.warning("make safe: the drive does not brake: %s", error)
        finally:
            drive.let_go()

    def land(self) -> None:
        """LAND, if something that changes says that the shaft is slow; and the time that a landing takes."""
        c, p = self.controller, self.patience
        mode = self.mode
        if self.asked or mode in RESTING or not (p.slow or mode in ("LANDING", "COASTING")):
            return
        if mode not in ("LANDING", "COASTING"):
            self._send("LAND", lambda: p.speed_rad_s is not None and p.slow)
        self._until(lambda: self.mode in RESTING, max(GIVE_UP_S, c.landing_s + LANDED_S), "the landing")

    def disable(self) -> None:
        if self._settled() == "READY":
            self._send("DISABLE", lambda: self.mode == "READY")
            self._until(lambda: self.mode in SAFE, GIVE_UP_S, "amplifiers off")

    def own(self) -> None:
        """The controller's own way, in as long as it goes forward."""
        if self._settled() in SAFE:
            return
        if not self.asked:
            self._own_way()
        if self.heard:
            self._until(lambda: self.mode in SAFE, 2 * GIVE_UP_S, "its own landing")

    def watchdog(self) -> None:
        c = self.controller
        if self._settled() in SAFE:
            return
        self.base.renewing = False
        try:
            self._until(lambda: self.mode in SAFE, END_S, "its watchdog")
        except LinkError as error:
            if c.sight.mode in UNTOLD:
                raise LinkError(
                    "the machine cannot be seen. No heartbeat goes out any more, so that its controller lands it by itself; "
                    "look at it before going near"
                ) from error
            raise LinkError(self.seen.left(self.patience)) from error

    def _own_way(self) -> None:
        self.asked = True
        try:
            self._send("MAKE_SAFE")
        except BenchError:
            self.heard = False
            raise

    def _send(self, name: str, slow: Callable[[], bool] | None = None) -> None:
        forward.send(self.controller, self.patience, name, slow)

    def _until(self, done: Callable[[], bool], limit_s: float, what: str) -> None:
        forward.until(self.controller, self.patience, self.seen, done, limit_s, what,
                      lambda: self.asked or self.mode == UNKNOWN)  # fmt: skip


def may_touch(controller: Controller, drive: Drive | None) -> Callable[[], None]:
    """What raises InterlockError while nobody may reach into the machine: the rotor is not landed, or its drive is on."""

    def check() -> None:
        controller.require_landed()
        if drive is not None and not drive.confirm_off():
            raise InterlockError("nobody may touch the shaft: its drive does not say that it is off")

    return check
