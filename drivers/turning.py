"""Turning the rotor by the controller's own motor: to an angle, at a speed, to a stop."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from bench.clock import Clock
from bench.errors import InterlockError, RotorNotArrived
from bench.link.telemetry import TelemetryDecoder
from bench.rigfile import RigFile
from bench.rigfile.capabilities import Holding
from bench.rigfile.roles import ANGLE, SPEED, told_in
from bench.rigfile.turned import turned
from drivers import waiting
from drivers.arriving import Approach
from drivers.orders import Orders

SPIN_S, STOP_S = 60.0, 60.0  # at most; without progress `drivers.arriving` ends a wait before
SLOWEST_SLEW = 0.2  # rad/s, of a controller that does not say how fast it turns to an angle


class Turning:
    """The angle that the rotor has been sent to, over turns, and the ways there. `now_ns` as in `drivers.waiting`."""

    def __init__(
        self, rig: RigFile, orders: Orders, telemetry: TelemetryDecoder, clock: Clock, now_ns: Callable[[], int],
        speeds: Callable[[], Mapping[str, float]],
    ) -> None:  # fmt: skip
        self._speeds = speeds
        self._rig, self._orders, self._telemetry, self._clock, self._now_ns = rig, orders, telemetry, clock, now_ns
        self._angle = 0.0
        self._told_angle, self._told_speed = told_in(rig, ANGLE), told_in(rig, SPEED)

    @property
    def speed_rad_s(self) -> float:
        """Rotor speed, as it was told last."""
        return self._telemetry.latest.get(self._told_speed, 0.0)

    @property
    def landing_speed(self) -> float:
        """Below this the rotor may be landed, rad/s."""
        p = self._rig.parameters.get(self._rig.capabilities.landing_speed)
        return p.default if p else 1.0

    def point(self, angle_rad: float) -> None:
        """Turn the rotor the shorter way to an angle and wait until it stands there.

        Raises:
            RotorNotArrived: it does not arrive in time.
        """
        here = self._telemetry.latest.get(self._told_angle, 0.0)
        holding = self._holding()
        turn = (angle_rad - here + math.pi) % (2 * math.pi) - math.pi
        self._angle += (angle_rad - self._angle + math.pi) % (2 * math.pi) - math.pi
        self._orders.write({holding.ref: self._angle})
        slew = self._rig.parameters.get(holding.slew)
        travel_s = abs(turn) / (slew.default if slew and slew.default else SLOWEST_SLEW)

        def off() -> float:
            return (self._telemetry.latest[self._told_angle] - angle_rad + math.pi) % (2 * math.pi) - math.pi

        def stands() -> bool:
            return abs(off()) < 4e-3 and abs(self.speed_rad_s) < 0.5

        self._keep(stands, travel_s, travel_s + 5.0,
                   lambda: f"the rotor did not reach {angle_rad:.3f} rad: it stands {off():+.4f} rad off")  # fmt: skip

    def spin(self, rad_s: float) -> None:
        """Turn the rotor at a speed; returns when it has kept within 2 % or 0.3 rad/s of it for a tenth of a second.

        Raises:
            RotorNotArrived: it does not get there in time.
        """
        self._orders.write({self._holding().speed: rad_s})
        self._orders.command("SPIN")
        tolerance = max(0.02 * abs(rad_s), 0.3)
        approach = self._approach(rad_s)

        def there() -> bool:
            approach.look()
            return abs(self.speed_rad_s - rad_s) < tolerance

        self._keep(there, 0.0, SPIN_S,
                   lambda: f"the rotor did not reach {rad_s:.1f} rad/s within {SPIN_S:g} s: it turns at "
                   f"{self.speed_rad_s:.1f} rad/s")  # fmt: skip

    def stop(self) -> None:
        """Brake to a stop, and wait until the rotor is below the landing speed.

        Raises:
            RotorNotArrived: it does not get there in time.
        """
        if not turned(self._rig):
            return  # nothing but a hand does
        self._orders.command("STOP")
        limit = self.landing_speed
        approach = self._approach(0.0)

        def slow() -> bool:
            approach.look()
            return abs(self.speed_rad_s) < limit

        waiting.until(slow, STOP_S, lambda: RotorNotArrived(
            f"the rotor did not slow to {limit:g} rad/s within {STOP_S:g} s: it turns at {self.speed_rad_s:.1f} rad/s"
        ), self._clock, self._now_ns)  # fmt: skip

    def _holding(self) -> Holding:
        holding = self._rig.capabilities.angle
        if holding is None:
            raise InterlockError("capabilities.angle: the rig file binds no parameter that turns the rotor")
        return holding

    def _approach(self, rad_s: float) -> Approach:
        period_s = self._telemetry.period_ns * 1e-9
        return Approach(rad_s, lambda: self.speed_rad_s, self._speeds, self.landing_speed, period_s, self._now_ns)

    def _keep(self, ok: Callable[[], bool], expected_s: float, timeout_s: float, text: Callable[[], str]) -> None:
        waiting.keep(ok, expected_s, timeout_s, text, self._clock, self._now_ns)
