"""The control law of the TSBS rig in plain Python: levitation by the AMBs or with the motor, rotation, sharing of currents."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from sim_backend.machines.tsbs.params import ControlParams
from sim_backend.machines.tsbs.reference import TICK_S


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

    `radial` and `rotation` take the readings of one tick and return the references of 10 coils and 4 segments in A, these
    along a field that is turned by `gamma` and `ahead` from the angle read.
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
    gamma: float = 0.0
    ahead: float = 0.0

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
        self.angle_previous, self.gamma = angle, c.gamma
        self.ahead = self.angle_slope * c.segment_lag if c.lag_compensation else 0.0
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
