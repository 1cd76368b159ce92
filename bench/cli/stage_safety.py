"""The ordered make-safe of a machine that does not levitate: its set points brake to rest, then its axes are let go, or held
where they came to rest, as its controller is set; at last the amplifiers go off. Nothing falls when they do, so that what
cannot be stopped by command is switched off, and what cannot be told anything is left to the watchdog.

It waits for the controller's own MAKE_SAFE to come to an end and for nothing else, and says so, as long as something goes
forward (`bench.cli.patience`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from bench.cli import forward
from bench.cli.forward import END_S, GIVE_UP_S, SAFE
from bench.cli.patience import Patience
from bench.cli.witness import RESTING, Witness
from bench.errors import LinkError
from bench.findings import Finding
from bench.rigfile.binding import UNKNOWN
from bench.run.job import WatchedClock
from bench.run.supervisor import SafeStep

if TYPE_CHECKING:
    from drivers.controller import Controller


def making_stage_safe(
    controller: Controller, base: WatchedClock
) -> tuple[tuple[SafeStep, ...], Callable[[], tuple[Finding, ...]]]:
    """The steps for a controller whose heartbeat `base` renews; and what tells afterwards what the machine did meanwhile."""
    way = _Way(controller, base)
    steps = (
        SafeStep("stop the axes", way.at_once),
        SafeStep("wait for the axes to rest", way.rest),
        SafeStep("switch the amplifiers off", way.disable),
        SafeStep("the controller's watchdog", way.watchdog),
    )
    return steps, way.seen.findings


@dataclass
class _Way:
    """What each step does. `seen`: what the machine does meanwhile."""

    controller: Controller
    base: WatchedClock
    patience: Patience = field(init=False)
    seen: Witness = field(init=False)

    def __post_init__(self) -> None:
        self.seen = Witness(self.controller, lambda: self.base.renewing)

    @property
    def _rests(self) -> bool:
        """Whether it is as a machine that was made safe is: without currents, or held at rest where it is set so."""
        can = self.controller.rig.capabilities.positioning
        held = can is not None and can.make_safe == "hold"
        return self._mode in RESTING or (held and self._mode == "HOLDING")

    @property
    def _mode(self) -> str:
        """A state of rest that something contradicts is none."""
        return UNKNOWN if self.seen.doubtful(self.patience) else self.seen.mode

    def at_once(self) -> None:
        """MAKE_SAFE, whatever it says that it does, but to one that is off."""
        c = self.controller
        c.sight.forget()
        self.patience = Patience(c, self.base, None)  # what was forgotten is no progress
        self.seen.begin(self.patience)
        c.clock.sleep(0.02)  # a command may have been sent whose effect nobody has seen yet
        if self._mode not in SAFE:
            forward.send(c, self.patience, "MAKE_SAFE")

    def rest(self) -> None:
        """Until it rests."""
        self._until(lambda: self._rests, GIVE_UP_S, "the axes' rest")

    def disable(self) -> None:
        """OFF; a machine that is to be held stays so, and one that did not come to rest is let go first."""
        if self._mode in SAFE or (self._rests and self._mode == "HOLDING"):
            return
        if self._mode not in RESTING:
            forward.obeyed(self.controller, self.patience, "LET_GO")
        forward.send(self.controller, self.patience, "DISABLE")
        self._until(lambda: self._mode in SAFE, GIVE_UP_S, "amplifiers off")

    def watchdog(self) -> None:
        """What cannot be told anything misses the heartbeat."""
        if self._mode in SAFE or self._rests:
            return
        self.base.renewing = False
        try:
            self._until(lambda: self._rests, END_S, "its watchdog")
        except LinkError as error:
            raise LinkError(
                f"the machine is {self.controller.sight.mode} and cannot be made safe. No heartbeat goes out any more, so that "
                "its controller stops it by itself; look at it before going near"
            ) from error

    def _until(self, done: Callable[[], bool], limit_s: float, what: str) -> None:
        forward.until(self.controller, self.patience, self.seen, done, limit_s, what)
