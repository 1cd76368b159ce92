"""The whole sampled loop of the TSBS rig in plain Python, around the mechanics of `reference`: every law and error.

Sensor and amplifier errors, hysteresis, motor currents, rotation, hangings. No noise and no quantisation; about 0.1
times real time, so it serves windows of a few tenths of a second.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp

from sim_backend.core.params import ControlParams, PlantParams
from sim_backend.reference import EMPTY, TICK_S, Array, Drive, Lever, Loads, derivative, harmonics

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
    goal_previous: float | None = None
    goal_slope: float = 0.0
    phase: float = 0.0
    share: float = 0.0
    carrier: Carrier = field(default_factory=lambda: Carrier())

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
        self.share = toward(self.share, c.motor_share, c.share_slew * TICK_S)
        for a in range(5):
            fade, waits = (1 - self.share, self.share > 0) if a in (2, 3) else (1.0, False)  # the outboard AMB
            kp, kd, ki, bias = (float(getattr(c, f"{k}_{end[a]}")) for k in ("kp", "kd", "ki", "bias"))
            error, k, room = goals[a] - y[a], keep(c.derivative_hz), c.current_limit - bias
            self.slope[a] = k * self.slope[a] + (1 - k) * (y[a] - before[a]) / TICK_S
            control = kp * error + self.integral[a] - kd * self.slope[a]
            # the integrator waits while the amplifier is at its limit, and while the motor carries
            if not waits and (abs(control) < room or control * error < 0):
                self.integral[a] += ki * error * TICK_S
            control = clip(control, -room, room)
            out += [fade * clip(bias + control, 0, c.current_limit), fade * clip(bias - control, 0, c.current_limit)]
        self.previous = y
        return out

    def rotation(self, angle: float, outboard: Sequence[float]) -> list[float]:
        """Segment references in A, from the angle and the outboard sensors' readings."""
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
        swings = not released and not c.speed_ref and not self.speed_target and c.sine_amplitude
        self.phase = self.phase + 2 * math.pi * c.sine_hz * TICK_S if swings else 0.0
        goal = self.angle_target + c.sine_amplitude * math.sin(self.phase)
        error = goal - angle
        goal_before = angle if self.goal_previous is None else self.goal_previous
        self.goal_slope = k * self.goal_slope + (1 - k) * (goal - goal_before) / TICK_S
        self.goal_previous = goal
        beyond = error - clip(error, -1.6e-3, 1.6e-3)  # one encoder count is no error
        self.angle_integral = clip(self.angle_integral + c.ki_theta * beyond * TICK_S, -2, 2)
        damping = c.kd_theta * ((self.goal_slope if c.derivative_on_error else self.speed_target) - self.angle_slope)
        i = c.kp_theta * error + self.angle_integral + damping if not released else 0.0
        self.i_x, self.i_y = (toward(a, b, c.i_ramp * TICK_S) for a, b in ((self.i_x, c.i_x), (self.i_y, c.i_y)))
        carried = self.carrier.currents(c, self.share, outboard)
        return allocate(c, self.i_x + carried[0], self.i_y + carried[1], i)


@dataclass
class Carrier:
    """The motor in place of the outboard AMB: PID on the outboard sensors."""

    integral: list[float] = field(default_factory=lambda: [0.0, 0.0])
    slope: list[float] = field(default_factory=lambda: [0.0, 0.0])
    previous: list[float] | None = None

    def currents(self, c: ControlParams, share: float, y: Sequence[float]) -> list[float]:
        """Its share of i_x and i_y in A."""
        before, self.previous = self.previous or list(y), list(y)
        if share == 0:
            self.integral, self.slope = [0.0, 0.0], [0.0, 0.0]
            return [0.0, 0.0]
        out, k = [], keep(c.derivative_hz)
        for a, goal in enumerate((c.ref_xm, c.ref_ym)):
            error = goal - y[a]
            self.slope[a] = k * self.slope[a] + (1 - k) * (y[a] - before[a]) / TICK_S
            i = c.kp_m * error + self.integral[a] - c.kd_m * self.slope[a]
            if abs(i) < c.segment_max or i * error < 0:
                self.integral[a] += c.ki_m * error * TICK_S
            out.append(share * i)
        return out


def allocate(c: ControlParams, ix: float, iy: float, turn: float) -> list[float]:
    """Segment currents in A from the currents for force and torque: T (6.9), or T (6.19) with (6.24), force first."""
    if not c.allocation:
        return [turn + iy, turn - ix, turn - iy, turn + ix]
    limit = c.segment_max
    ix, iy = clip(ix, -limit, limit), clip(iy, -limit, limit)
    room = 2 * limit - abs(ix) - abs(iy)
    part = (limit - abs(iy)) / room if room > 0 else 0.5  # lambda, T (6.24a)
    turn = clip(turn, -room / 2, room / 2)  # T (6.24b)
    return [2 * part * turn + iy, 2 * (1 - part) * turn - ix, 2 * part * turn - iy, 2 * (1 - part) * turn + ix]


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
class Levering:
    """From the start of tick `tick` on a mass hangs on the lever, or none; `arm_m` is positive on the left. `ring` is the
    inertia of what else is mounted on the shaft, kg m^2."""

    tick: int
    mass_kg: float
    weight_N: float
    arm_m: float
    ramp_s: float
    ring: float = 0.0


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
    lever: Lever = EMPTY

    def loads(self, part: float) -> Loads:
        """What acts after the share `part` of the tick."""
        i = np.array(amplifier(self.p, self.currents, self.target, part * TICK_S))
        weight = self.hanging.weight(self.weight_before, self.tick + part)
        held = np.array(self.currents[:10])
        return Loads(
            i[:10], i[10:], np.array(self.lag), self.gamma, self.hanging.mass_kg, weight, self.drive, self.lever, held
        )


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
    leverings: Sequence[Levering] = (),
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
    levering, lever, from_lever = Levering(0, 0.0, 0.0, 0.0, 0.0), EMPTY, EMPTY
    states, flows = [s], [currents]
    for tick in range(ticks):
        for new in (h for h in hangings if h.tick == tick):
            if hanging.mass_kg == 0:  # the strap is just taut
                s = [*s[:12], s[1] - p.z_hook * s[3], s[7] - p.z_hook * s[9]]
            hanging, before = new, weight
        driving = next((d for d in drivings if d.tick == tick), driving)
        drive = driven(driving, drive, s[11])
        if begun := [x for x in leverings if x.tick == tick]:
            levering, from_lever, lever = begun[-1], lever, dataclasses.replace(lever, slip=0.0)
        lever = levered(p, levering, from_lever, lever, tick, s[5])
        target = settled_currents(p, reference, tick * TICK_S)  # of the sample before: one sample of delay
        lag, commutated = hysteresis(p, currents, follow), gamma - 2 * s[5] if p.encoder_sign < 0 else gamma
        interval = Interval(p, tick, currents, target, lag, commutated, hanging, before, drive, lever)
        angle, y = p.encoder_sign * (s[5] + p.encoder_offset), read_positions(p, s)
        reference, gamma = [*law.radial(y), *law.rotation(angle, y[2:4])], c.gamma
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


def levered(p: PlantParams, to: Levering, before: Lever, now: Lever, tick: int, theta: float) -> Lever:
    """The lever over one tick: weight and moment go evenly from what they were; it slips at a rate that goes with the
    torque that it passes on."""
    part = clip((tick - to.tick + 1) * TICK_S / max(to.ramp_s, TICK_S), 0, 1)
    weight = before.weight + part * (to.weight_N - before.weight)
    moment = before.moment + part * (to.weight_N * to.arm_m - before.moment)
    slip = now.slip + p.lever_slip * moment * math.cos(theta + now.slip) * TICK_S
    return Lever(weight, moment, slip, to.mass_kg * to.arm_m**2 + to.ring)


def settled_currents(p: PlantParams, reference: Sequence[float], now_s: float) -> list[float]:
    """Currents that the amplifiers tend to, (14,) A. Each loop closes on its own sensor, errors included."""
    coil = [
        max((clip(r, 0, limit) - offset - drift * now_s) / gain, 0)
        for r, limit, offset, drift, gain in zip(
            reference[:10], p.coil_limit, p.current_offset, p.current_drift, p.current_gain, strict=True
        )
    ]
    return coil + [
        (clip(r, -p.segment_limit, p.segment_limit) - offset - drift * now_s) / gain
        for r, offset, drift, gain in zip(
            reference[10:], p.segment_offset, p.segment_drift, p.segment_sense, strict=True
        )
    ]


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
