"""A step of the rotor's angle while the motor carries the shaft: the response of the angle, and the excursion off centre.

All functions are pure; times are s from the moment when the torque current answers, angles rad from where the reference
stood before.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError

Array = npt.NDArray[np.float64]
SMOOTH = 5  # samples of the parabola that a peak is read from: keeps a peak's height, halves the noise's variance
TAIL_S = 0.3  # at the end of a record, where the rotor stands again


@dataclass(frozen=True)
class Move:
    """One step. `t` (n,); `angle` (n,) rad; `orbit` and `motor` (2, n) m: x and y off the sensors' zero, at the outboard
    sensor and at the motor; `segments` (4, n) A; `saturated` (n,) where an amplifier cut its demand; `rest_orbit` and
    `rest_motor` (2, m) m, `rest_segments` (4, m) A of the standstill before. `step` rad is signed; `components` of a segment's
    current: its amplitude, or q and d in turn; `rest_angle` (m,) rad, as `angle`."""

    step: float
    t: Array
    angle: Array
    orbit: Array
    motor: Array
    segments: Array
    saturated: npt.NDArray[np.bool_]
    rest_orbit: Array
    rest_motor: Array
    rest_segments: Array
    components: int = 1
    rest_angle: Array = field(default_factory=lambda: np.empty(0))

    @property
    def torque(self) -> tuple[Array, Array]:
        """Currents (k, n) and (k, m) A along the field, whose mean is the torque current; after the step and before it."""
        return self.segments[:: self.components], self.rest_segments[:: self.components]


@dataclass(frozen=True)
class Response:
    """What one step shows: `rise` (10 to 90 %), `settling` s; `overshoot` as a share of the step; `final_error` rad;
    peak radii m off centre at the outboard sensor and at the motor and those at standstill, with the direction of the peak
    (unit vector) and `floor`, what noise alone may add to a peak; `saturated` s; `hold` A, torque current at the end and
    before; `slopes` rad/s of the angle at 10 and 90 %."""

    rise: float
    settling: float
    overshoot: float
    final_error: float
    peak: float
    peak_motor: float
    rest_peak: float
    rest_peak_motor: float
    towards: Array
    towards_motor: Array
    floor: float
    saturated: float
    hold: tuple[float, float]
    slopes: tuple[float, float]


def response(m: Move, band: float) -> Response:
    """Measure one move. `band` rad: settled is when the angle stays within it of the target.

    Raises:
        AnalysisError: the angle never reaches 90 % of the step, or the record is too short.
    """
    period = float(np.median(np.diff(m.t)))
    sign, size = math.copysign(1.0, m.step), abs(m.step)
    y = m.angle * sign
    low, high = _crossing(m.t, y, 0.1 * size), _crossing(m.t, y, 0.9 * size)
    outside = np.flatnonzero(np.abs(y - size) > band)
    settled = 0.0 if not len(outside) else float(m.t[min(outside[-1] + 1, len(m.t) - 1)])
    if len(outside) and outside[-1] >= len(y) - 2:
        settled = math.inf
    tail = m.t > m.t[-1] - TAIL_S
    peak, towards = peak_radius(m.orbit)
    peak_motor, towards_motor = peak_radius(m.motor)
    return Response(
        rise=high[0] - low[0],
        settling=settled,
        overshoot=max(float(y.max()) / size - 1, 0.0),
        final_error=float((m.angle[tail] - m.step).mean()),
        peak=peak,
        peak_motor=peak_motor,
        rest_peak=peak_radius(m.rest_orbit)[0],
        rest_peak_motor=peak_radius(m.rest_motor)[0],
        towards=towards,
        towards_motor=towards_motor,
        floor=noise_floor(m.rest_orbit),
        saturated=float(m.saturated.sum()) * period,
        hold=(float(m.torque[0][:, tail].mean()), float(m.torque[1].mean())),
        slopes=(low[1], high[1]),
    )


def _crossing(t: Array, y: Array, level: float) -> tuple[float, float]:
    """When y first passes a level, and how fast it then goes, from a line through the samples about it (encoder counts
    make stairs of it, so that the two neighbours would not do)."""
    above = np.flatnonzero(y >= level)
    if not len(above) or above[0] == 0:
        raise AnalysisError(
            f"the angle reaches {np.degrees(y.max()):.2f} deg; expected at least {np.degrees(level):.2f} deg"
        )
    k = int(above[0])
    near = slice(max(k - 2, 0), k + 3)
    slope, offset = np.polyfit(t[near], y[near], 1)
    if slope <= 0:
        return float(t[k]), max(float(y[k] - y[k - 1]) / float(t[k] - t[k - 1]), 1e-6)
    return float((level - offset) / slope), float(slope)


def smoothed(orbit: Array) -> Array:
    """(2, n): each sample from a parabola through its neighbours (Savitzky and Golay)."""
    from scipy import signal

    if orbit.shape[1] < SMOOTH:
        return orbit
    out: Array = signal.savgol_filter(orbit, SMOOTH, 2, axis=1)
    return out


def peak_radius(orbit: Array) -> tuple[float, Array]:
    """Greatest distance off centre, m, and its direction (2,). The largest of many noisy samples is biased high; the
    parabola takes most of that away, `noise_floor` bounds the rest."""
    s = smoothed(orbit)
    radius = np.hypot(*s)
    k = int(np.argmax(radius))
    return float(radius[k]), s[:, k] / max(float(radius[k]), 1e-300)


def noise_floor(rest: Array) -> float:
    """What the largest of the samples of a standstill is expected to exceed their middle by, from noise alone: the
    standard deviation of the smoothed samples times sqrt(2 ln n) (extremes of a normal sample)."""
    s = smoothed(rest)
    sigma = float(np.sqrt((s.std(axis=1) ** 2).mean()))
    return sigma * math.sqrt(2 * math.log(max(s.shape[1], 2)))


@dataclass(frozen=True)
class Loop:
    """The angle's control loop as a rigid rotor sees it: gains A/rad, A s/rad, A/(rad s), filter Hz of the derivative, inertia
    kg m^2, torque constant N m/A, largest torque current A."""

    kp: float
    kd: float
    ki: float
    filter_hz: float
    inertia: float
    torque_constant: float
    limit_A: float


def kick_A(loop: Loop, step: float, tick_s: float = 1e-4) -> float:
    """Torque current that a step asks for at once: proportional, and the derivative's through its filter (backward Euler)."""
    gain = 2 * math.pi * loop.filter_hz
    return abs(step) * (loop.kp + loop.kd * gain / (1 + gain * tick_s))


def fastest(loop: Loop, step: float, seconds: float = 1.0, tick_s: float = 5e-4) -> float:
    """Greatest speed in rad/s that a step leads to, without friction: an upper estimate for the envelope."""
    keep = 1 / (1 + 2 * math.pi * loop.filter_hz * tick_s)
    angle = speed = integral = filtered = 0.0
    previous, most = 0.0, 0.0
    for _ in range(round(seconds / tick_s)):
        error = abs(step) - angle
        filtered = keep * filtered + (1 - keep) * (error - previous) / tick_s
        previous = error
        integral += loop.ki * error * tick_s
        current = min(max(loop.kp * error + integral + loop.kd * filtered, -loop.limit_A), loop.limit_A)
        speed += current * loop.torque_constant / loop.inertia * tick_s
        angle += speed * tick_s
        most = max(most, abs(speed))
    return most
