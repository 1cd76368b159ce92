"""Whether a rotor that was sent to a speed comes nearer to it, and what is said while it does not."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping

from bench import runlog
from bench.errors import RotorNotArrived, SpeedContradicts
from drivers.waiting import Now, Stopwatch

logger = logging.getLogger("drivers.arriving")
NEARER, NEARER_RAD_S = 0.01, 0.1  # of the way that is left, and at least: less is noise, not progress
PATIENCE_S = 20.0  # without progress, until the wait ends
TOLD_S = 5.0  # without progress, before the first line and between two
ALSO_S = 15.0  # between two lines of a wait that goes forward
APART = 0.2  # of the greater speed, that speed and angle may differ by
ALIASED_RAD = 1.0  # between two samples: the angle no longer tells how fast the rotor is


class Approach:
    """Of one wait for `target_rad_s`. `speed` is that of the speed channel, `speeds` those by the sources that change, without
    their signs; `least_rad_s` is what speed and angle may differ by at least, `sample_s` the time between two samples."""

    def __init__(
        self, target_rad_s: float, speed: Callable[[], float], speeds: Callable[[], Mapping[str, float]],
        least_rad_s: float, sample_s: float, now_ns: Now,
    ) -> None:  # fmt: skip
        self._target, self._speed, self._speeds = target_rad_s, speed, speeds
        self._bound, self._sample_s = least_rad_s, sample_s
        self._watch = Stopwatch(now_ns)
        self._nearest: float | None = None
        self._progress_s = self._told_s = 0.0
        self._apart_s: float | None = None  # since when speed and angle differ

    def look(self) -> None:
        """See whether the rotor has come nearer; say what is waited for; to be called in each turn of the wait.

        Raises:
            SpeedContradicts: it comes no nearer by the speed channel, and the angle says another speed.
            RotorNotArrived: it has come no nearer for PATIENCE_S.
        """
        now, apart = self._watch.look() * 1e-9, abs(self._speed() - self._target)
        if self._nearest is None or apart < self._nearest - max(NEARER_RAD_S, NEARER * self._nearest):
            self._nearest, self._progress_s = apart, now
        still_s = now - self._progress_s
        self._compare(now)
        if still_s >= TOLD_S and self._apart_s is not None and now - self._apart_s >= TOLD_S / 2:
            angle = self._speeds().get("angle", 0.0)
            raise SpeedContradicts(
                f"the speed channel says {self._speed():.1f} rad/s, and the angle turns at {angle:.1f} rad/s: one of them is "
                "wrong. Look at the encoder and at what makes speed of it"
            )
        if still_s >= PATIENCE_S:
            raise RotorNotArrived(
                f"the rotor did not reach {self._target:.1f} rad/s: it turns at {self._speed():.1f} rad/s, and came no nearer "
                f"for {PATIENCE_S:g} s"
            )
        if now - max(self._told_s, self._progress_s) >= TOLD_S or now - self._told_s >= ALSO_S:
            self._told_s = now
            told = round(self._speed(), 1) + 0.0  # no negative zero
            left = f"; no nearer for {still_s:.0f} s, {PATIENCE_S - still_s:.0f} s left" if still_s >= TOLD_S else ""
            runlog.show(
                logger,
                f"waiting {now:.0f} s for {self._target:.0f} rad/s; the rotor turns at {told:.1f} rad/s{left}",
            )

    def _compare(self, now: float) -> None:
        """Note since when speed and angle differ, where samples are near enough for the angle to tell."""
        told = self._speeds()
        speed, angle = told.get("speed"), told.get("angle")
        differ = (
            speed is not None and angle is not None and speed * self._sample_s < ALIASED_RAD
            and abs(speed - angle) > max(self._bound, APART * max(speed, angle))
        )  # fmt: skip
        if not differ:
            self._apart_s = None
        elif self._apart_s is None:
            self._apart_s = now
