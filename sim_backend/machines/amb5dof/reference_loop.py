"""The sampled loop of the AMB stand in plain Python, around the mechanics and laws of its reference: sensor and amplifier
errors, delay, pulses, drive. No noise, no quantisation, no voltage limit; about 0.05 times real time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp

from sim_backend.core import LEVITATE, LIFT, DriveLaw
from sim_backend.machines.amb5dof.params import AmbControl, AmbParams
from sim_backend.machines.amb5dof.reference import TICK_S, Array, Vector, derivative, displacement
from sim_backend.machines.amb5dof.reference_law import CAC, CCS, PID, Model, Notch, References, cac, ccs, clip, landed
from sim_backend.machines.amb5dof.reference_observer import Observer


def read_positions(p: AmbParams, s: Vector, now: float = 0.0) -> list[float]:
    """What the sensors yi, zi, yo, zo, x read (2.17), without noise and quantisation."""
    planes = [displacement(s, place - s[0], p.shape_sensor[b::2]) for b, place in enumerate((-p.l_is, p.l_os))]
    radial = [value for plane in (planes[::-1] if p.exchange_planes else planes) for value in plane]
    for k in range(4):
        orders = range(4 * k, 4 * k + 4)
        radial[k] += sum(p.runout[n] * math.cos((n % 4 + 1) * s[5] + p.runout_phase[n]) for n in orders)
    if p.exchange_axes:
        radial = [radial[k] for k in (1, 0, 3, 2)]
    wave = math.sin(2 * math.pi * p.hum_hz * now)
    rows = zip([*radial, s[0]], p.position_sign, p.position_gain, p.position_offset, p.hum, strict=True)
    read = [sign * (gain * y + off) + hum * wave for y, sign, gain, off, hum in rows]
    return [clip(y, -p.position_range, p.position_range) for y in read]


class Tachometer:
    """Once-per-turn pulses and what speed they tell."""

    def __init__(self) -> None:
        self.pulses: list[float] = []
        self.fired = [0.0, 0.0]

    def advance(self, p: AmbParams, before: float, after: float, tick: int) -> None:
        """Pulses while the shaft's angle went in a straight line from `before` to `after` in a tick."""
        marks = [p.pulse_angle] + ([p.pulse_angle - p.pulse_doubled] if p.pulse_doubled else [])
        for k, mark in enumerate(marks):
            turns = math.floor((before + mark) / (2 * math.pi)), math.floor((after + mark) / (2 * math.pi))
            at = max(turns) * 2 * math.pi - mark
            if turns[0] == turns[1] or abs(at - self.fired[k]) < 0.5:
                continue
            self.fired[k] = at
            ended = p.pulse_last and len(self.pulses) >= p.pulse_last
            if not ended and (k or not (p.pulse_missing and max(turns) % p.pulse_missing == 0)):
                self.pulses.append((tick + (at - before) / (after - before)) * TICK_S)

    def speed(self, now: float) -> float:
        """rad/s from the last two pulses, less when the next is late."""
        if len(self.pulses) < 2 or now - self.pulses[-1] > 0.5:
            return 0.0
        return 2 * math.pi / max(self.pulses[-1] - self.pulses[-2], now - self.pulses[-1])


@dataclass
class Law:
    """State of the laws; called once per tick with the readings and the speed it gives ten current references."""

    c: AmbControl
    mode: int = LEVITATE
    model: Model = field(init=False)
    references: References | None = None
    waiting: Array = field(default_factory=lambda: np.zeros(10))
    sent: Array = field(default_factory=lambda: np.zeros(10))
    ticks: int = 0

    def __post_init__(self) -> None:
        self.model = Model(self.c)
        c = self.c
        self.notches = [[Notch(c.notch1_hz, c.notch1_q), Notch(c.notch2_hz, c.notch2_q)] for _ in range(4)]
        self.filtered = np.zeros(5)
        self.sum = np.zeros(5)
        self.observer: Observer | None = None

    def __call__(self, position: Vector, omega: float) -> Array:
        c, m = self.c, self.model
        at = np.array(position)
        for k, pair in enumerate(self.notches):
            for notch in pair:
                at[k] = notch(at[k])
        if self.references is None:
            self.previous, self.references = at, References(c, m.coordinates(at, at[4]))
            still, gaps = np.zeros(5), m.gaps(self.references.set)
            rows = zip(m.flat(self.references.set, still, still, 0.0), m.beta, m.gap, gaps, strict=True)
            self.pid = [ccs(f, beta, gap, xi, c.bias) for f, beta, gap, xi in rows]
        keep = 1 / (1 + 2 * math.pi * c.derivative_hz * TICK_S)
        self.filtered = keep * self.filtered + (1 - keep) * (at - self.previous) / TICK_S
        self.previous = at
        over = landed(c, self.mode, self.references.clock)
        r, v, a = self.references(c, self.mode)
        coil = self._pid(at, r, v) if c.law == PID else self._flatness(at, omega, r, v, a)
        coil = [clip(i, 0.0, c.current_limit) for i in coil]
        self._inject(coil)
        out = np.zeros(10) if over else np.array(coil)
        self.sent, self.waiting = self.waiting, out
        self.ticks += 1
        return out

    def _inject(self, coil: list[float]) -> None:
        c = self.c
        if c.inject_axis < 0 or c.inject_amplitude == 0:
            return
        n, t, k = int(c.inject_lines), self.ticks * TICK_S, 2 * int(c.inject_axis)
        phases = [2 * math.pi * (c.inject_hz + j * c.inject_step) * t - math.pi * j * (j + 1) / n for j in range(n)]
        e = c.inject_amplitude * sum(map(math.sin, phases))
        coil[k : k + 2] = [clip(coil[k] + e, 0, c.current_limit), clip(coil[k + 1] - e, 0, c.current_limit)]

    def _pid(self, at: Array, r: Array, v: Array) -> list[float]:
        c, out = self.c, []
        errors, rates = self.model.planes(r) - at, self.model.planes(v) - self.filtered
        for k in range(5):
            di = c.kp * errors[k] + self.pid[k] + c.kd * rates[k]
            if abs(di) < c.bias or di * errors[k] < 0:
                self.pid[k] += c.ki * errors[k] * TICK_S
            di = clip(di, -c.bias, c.bias)
            out += [c.bias + di, c.bias - di]
        return out

    def _flatness(self, at: Array, omega: float, r: Array, v: Array, a: Array) -> list[float]:
        c, m = self.c, self.model
        q, rate = m.coordinates(at, at[4]), m.coordinates(self.filtered, 0.0)
        against, wave, ahead = np.zeros(5), np.zeros(5), np.zeros(5)
        if c.observer:
            self.observer = self.observer or Observer(c, m)
            found = self.observer(c, q, omega, self.sent, self.waiting)
            rate[1:], against[1:], wave[1:], ahead[1:] = found.rate, found.against, found.wave, found.ahead
        on = np.array([1.0, *[float(c.integral != 0)] * 4])
        self.sum += c.k0 * on * (q - r) * TICK_S
        k2 = {CCS: c.k2_ccs, CAC: c.k2_cac}[int(c.law)]
        wanted = a - k2 * (rate - v) - c.k1 * (q - r) - on * self.sum - against  # (2.16)
        slow = np.array(m.flat(q, rate, wanted, omega))
        both, led = (np.array(m.flat(q, rate, wanted - extra, omega)) for extra in (wave, ahead))
        out: list[float] = []
        for k, (beta, gap) in enumerate(zip(m.beta, m.gap, strict=True)):
            xi = clip(m.gaps(q)[k], -0.9 * gap, 0.9 * gap)
            if c.law == CAC:
                out += cac(led[k], beta, gap, xi, c.eta)
                continue
            at_slow = ccs(slow[k], beta, gap, xi, c.bias)  # the lead goes on the current, by the slope of (2.24) there
            slope = 2 * beta * ((c.bias + at_slow) / (gap - xi) ** 2 + (c.bias - at_slow) / (gap + xi) ** 2)
            di = clip(ccs(both[k], beta, gap, xi, c.bias) + (led[k] - both[k]) / slope, -c.bias, c.bias)
            out += [c.bias + di, c.bias - di]
        return out


Rates = Callable[[float, Vector], list[float]]
Advance = Callable[[Rates, Vector], list[float]]


def runge_kutta(rates: Rates, s: Vector, steps: int = 2) -> list[float]:
    """A tick by `steps` classical steps; `rates(t, s)` with t from the start of the tick."""
    h, at = TICK_S / steps, np.array(s)
    for n in range(steps):
        k1 = np.array(rates(n * h, at.tolist()))
        k2 = np.array(rates((n + 0.5) * h, (at + h / 2 * k1).tolist()))
        k3 = np.array(rates((n + 0.5) * h, (at + h / 2 * k2).tolist()))
        k4 = np.array(rates((n + 1) * h, (at + h * k3).tolist()))
        at = at + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return [float(x) for x in at]


def dop853(rates: Rates, s: Vector) -> list[float]:
    """A tick by an adaptive method of order 8, restarted at each sample."""
    found = solve_ivp(rates, (0, TICK_S), s, "DOP853", rtol=1e-12, atol=1e-18)
    return [float(x) for x in found.y[:, -1]]


@dataclass
class Trace:
    """States (n + 1, 20) and coil currents (n + 1, 10) at the samples."""

    s: Array
    coil: Array


def simulate(
    p: AmbParams,
    c: AmbControl,
    start: Vector,
    ticks: int,
    *,
    mode: int = LEVITATE,
    drive: tuple[DriveLaw, float] | None = None,
    weights: Sequence[complex] = (0j, 0j),
    advance: Advance = runge_kutta,
) -> Trace:
    """Run the loop from a state with the currents off. `drive`: a drive and the speed rad/s that it is to reach."""
    law, tacho = Law(c, mode), Tachometer()
    s, coil, following = list(start), np.zeros(10), np.zeros(10)
    gains, offsets = np.array(p.current_gain), np.array(p.current_offset)
    states, currents, drive_speed = [s], [coil], s[11]
    for tick in range(ticks):
        applied = following  # one sample of delay
        following = law(read_positions(p, s, tick * TICK_S), tacho.speed(tick * TICK_S))
        to = np.maximum((np.clip(applied, 0, p.coil_limit) - offsets) / gains, 0)
        torque = -p.coulomb * s[11] / math.hypot(s[11], p.coulomb_speed)
        if drive:
            drive_speed += clip(drive[1] - drive_speed, -drive[0].ramp * TICK_S, drive[0].ramp * TICK_S)
            torque += clip(drive[0].gain * (drive_speed - s[11]), -drive[0].limit, drive[0].limit)

        def rates(t: float, at: Vector, *, to: Array = to, coil: Array = coil, torque: float = torque) -> list[float]:
            lag = math.exp(-p.amplifier_rate * t)
            return derivative(p, at, (to + (coil - to) * lag).tolist(), torque, weights)

        after = advance(rates, s)
        tacho.advance(p, s[5], after[5], tick)
        coil = to + (coil - to) * math.exp(-p.amplifier_rate * TICK_S)
        s = after
        states.append(s)
        currents.append(coil)
    return Trace(np.array(states), np.array(currents))


__all__ = ["LEVITATE", "LIFT", "Law", "Tachometer", "Trace", "dop853", "read_positions", "runge_kutta", "simulate"]
