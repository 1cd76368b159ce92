"""When a set point jumped, by the coil currents that answer it: finer than the telemetry's period.

A jump at t_0 is in the references two ticks later, and in the currents as the amplifiers follow: J u(t), u = 1 - e^(-s/lag).
From then on the rotor follows, its position with the cube of time at first, and the law answers that: with the square of time
by what it makes of the rate, with the cube by what it makes of the position, each through delay and amplifiers once more. In a
stiff loop none of these powers describes more than a millisecond. But the position is known. What the law makes of it is

    i = i_0 + J u(t) + a (g * y)(t) + b (g * y')(t),                                                       (1)

g the same two ticks and the amplifiers, over as long a time as one likes. A rate that is later than is taken here by d adds
b d y'', which is as i is and changes J; t_0 by b d/J times the step's acceleration and a lag, some microseconds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from procedures.amb_rotor.machine import AmbRotor

Array = npt.NDArray[np.float64]
READS, LEAST_S, BEFORE_S = (
    8,
    4e-3,
    0.03,
)  # of the window: periods of the position's samples, s at least; s of rest before it
COARSE_S, FINE_S = 1e-4, 2e-5  # of the search; within the latter a parabola
DELAY_TICKS = 2  # from the jump to the amplifiers: computed a tick late, applied one later
RATE_TICKS = 1.2  # by which low-pass and notch filters make a law's rates late: none to twice that moves t_0 by 10 us
LATE_S = 1.2e-5  # what the square of time makes the start late by, -20 to 30 us about this mean
CONTIGUOUS = 0.75  # of a period, averaged over which samples are means over all of it


@dataclass(frozen=True)
class Course:
    """Where the shaft is along the axis: `x` m at `t` s (n,), means over the `averaged_s` before that."""

    t: Array
    x: Array
    averaged_s: float

    @property
    def period(self) -> float:
        """Of its samples, s."""
        return float(np.median(np.diff(self.t)))

    def readings(self, at: Array, tick: float, since: float) -> tuple[Array, Array]:
        """Position and its rate as they are read at the ticks `at` (m,): by a spline through the running sum, or through the
        samples where those are means over less than a period. Nothing before `since`: noise is no answer to a step."""
        from scipy.interpolate import CubicSpline

        x, middle = self.x - self.x[self.t < since].mean() if np.any(self.t < since) else self.x, at + tick / 2
        if self.averaged_s < CONTIGUOUS * self.period:
            place = CubicSpline(self.t - self.averaged_s / 2, x)
        else:
            ends = np.concatenate([[self.t[0] - self.period], self.t])
            place = CubicSpline(ends, np.concatenate([[0.0], np.cumsum(x * np.diff(ends))])).derivative()
        rate = place.derivative()
        moves, middle = at >= since, np.minimum(middle, self.t[-1])
        return np.where(moves, place(middle), 0.0), np.where(moves, rate(middle - tick / 2), 0.0)


def pushing(machine: AmbRotor, direction: str, axis: str, by_channel: Mapping[str, Array]) -> Array:
    """The difference (n,) A of an axis' two currents, as it pushes the shaft along y, z or x."""
    p, n = machine.pair(axis)
    return (by_channel[p] - by_channel[n]) * math.copysign(1.0, machine.stations.share(direction, axis))


def onset(
    t: Array,
    current: Array,
    course: Course | None,
    earliest: float,
    latest: float,
    *,
    tick: float,
    ticks: int,
    lag_s: float,
    window_s: float = 0.0,
    answers: int = 1,
) -> tuple[float, float]:
    """When the set point jumped, s on the time of the samples `t` (n,), and the jump of `current` (n,) A over its noise: the
    start with the least misfit of equation 1, each term averaged over the `ticks` readings of a sample of the current.

    Over `window_s` from the start on; READS periods of the course where that is 0. Without a course, as of `answers` to many
    set points that lie close together, the square of time stands for what the law makes of the position, and besides it time
    itself, for a rate that a fast loop turns round within the window. Many laid over each other tell more: the noise is that of
    the jump which they make together, as if all that is left of one answer were alike.
    """
    window = window_s if window_s or course is None else max(READS * course.period, LEAST_S)
    near = (t > earliest - BEFORE_S) & (t < latest + COARSE_S + window)
    t, current = t[near], current[near]
    reads = t[:, None] - tick * np.arange(1, ticks + 1)
    follows = None if course is None else followed(t, course, earliest, tick=tick, ticks=ticks, lag_s=lag_s)
    many = answers > 1

    def fitted(t_0: float, end: float) -> tuple[float, float, float, float]:
        use = t < end
        since = np.maximum(reads[use] - t_0 - DELAY_TICKS * tick, 0.0)
        answer = (1 - np.exp(-since / lag_s)).mean(axis=1)
        powers = np.column_stack([(since**k).mean(axis=1) / window**k for k in ((1, 2) if many else (2,))])
        design = np.column_stack([np.ones(use.sum()), answer, powers if follows is None else follows[use]])
        terms, *_ = np.linalg.lstsq(design, current[use], rcond=None)
        share = math.sqrt(np.linalg.pinv(design.T @ design)[1, 1] * use.sum() / answers) if many else 1.0
        return float(((current[use] - design @ terms) ** 2).mean()), t_0, float(terms[1]), share

    _, about, *_ = min(fitted(t_0, t_0 + window) for t_0 in np.arange(earliest - tick, latest + COARSE_S, COARSE_S))
    end = about + window
    _, found, jump, share = min(
        fitted(t_0, end) for t_0 in np.arange(about - COARSE_S, about + COARSE_S + FINE_S, FINE_S)
    )
    before, at, after = (fitted(found + by, end)[0] for by in (-FINE_S, 0.0, FINE_S))
    if (bent := before - 2 * at + after) > 0:
        found += FINE_S * min(max((before - after) / bent / 2, -1.0), 1.0)
    rest = t < earliest
    noise = max(float(current[rest].std()) * share, 1e-12)
    found -= LATE_S if course is None and not many else 0.0
    return float(found), abs(jump) / noise if rest.sum() > 5 else 0.0


def followed(t: Array, course: Course, since: float, *, tick: float, ticks: int, lag_s: float) -> Array:
    """What references make currents of that are the position, and its rate (n, 2), each of about 1 at most, averaged over the
    `ticks` readings of samples at `t` (n,) s; from `since` s on."""
    from scipy.signal import lfilter

    first = np.rint((t - t[0]) / tick).astype(int)
    at = t[0] + tick * np.arange(-ticks, first[-1])
    place, rate = course.readings(at, tick, since)
    slow, lags = RATE_TICKS / (RATE_TICKS + 1), math.exp(-tick / lag_s)
    out = []
    for reference in (place, lfilter([1 - slow], [1, -slow], rate)):
        held = np.concatenate([np.zeros(DELAY_TICKS + 1), reference])[: len(at)]
        sums = np.concatenate([[0.0], np.cumsum(lfilter([1 - lags], [1, -lags], held))])
        means = (sums[first + ticks] - sums[first]) / ticks
        out.append(means / max(float(np.abs(means).max()), 1e-30))
    return np.array(out).T
