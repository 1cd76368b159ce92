"""What a machine does while it is made safe, beside what it is asked for: faults, amplifiers that go off at speed, and
states of rest that something which still changes contradicts."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from bench.cli.patience import Patience
from bench.findings import Effect, Finding
from bench.rigfile.binding import UNSEEN

if TYPE_CHECKING:
    from drivers.controller import Controller

RESTING = ("OFF", "READY", "FAULT")
WHERE = "make safe"


class Witness:
    """Of one make-safe. `renewing` tells whether heartbeats still go out: a controller that misses them is right to say so."""

    def __init__(self, controller: Controller, renewing: Callable[[], bool]) -> None:
        self._controller, self._renewing = controller, renewing
        self._before = ""  # the mode when it began
        self._fault = ""
        self._dropped = ""
        self._doubt = ""

    def begin(self, patience: Patience) -> None:
        """Make-safe begins."""
        self._before = self._controller.sight.mode
        self.look(patience)

    def look(self, patience: Patience) -> None:
        """See what has happened."""
        c = self._controller
        self._look_at_fault()
        if not self._dropped and c.mode == "FAULT" and self._before not in ("", *RESTING) and patience.fast:
            self._dropped = (
                f"the controller switched its amplifiers off by itself ({c.fault}) while the shaft turned at "
                f"{patience.speed_rad_s or 0.0:.0f} rad/s: it runs down without bearings and without a brake"
            )

    def _look_at_fault(self) -> None:
        c = self._controller
        if not self._fault and c.fault != "NONE" and self._renewing():
            self._fault = c.watch.condition.fault_text()

    @property
    def mode(self) -> str:
        """What telemetry says; where that was contradicted, what an answer says of a rotor at rest."""
        sight = self._controller.sight
        answer = self._doubt and sight.mode in RESTING and sight.answered in RESTING
        return sight.answered if answer else sight.mode

    def doubtful(self, patience: Patience) -> bool:
        """Whether the controller says that the rotor rests, and something says that it does not: a speed that changes, or,
        until an answer of this make-safe says the same, that nobody asked it to."""
        c = self._controller
        mode, answered = c.sight.mode, c.sight.answered in RESTING
        if mode not in RESTING:
            return False
        if mode == "FAULT":  # amplifiers that went off at speed: true, where an answer says so too
            return patience.fast and c.sight.answers and not answered
        unasked = bool(self._doubt) or c.watch.condition.unasked
        return patience.fast or (unasked and c.sight.answers and not answered)

    def believe_not(self, patience: Patience) -> None:
        """The state of rest that the controller tells is contradicted; its later ones need an answer that says the same."""
        c = self._controller
        if self._doubt or c.sight.mode == "FAULT":
            return
        speeds = c.sight.speeds_rad_s()
        turning = [f"{source} {speed:.1f} rad/s" for source, speed in speeds.items()]
        if patience.fast and not any(speed >= c.rotation.landing_speed for speed in speeds.values()):
            turning.append(f"the drive {patience.speed_rad_s or 0.0:.1f} rad/s")
        why = ["it held the rotor and nobody asked it to land"] if c.watch.condition.unasked else []
        why += [f"there is {', '.join(turning)}"] if patience.fast else []
        self._doubt = f"the controller says {c.sight.mode}, but {', and '.join(why)}: its state was not believed"

    def left(self, patience: Patience) -> str:
        """What is told of a machine that was not seen to come to rest."""
        c = self._controller
        speed = patience.speed_rad_s
        turning = "" if speed is None else f", a speed of {speed:.1f} rad/s"
        if c.sight.answered != UNSEEN and c.sight.answered != c.sight.mode:
            self._doubt = self._doubt or (
                f"telemetry says {c.sight.mode}, the controller's answers say {c.sight.answered}: one of them is wrong"
            )
        if c.sight.answered == c.sight.mode and c.sight.mode not in RESTING:
            return (
                f"the controller still says {c.sight.mode}: the rotor is up, and the controller does not take it to be slow. "
                "Switch the amplifiers off by hand once you see that the shaft stands"
            )
        answer = "; nothing was answered" if c.sight.answers else ""
        answer = answer if c.sight.answered == UNSEEN else f"; the last answer said {c.sight.answered}"
        return (
            f"telemetry says {c.sight.mode}{turning}{answer}. Take the rotor to be up until you see that the shaft stands; "
            "then switch the amplifiers off by hand"
        )

    def findings(self) -> tuple[Finding, ...]:
        """What the record is told, once the machine was made safe."""
        found = []
        self._look_at_fault()
        if self._fault:
            found.append(
                Finding("controller-fault", f"while the machine was made safe, {self._fault}", WHERE, Effect.ERROR)
            )
        if self._dropped:
            found.append(Finding("make-safe-failed", f"make-safe failed: {self._dropped}", WHERE, Effect.ERROR))
        if self._doubt:
            found.append(Finding("state-contradicts", self._doubt, WHERE, Effect.ERROR))
        return tuple(found)
