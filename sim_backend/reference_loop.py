"""The whole sampled loop of the TSBS rig in plain Python, around the mechanics of `reference`: every law and error.

Sensor and amplifier errors, hysteresis, motor currents, rotation, hangings. No noise and no quantisation; about 0.1
times real time, so it serves windows of a few tenths of a second.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp

from sim_backend.core.params import ControlParams, PlantParams
from sim_backend.reference import TICK_S, Array, Drive, Loads, derivative, harmonics

RADIAL = 4  # axes xi, yi, xo, yo; the fifth is z


def read_positions(p: PlantParams, s: Sequence[float]) -> list[float]:
    """What the position sensors xi, yi, xo, yo, z read in m, T (6.7), without noise and quantisation."""
    raw: list[float] = []
    for b, zeta in enumerate(p.z_sensor):
        part = slice(4 * b, 4 * b + 4)
        rx, ry = harmonics(p.target[part], p.target_phase[part], s[5])
        pair = [s[0] + zeta * s[4] + rx, s[1] - zeta * s[3] + ry]
        raw += pair[::-1] if p.exchange_axes[b] else pair
    raw.append(s[2])
    rows = zip(raw, p.position_gain, p.position_offset, p.position_sign, strict=True)
    read = [sign * (gain * y + offset) for y, gain, offset, sign in rows]
    return [p.stuck_value if stuck else y for y, stuck in zip(read, p.stuck, strict=True)]


def clip(x: float, low: float, high: float) -> float:
    """`x` limited to the range."""
    return min(max(x, low), high)


def toward(x: float, goal: float, step: float) -> float:
    """One step of at most `step` from `x` to `goal`."""
    return x + clip(goal - x, -step, step)


def keep(hz: float) -> float:
    """Share of a first-order low-pass filter's memory that survives a tick."""
    return 1 / (1 + 2 * math.pi * hz * TICK_S)


@dataclass
class Law:
    """Control law while levitating: PID in the actuator planes with constant current sum, angle loop, T (6.9).

    `radial` and `rotation` take the readings of one tick and return the references of 10 coils and 4 segments in A.
    """

    c: ControlParams
    integral: list[float] = field(default_factory=lambda: [0.0] * 5)
    slope: list[float] = field(default_factory=lambda: [0.0] * 5)
    previous: list[float] | None = None
    angle_previous: float | None = None
    angle_target: float = 0.0
    speed_target: float = 0.0
    angle_integral: float = 0.0
    angle_slope: float = 0.0
    i_x: float = 0.0
    i_y: float = 0.0

    def planes(self, y: Sequence[float]) -> list[float]:
        """Displacement at the actuators from the sensors, T (6.7) with the controller's geometry."""
        c = self.c
        inboard = [y[a] + c.share_i * (y[a + 2] - y[a]) for a in (0, 1)]
        outboard = [y[a] + c.share_o * (y[a + 2] - y[a]) for a in (0, 1)]
        return [*inboard, *outboard, y[4]]

    def radial(self, readings: Sequence[float]) -> list[float]:
        """Coil references in A."""
        c, y = self.c, self.planes(readings)
        before = self.previous or y
        end = ("i", "i", "o", "o", "z")
        goals = (c.ref_xi, c.ref_yi, c.ref_xo, c.ref_yo, c.ref_z)
        out: list[float] = []
        for a in range(5):
            kp, kd, ki, bias = (float(getattr(c, f"{k}_{end[a]}")) for k in ("kp", "kd", "ki", "bias"))
            error, k, room = goals[a] - y[a], keep(c.derivative_hz), c.current_limit - bias
            self.slope[a] = k * self.slope[a] + (1 - k) * (y[a] - before[a]) / TICK_S
            control = kp * error + self.integral[a] - kd * self.slope[a]
            if abs(control) < room or control * error < 0:  # the integrator waits while the amplifier is at its limit
                self.integral[a] += ki * error * TICK_S
            control = clip(control, -room, room)
            out += [clip(bias + control, 0, c.current_limit), clip(bias - control, 0, c.current_limit)]
        self.previous = y
        return out

    def rotation(self, angle: float) -> list[float]:
        """Segment references in A."""
        c, k = self.c, keep(self.c.angle_hz)
        before = angle if self.angle_previous is None else self.angle_previous
        self.angle_slope = k * self.angle_slope + (1 - k) * (angle - before) / TICK_S
        self.angle_previous = angle
        released = not c.torque_on or c.kp_theta == c.kd_theta == c.ki_theta == 0
        if released:
            self.angle_target, self.speed_target, self.angle_integral = angle, self.angle_slope, 0.0
        elif c.speed_ref or self.speed_target:
            self.speed_target = toward(self.speed_target, c.speed_ref, c.acceleration * TICK_S)
            self.angle_target += self.speed_target * TICK_S
        else:
            self.angle_target = toward(self.angle_target, c.angle_ref, c.angle_slew * TICK_S)
        error = self.angle_target - angle
        beyond = error - clip(error, -1.6e-3, 1.6e-3)  # one encoder count is no error
        self.angle_integral = clip(self.angle_integral + c.ki_theta * beyond * TICK_S, -2, 2)
        damping = c.kd_theta * (self.speed_target - self.angle_slope)
        i = clip(c.kp_theta * error + self.angle_integral + damping, -10, 10) if not released else 0.0
        self.i_x, self.i_y = (toward(a, b, c.ramp_A_s * TICK_S) for a, b in ((self.i_x, c.i_x), (self.i_y, c.i_y)))
        return [i + self.i_y, i - self.i_x, i - self.i_y, i + self.i_x]


@dataclass(frozen=True)
class Hanging:
    """A change of the hung mass at the start of tick `tick`; its weight is handed over in `ramp_s`."""

    tick: int
    mass_kg: float
    weight_N: float
    ramp_s: float

    def weight(self, before: float, at_tick: float) -> float:
        """Weight in N at a time in ticks, `before` being what was carried when this hanging began."""
        share = (at_tick - self.tick) * TICK_S / max(self.ramp_s, TICK_S)
        return before + clip(share, 0, 1) * (self.weight_N - before)


@dataclass(frozen=True)
class Driving:
    """From the start of tick `tick` on an external drive takes the shaft to a speed; `gain` 0 is a drive that is off."""

    tick: int
    target: float
    gain: float
    limit: float
    ramp: float


@dataclass(frozen=True)
class Trace:
    """States before the first and after every tick, (n + 1, 14); currents likewise: ten coils, then four segments."""

    s: Array
    currents: Array


@dataclass(frozen=True)
class Interval:
    """One tick between two samples: everything that drives the mechanics as a function of time."""

    p: PlantParams
    tick: int
    currents: Sequence[float]
    target: Sequence[float]
    lag: Sequence[float]
    gamma: float
    hanging: Hanging
    weight_before: float
    drive: Drive | None

    def loads(self, part: float) -> Loads:
        """What acts after the share `part` of the tick."""
        i = np.array(amplifier(self.p, self.currents, self.target, part * TICK_S))
        weight = self.hanging.weight(self.weight_before, self.tick + part)
        return Loads(i[:10], i[10:], np.array(self.lag), self.gamma, self.hanging.mass_kg, weight, self.drive)


def runge_kutta(interval: Interval, s: Sequence[float], substeps: int) -> list[float]:
    """State at the end of the tick by the classical fourth-order method."""
    h = 1 / substeps
    y = np.array(s)

    def f(part: float, y: Array) -> Array:
        return TICK_S * derivative(interval.p, y, interval.loads(part))

    for n in range(substeps):
        t = n * h
        k1 = f(t, y)
        k2 = f(t + h / 2, y + h / 2 * k1)
        k3 = f(t + h / 2, y + h / 2 * k2)
        k4 = f(t + h, y + h * k3)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return [float(x) for x in y]


def dop853(interval: Interval, s: Sequence[float]) -> list[float]:
    """State at the end of the tick by scipy's eighth-order method at a relative tolerance of 1e-12."""

    def f(part: float, y: Array) -> Array:
        return TICK_S * derivative(interval.p, y, interval.loads(part))

    done = solve_ivp(f, (0, 1), s, method="DOP853", rtol=1e-12, atol=1e-16, first_step=0.5)
    return [float(x) for x in done.y[:, -1]]


def simulate(
    p: PlantParams,
    c: ControlParams,
    start: Sequence[float],
    ticks: int,
    *,
    hangings: Sequence[Hanging] = (),
    drivings: Sequence[Driving] = (),
    advance: Callable[[Interval, Sequence[float]], list[float]] | None = None,
) -> Trace:
    """Closed loop from the state `start`, currents at zero, the law levitating from tick 0.

    Args:
        p: the plant; its noise, quantisation and encoder counts are taken as off.
        advance: state at the end of an interval; two Runge-Kutta steps unless told.
    """
    advance = advance or (lambda interval, s: runge_kutta(interval, s, 2))
    s, law = [float(x) for x in start], Law(c)
    currents, reference, gamma, follow = [0.0] * 14, [0.0] * 14, 0.0, [0.0] * RADIAL
    hanging, before, weight = Hanging(0, 0.0, 0.0, 0.0), 0.0, 0.0
    driving, drive = Driving(0, 0.0, 0.0, 0.0, 0.0), None
    states, flows = [s], [currents]
    for tick in range(ticks):
        for new in (h for h in hangings if h.tick == tick):
            if hanging.mass_kg == 0:  # the strap is just taut
                s = [*s[:12], s[1] - p.z_hook * s[3], s[7] - p.z_hook * s[9]]
            hanging, before = new, weight
        driving = next((d for d in drivings if d.tick == tick), driving)
        drive = driven(driving, drive, s[11])
        target = settled_currents(p, reference, tick * TICK_S)  # of the sample before: one sample of delay
        interval = Interval(p, tick, currents, target, hysteresis(p, currents, follow), gamma, hanging, before, drive)
        angle = p.encoder_sign * (s[5] + p.encoder_offset)
        reference, gamma = [*law.radial(read_positions(p, s)), *law.rotation(angle)], c.gamma
        s = advance(interval, s)
        currents, weight = amplifier(p, currents, target, TICK_S), hanging.weight(before, tick + 1)
        states.append(s)
        flows.append(currents)
    return Trace(np.array(states), np.array(flows))


def driven(driving: Driving, before: Drive | None, spin: float) -> Drive | None:
    """The drive over one tick: its speed ramps to the target from where it was, or from the shaft's when it starts."""
    if driving.gain == 0:
        return None
    speed = spin if before is None else before.speed
    return Drive(toward(speed, driving.target, driving.ramp * TICK_S), driving.gain, driving.limit)


def settled_currents(p: PlantParams, reference: Sequence[float], now_s: float) -> list[float]:
    """Currents that the amplifiers tend to, (14,) A. A coil's loop closes on its own sensor, errors included."""
    coil = [
        max((clip(r, 0, limit) - offset - drift * now_s) / gain, 0)
        for r, limit, offset, drift, gain in zip(
            reference[:10], p.coil_limit, p.current_offset, p.current_drift, p.current_gain, strict=True
        )
    ]
    return coil + [clip(r, -p.segment_limit, p.segment_limit) for r in reference[10:]]


def amplifier(p: PlantParams, now: Sequence[float], to: Sequence[float], after_s: float) -> list[float]:
    """Currents `after_s` later: first-order lags, exact for a constant target."""
    coil, segment = math.exp(-p.amplifier_rate * after_s), math.exp(-p.segment_rate * after_s)
    return [b + (a - b) * (coil if k < 10 else segment) for k, (a, b) in enumerate(zip(now, to, strict=True))]


def hysteresis(p: PlantParams, i: Sequence[float], follow: list[float]) -> list[float]:
    """Play operator of half-width `hysteresis` on each radial control current. Updates `follow`; returns the lag."""
    lag = []
    for a in range(RADIAL):
        control = (i[2 * a] - i[2 * a + 1]) / 2
        follow[a] = clip(follow[a], control - p.hysteresis, control + p.hysteresis)
        lag.append(control - follow[a])
    return lag
