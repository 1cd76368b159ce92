"""How long make-safe waits: as long as something goes forward. And what it says meanwhile, a line at a time."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

from bench.clock import Clock
from bench.errors import LinkError
from bench.procedure.roles import Drive
from bench.rigfile.binding import UNKNOWN, UNSEEN

if TYPE_CHECKING:
    from drivers.controller import Controller

FALL, FALL_RAD_S = 0.01, 0.1  # of the least speed so far, and at least: less is noise, not progress
CHANGES_S = 1.0  # a drive's reading that has not changed for so long says nothing
FIRST_S, EVERY_S = 1.0, 5.0  # of waiting, before the first line and between two


class Patience:
    """Since when a machine has not gone forward, as far as its controller and its drive can be seen.

    `clock` is the host's; a bench that stands still meanwhile sees on its next look what came.
    """

    def __init__(self, controller: Controller, clock: Clock, drive: Drive | None) -> None:
        self._controller, self._clock, self._drive = controller, clock, drive
        self._progress_ns = clock.now_ns()
        self._modes = {UNSEEN, UNKNOWN, controller.sight.mode}
        self._least: float | None = None
        self._drive_rad_s, self._drive_ns = self._reading(), -1
        self._waits, self._begun_ns, self._told_s = "", 0, 0.0
        self._done_ns: dict[Callable[[], None], int] = {}

    def look(self) -> None:
        """See whether there is a state that was not seen before, or the shaft has become slower. A state that comes and goes is
        no progress: a machine that is seen now and then would be waited for without end."""
        now, mode = self._clock.now_ns(), self._controller.sight.mode
        reading = self._reading()
        if reading != self._drive_rad_s:
            self._drive_rad_s, self._drive_ns = reading, now
        if mode not in self._modes:
            self._modes.add(mode)
            self._progress_ns = now
        speed = self.speed_rad_s
        if speed is not None and (self._least is None or speed < self._least - max(FALL_RAD_S, FALL * self._least)):
            self._progress_ns = self._progress_ns if self._least is None else now
            self._least = speed

    def went_on(self) -> None:
        """Something else went forward."""
        self._progress_ns = self._clock.now_ns()

    @property
    def still_s(self) -> float:
        """How long nothing has gone forward."""
        return (self._clock.now_ns() - self._progress_ns) * 1e-9

    @property
    def speed_rad_s(self) -> float | None:
        """The greatest speed that a source which still changes tells; None where none does."""
        speeds = list(self._controller.sight.speeds_rad_s().values())
        if self._drive_ns >= 0 and self._clock.now_ns() - self._drive_ns < CHANGES_S * 1e9:
            speeds.append(abs(self._drive_rad_s))
        return max(speeds, default=None)

    @property
    def fast(self) -> bool:
        """Whether the shaft is seen to turn at the landing speed or faster."""
        speed = self.speed_rad_s
        return speed is not None and speed >= self._controller.rotation.landing_speed

    @property
    def slow(self) -> bool:
        """Whether a source that changes says that the shaft is below the landing speed, and none that it is not."""
        sight = self._controller.sight
        speed = self.speed_rad_s
        if speed is None:
            return sight.came_down
        return speed < self._controller.rotation.landing_speed and sight.mode in ("LEVITATED", UNSEEN)

    def every(self, period_s: float, action: Callable[[], None]) -> None:
        """Do something that often; a link that is lost for now does not count."""
        now = self._clock.now_ns()
        if now - self._done_ns.get(action, -1 << 62) >= period_s * 1e9:
            self._done_ns[action] = now
            with suppress(LinkError):
                action()

    def line(self, what: str, limit_s: float) -> str | None:
        """What is waited for, how things stand, how long it has been and how long it may yet be without progress; None when
        no line is due."""
        now = self._clock.now_ns()
        if what != self._waits:
            self._waits, self._begun_ns, self._told_s = what, now, FIRST_S - EVERY_S
        waited = (now - self._begun_ns) * 1e-9
        if waited < self._told_s + EVERY_S:
            return None
        self._told_s = waited
        speed, left = self.speed_rad_s, max(0.0, limit_s - self.still_s)
        turning = "" if speed is None else f", {speed:.{0 if speed >= 10 else 1}f} rad/s"
        return (
            f"make safe: waiting {waited:.0f} s for {what} ({self._controller.sight.mode}{turning}); {left:.0f} s left"
        )

    def _reading(self) -> float:
        """The drive's speed at the last poll."""
        return 0.0 if self._drive is None else self._drive.speed_rad_s
