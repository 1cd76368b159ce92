"""The ball under its magnet with the law that holds it, tick by tick, in plain Python: some ten times faster than real time.

m y'' = C (i / x)^2 - m g with x = gap + zero - y: y is the height, up, and x the distance to where the pull would be infinite.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

TICK_S, PERIOD_TICKS = 1e-4, 10
OFF, READY, LIFT, LEVITATE, LAND = range(5)
LOST, OVERCURRENT = 1, 2  # trips, as sim_backend.core.TRIPS has them
CONTACT, SATURATED = 4, 1  # bits of the channel `flags`
CHANNELS = ("pos_y", "i", "i_set", "flags")
STOP_N_M, STOP_NS_M = 2e4, 20.0  # of what the ball lies on, and of the magnet's face


@dataclass(frozen=True)
class Params:
    """The plant, SI; reading = gain * value + offset."""

    constant: float = 1.2e-5  # C, N m^2/A^2
    mass: float = 0.05
    gravity: float = 9.81
    gap: float = 5e-3
    zero: float = 0.0
    clearance: float = 1e-3
    current_rate: float = 6000.0  # rad/s, of the closed current loop
    current_limit: float = 4.0
    position_gain: float = 1.0
    position_offset: float = 0.0
    position_noise: float = 1e-6
    current_gain: float = 1.0
    current_offset: float = 0.0
    current_noise: float = 3e-3
    trip_current: float = 5.0
    lost_time: float = 0.02
    saturation: float = 0.0  # at 1 A, of the iron: the pull falls off as 1 / (1 + saturation * i)^2


class Plant:
    """What `sim_backend.machine.SimulatedPlant` asks for; the ball does not turn. `law` are the parameters of the rig file."""

    tick_s, period_ticks = TICK_S, PERIOD_TICKS
    speed = shaft_speed = drive_torque = 0.0
    pulse_age_s = turn_s = None

    def __init__(self, params: Params, seed: int) -> None:
        self.p = params
        self.law = {"rest_current": 1.0, "kp": 1400.0, "kd": 11.0, "ki": 5000.0, "ref": 0.0, "lift_time_s": 0.5}
        self.tick, self.trips = 0, 0
        self._mode, self._clock, self._from = OFF, 0.0, 0.0
        self._y, self._v, self.current, self._next = -params.clearance, 0.0, 0.0, 0.0
        self._integral, self._rate, self._before, self._lost = 0.0, 0.0, math.nan, 0
        self._sums, self._flags, self._in_period = [0.0, 0.0, 0.0], 0, 0
        self._noise = np.random.Generator(np.random.Philox(seed & (2**64 - 1)))

    @property
    def mode(self) -> int:
        """OFF, READY, LIFT, LEVITATE or LAND."""
        return self._mode

    @mode.setter
    def mode(self, mode: int) -> None:
        broken_off = (self._mode, mode) in ((LIFT, LAND), (LAND, LIFT))
        if self._mode < LIFT <= mode:  # from rest: no kick, the reference begins where the ball lies
            self._from, self._integral, self._rate, self._before = math.nan, 0.0, 0.0, math.nan
        self._clock = self.law["lift_time_s"] - self._clock if broken_off else 0.0
        self._mode = mode

    @property
    def moved(self) -> bool:
        """Whether the lift or landing has run its course."""
        return self._clock >= self.law["lift_time_s"]

    def clear_trips(self) -> None:
        """Forget latched trips."""
        self.trips = self._lost = 0

    def set(self, name: str, value: float) -> None:
        """A parameter of the law, SI.

        Raises:
            KeyError: it has no such parameter.
        """
        if name not in self.law:
            raise KeyError(name)
        self.law[name] = value

    def get(self, name: str) -> float:
        """A parameter of the law, SI; raises as `set`."""
        return self.law[name]

    def drive(self, law: object, target_rad_s: float = 0.0) -> None:
        """Nothing turns it."""

    def run(self, ticks: int) -> npt.NDArray[np.float64]:
        """Advance by `ticks`, or to the end of the telemetry period in which a trip occurs.

        Returns:
            (n, 4) float64, a row of CHANNELS per telemetry period: means over its ticks, and flags.
        """
        rows, before = [], self.trips
        for noise in self._noise.standard_normal((ticks, 2)).tolist():
            self._advance(*noise)
            if self._in_period == PERIOD_TICKS:
                rows.append([total / PERIOD_TICKS for total in self._sums] + [float(self._flags)])
                self._sums, self._flags, self._in_period = [0.0, 0.0, 0.0], 0, 0
                if self.trips & ~before:
                    break
        return np.array(rows, dtype=np.float64).reshape(-1, len(CHANNELS))

    def _advance(self, position_noise: float, current_noise: float) -> None:
        p = self.p
        reading = p.position_gain * self._y + p.position_offset + p.position_noise * position_noise
        applied, self._next = self._next, self._asked(reading)  # one sample of delay
        self._watch()
        seen = p.current_gain * self.current + p.current_offset + p.current_noise * current_noise
        self._sums = [a + b for a, b in zip(self._sums, (reading, seen, self._next), strict=True)]
        keep = math.exp(-p.current_rate * TICK_S)
        self.current = applied + (self.current - applied) * keep
        x, into = p.gap + p.zero - self._y, abs(self._y) - p.clearance
        pull = self.current / (x * (1 + p.saturation * self.current))
        force = p.constant * pull * pull - p.mass * p.gravity
        if into > 0:
            force -= math.copysign(STOP_N_M * into, self._y) + STOP_NS_M * self._v
        self._v += TICK_S * force / p.mass
        self._y += TICK_S * self._v
        self.tick += 1
        self._in_period += 1

    def _asked(self, reading: float) -> float:
        """The law: PID on the height around a current that nearly carries the ball."""
        law = self.law
        if self._mode < LIFT or (self._mode == LAND and self.moved):
            return 0.0
        if math.isnan(self._before):
            self._before = self._from = reading
        self._rate += 0.4 * ((reading - self._before) / TICK_S - self._rate)
        self._before = reading
        share = 1.0
        if self._mode != LEVITATE:
            self._clock = min(self._clock + TICK_S, law["lift_time_s"])
            t = self._clock / law["lift_time_s"]
            share = t * t * (3 - 2 * t)
            share = share if self._mode == LIFT else 1 - share
        error = self._from + share * (law["ref"] - self._from) - reading
        self._integral += law["ki"] * error * TICK_S
        asked = law["rest_current"] + law["kp"] * error + self._integral - law["kd"] * self._rate
        return min(max(asked, 0.0), self.p.current_limit)

    def _watch(self) -> None:
        p = self.p
        touching = abs(self._y) >= p.clearance
        self._flags |= (CONTACT if touching else 0) | (SATURATED if self._next >= p.current_limit else 0)
        self._lost = self._lost + 1 if touching and self._mode == LEVITATE else 0
        if self._lost * TICK_S > p.lost_time:
            self.trips |= LOST
            self._mode = OFF
        if self.current > p.trip_current:
            self.trips |= OVERCURRENT
