"""The whole sampled loop of the TSBS rig in plain Python, around the mechanics of `reference`: every law and error.

Sensor and amplifier errors, hysteresis, motor currents, rotation, hangings. No noise and no quantisation; about 0.1
times real time, so it serves windows of a few tenths of a second.
"""

from __future__ import annotations

import cmath
import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

from sim_backend.machines.tsbs.params import ControlParams, PlantParams
from sim_backend.machines.tsbs.reference import EMPTY, TICK_S, Array, Drive, Lever, Loads, derivative, harmonics
from sim_backend.machines.tsbs.reference_law import Law, clip, toward

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
    """States before the first and after every tick, (n + 1, 14); currents likewise: ten coils, then four segments in the
    stator's frame, complex."""

    s: Array
    currents: npt.NDArray[np.complex128]


@dataclass(frozen=True)
class Interval:
    """One tick between two samples: everything that drives the mechanics as a function of time."""

    p: PlantParams
    tick: int
    coils: Sequence[float]
    segments: Sequence[complex]
    coils_to: Sequence[float]
    segments_to: Sequence[complex]
    lag: Sequence[float]
    hanging: Hanging
    weight_before: float
    drive: Drive | None
    lever: Lever = EMPTY

    def loads(self, part: float) -> Loads:
        """What acts after the share `part` of the tick."""
        coils, segments = self.flowing(part)
        weight = self.hanging.weight(self.weight_before, self.tick + part)
        return Loads(coils, segments, self.lag, self.hanging.mass_kg, weight, self.drive, self.lever, self.coils)

    def flowing(self, part: float) -> tuple[list[float], list[complex]]:
        """Currents after the share `part` of the tick: first-order lags, exact for a constant target, in the stator's frame."""
        coil, segment = (math.exp(-rate * part * TICK_S) for rate in (self.p.amplifier_rate, self.p.segment_rate))
        return (
            [b + (a - b) * coil for a, b in zip(self.coils, self.coils_to, strict=True)],
            [b + (a - b) * segment for a, b in zip(self.segments, self.segments_to, strict=True)],
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
    coils, segments, follow = [0.0] * 10, [0j] * 4, [0.0] * RADIAL
    held = [0.0] * 10
    along: Sequence[complex] = [0j] * 4
    turn = 1 + 0j
    hanging, before, weight = Hanging(0, 0.0, 0.0, 0.0), 0.0, 0.0
    driving, drive = Driving(0, 0.0, 0.0, 0.0, 0.0), None
    levering, lever, from_lever = Levering(0, 0.0, 0.0, 0.0, 0.0), EMPTY, EMPTY
    states, flows = [s], [[*coils, *segments]]
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
        coils_to = settled_coils(p, held, tick * TICK_S)  # of the sample before: one sample of delay
        segments_to = [turn * i for i in settled_segments(p, along, tick * TICK_S)]
        lag = hysteresis(p, coils, follow)
        interval = Interval(p, tick, coils, segments, coils_to, segments_to, lag, hanging, before, drive, lever)
        angle, y = p.encoder_sign * (s[5] + p.encoder_offset), read_positions(p, s)
        held, along = law.radial(y), law.rotation(angle, y[2:4])
        field = p.encoder_sign * s[5] + law.gamma + law.ahead - p.gamma_zero
        turn = cmath.exp(1j * p.pole_pairs * field)
        s = advance(interval, s)
        weight = hanging.weight(before, tick + 1)
        coils, segments = interval.flowing(1.0)
        states.append(s)
        flows.append([*coils, *segments])
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


def settled_coils(p: PlantParams, reference: Sequence[float], now_s: float) -> list[float]:
    """Currents that the amplifiers of the coils tend to, (10,) A. Each loop closes on its own sensor, errors included."""
    rows = zip(reference, p.coil_limit, p.current_offset, p.current_drift, p.current_gain, strict=True)
    return [max((clip(r, 0, limit) - offset - drift * now_s) / gain, 0.0) for r, limit, offset, drift, gain in rows]


def settled_segments(p: PlantParams, reference: Sequence[complex], now_s: float) -> list[complex]:
    """The same of the segments, (4,) A along the field: the amplifiers cut what is beyond their limit, phase kept."""
    scale = 1 + p.segment_scale_drift * now_s
    rows = zip(reference, p.segment_offset, p.segment_drift, p.segment_sense, strict=True)
    return [
        (r * min(1.0, p.segment_limit / max(abs(r), 1e-9)) - offset - drift * now_s) / (gain * scale)
        for r, offset, drift, gain in rows
    ]


def hysteresis(p: PlantParams, i: Sequence[float], follow: list[float]) -> list[float]:
    """Play operator of half-width `hysteresis` on each radial control current. Updates `follow`; returns the lag."""
    lag = []
    for a in range(RADIAL):
        control = (i[2 * a] - i[2 * a + 1]) / 2
        follow[a] = clip(follow[a], control - p.hysteresis, control + p.hysteresis)
        lag.append(control - follow[a])
    return lag
