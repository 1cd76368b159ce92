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
SHORT = (2, 2)  # samples to either side, and degree, of the curve that a peak is read from
LONG = (3, 4)  # of the one to compare
WITHIN = 10  # places in a sample that it is looked at
NEAR = 3  # samples to either side of a crossing, for a parabola that the encoder's counts leave steady
TAIL_S = 0.3  # at the end of a record, where the rotor stands again


@dataclass(frozen=True)
class Move:
    """One step. `t` (n,); `angle` (n,) rad; `orbit` and `motor` (2, n) m: x and y off the sensors' zero, at the outboard
    sensor and at the motor; `segments` (4, n) A; `saturated` (n,) where an amplifier cut its demand; `rest_orbit` and
    `rest_motor` (2, m) m, `rest_segments` (4, m) A of the standstill before. `step` rad is signed; `components` of a segment's
    current: its amplitude, or q and d in turn; `rest_angle` (m,) rad, as `angle`; `means`: whether samples are means over their
    period, or readings."""

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
    means: bool = True

    @property
    def torque(self) -> tuple[Array, Array]:
        """Currents (k, n) and (k, m) A along the field, whose mean is the torque current; after the step and before it."""
        return self.segments[:: self.components], self.rest_segments[:: self.components]


@dataclass(frozen=True)
class Excursion:
    """How far a step takes the shaft: `peak` radius m off centre with its direction `towards` (2,); how far a curve of more
    samples says `otherwise`, m; the `rest` it left, m (2,); and `floor`, m, what noise may add to the peak."""

    peak: float
    towards: Array
    otherwise: float
    rest: Array
    floor: float

    @property
    def away(self) -> float:
        """The distance of the rest off centre, m."""
        return float(np.hypot(*self.rest))


@dataclass(frozen=True)
class Response:
    """What one step shows: `rise` (10 to 90 %), `settling` s; `overshoot` as a share of the step; `final_error` rad;
    `outboard` and `motor`, how far off centre it goes there; `saturated` s, samples in which an amplifier cut; `hold` A, torque
    current at the end and before; `slopes` rad/s of the angle at 10 and 90 %."""

    rise: float
    settling: float
    overshoot: float
    final_error: float
    outboard: Excursion
    motor: Excursion
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
    high, low = _crossing(m.t, y, 0.9 * size), _crossing(m.t, y, 0.1 * size)
    outside = np.flatnonzero(np.abs(y - size) > band)
    settled = 0.0 if not len(outside) else float(m.t[min(outside[-1] + 1, len(m.t) - 1)])
    if len(outside) and outside[-1] >= len(y) - 2:
        settled = math.inf
    tail = m.t > m.t[-1] - TAIL_S
    return Response(
        rise=high[0] - low[0],
        settling=settled,
        overshoot=max(float(y.max()) / size - 1, 0.0),
        final_error=sign * float((m.angle[tail] - m.step).mean()),
        outboard=excursion(m.orbit, m.rest_orbit, m.means),
        motor=excursion(m.motor, m.rest_motor, m.means),
        saturated=float(m.saturated.sum()) * period,
        hold=(float(m.torque[0][:, tail].mean()), float(m.torque[1].mean())),
        slopes=(low[1], high[1]),
    )


def _crossing(t: Array, y: Array, level: float) -> tuple[float, float]:
    """When y first passes a level, and how fast it then goes, from a parabola through the samples about it: encoder counts make
    stairs of it, so that the two neighbours would not do, and a line through some that turn upwards passes above the one in the
    middle (a rise of 20 ms came out 0.1 ms too long)."""
    above = np.flatnonzero(y >= level)
    if not len(above):
        raise AnalysisError(
            f"the angle reaches {np.degrees(y.max()):.2f} deg; expected at least {np.degrees(level):.2f} deg"
        )
    if above[0] == 0:
        raise AnalysisError(
            f"the rotor stands {np.degrees(y[0]):.2f} deg on before its step begins, beyond {np.degrees(level):.2f} deg of it: "
            "give steps of more encoder counts"
        )
    k = int(above[0])
    near = slice(max(k - NEAR, 0), k + NEAR + 1)
    bend, slope, offset = np.polyfit(t[near] - t[k], y[near] - level, 2)
    root = slope**2 - 4 * bend * offset
    if slope > 0 and root >= 0:
        late = -2 * offset / (slope + math.sqrt(root))  # the root that is near, also of a line
        if abs(late) <= t[k] - t[k - 1]:
            return float(t[k] + late), max(float(slope + 2 * bend * late), 1e-6)
    part = (level - y[k - 1]) / (y[k] - y[k - 1])
    return float(t[k - 1] + part * (t[k] - t[k - 1])), max(float(y[k] - y[k - 1]) / float(t[k] - t[k - 1]), 1e-6)


def curve(path: Array, reach: int, degree: int, means: bool = True) -> Array:
    """(2, WITHIN n): the places that a path (2, n) has within each sample, by the polynomial whose `means` over samples, or
    else readings in their middle, are those of the sample and of `reach` more to either side (least squares). A curve through
    means themselves would be lower than a peak by a twenty-fourth of its bend, and the highest of its samples by as much
    again."""
    at, powers = np.arange(-reach, reach + 1)[:, None], np.arange(degree + 1)[None]
    shapes = ((at + 0.5) ** (powers + 1) - (at - 0.5) ** (powers + 1)) / (powers + 1) if means else 1.0 * at**powers
    places = ((np.arange(WITHIN)[:, None] + 0.5) / WITHIN - 0.5) ** powers
    kernel = places @ np.linalg.pinv(shapes)
    padded = np.pad(path, ((0, 0), (reach, reach)), mode="edge")
    out: Array = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1, axis=1) @ kernel.T
    return out.reshape(2, -1)


def excursion(orbit: Array, rest: Array, means: bool = True) -> Excursion:
    """Of a path (2, n) m and the standstill before, (2, m) m, `means` of their samples or readings."""
    radius, towards = peak_radius(orbit, means)
    other = float(np.hypot(*curve(orbit, *LONG, means)).max())
    return Excursion(radius, towards, abs(other - radius), rest.mean(axis=1), noise_floor(rest, means))


def peak_radius(orbit: Array, means: bool = True) -> tuple[float, Array]:
    """Greatest distance off centre, m, and its direction (2,). The largest of many noisy samples is biased high; the
    parabola takes most of that away, `noise_floor` bounds the rest."""
    s = curve(orbit, *SHORT, means)
    radius = np.hypot(*s)
    k = int(np.argmax(radius))
    return float(radius[k]), s[:, k] / max(float(radius[k]), 1e-300)


def noise_floor(rest: Array, means: bool = True) -> float:
    """What the largest of the samples of a standstill is expected to exceed their middle by, from noise alone: the
    standard deviation of the curve through them times sqrt(2 ln n) (extremes of a normal sample)."""
    s = curve(rest, *SHORT, means)
    sigma = float(np.sqrt((s.std(axis=1) ** 2).mean()))
    return sigma * math.sqrt(2 * math.log(max(rest.shape[1], 2)))


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
