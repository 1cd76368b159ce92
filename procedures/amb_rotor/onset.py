"""When a set point jumped, by the coil currents that answer: finer than the telemetry's period."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

from procedures.amb_rotor.machine import AmbRotor

Array = npt.NDArray[np.float64]
Shaft = Callable[[Array], Array]
"""What the shaft's motion is in the current, at times of readings (n, ticks): position and rate as the amplifiers answer them,
the mean of each sample (n, 2); the position as a share of the way that the set point jumps."""
ONSET, BEFORE_S = 4, 0.03  # periods of the telemetry; s
COARSE_S, FINE_S = 1e-4, 1e-5  # of the search
LATE_S = 1.2e-5  # what a square of time leaves of the rotor's answer makes the start late, -20 to 30 us about this mean
BESIDE_S, FREE = 3e-5, 4  # of a start, where the misfit is looked at; what is fitted: the start and three terms
DELAY_TICKS = 2  # from the jump to the amplifiers: computed a tick late, applied one later


def pushing(machine: AmbRotor, direction: str, axis: str, by_channel: Mapping[str, Array]) -> Array:
    """The difference (n,) A of an axis' two currents, as it pushes the shaft along y, z or x."""
    p, n = machine.pair(axis)
    return (by_channel[p] - by_channel[n]) * math.copysign(1.0, machine.stations.share(direction, axis))


def _window(tick: float, ticks: int, period_s: float) -> float:
    return ONSET * max(ticks * tick, period_s)


def _answers(later: Array, lag_s: float, window: float, powers: tuple[int, ...]) -> Array:
    """What a current is made of, (n, 2 + powers), at times `later` (n, ticks) than the amplifiers were told: each averaged."""
    since = np.maximum(later, 0.0)
    answer = (1 - np.exp(-since / lag_s)).mean(axis=1)
    return np.column_stack([np.ones(len(since)), answer, *((since**k).mean(axis=1) / window**k for k in powers)])


def _held(design: Array, moved: Array) -> Array:
    """The same (n, 3) of a shaft that moves (n, 2) as it is held: less its position, and with its rate."""
    rate = moved[:, 1] / (np.abs(moved[:, 1]).max() or 1.0)
    return np.column_stack([design[:, 0], design[:, 1] - moved[:, 0], rate])


def unlike(
    t: Array,
    current: Array,
    began: float,
    *,
    tick: float,
    ticks: int,
    lag_s: float,
    window_s: float | None = None,
    shaft: Shaft | None = None,
) -> float:
    """How unlike an answer is to that of a set point which jumped at `began` as `onset` found it, by the same curve: the rms of
    what it leaves over the window, without the noise of the readings before, over the jump."""
    window = _window(tick, ticks, 0.0) if window_s is None else window_s
    late = 0.0 if shaft else LATE_S
    near = (t > began - BEFORE_S) & (t < began + late + window)
    reads = t[near, None] - tick * np.arange(1, ticks + 1)
    later = reads - (began + late + DELAY_TICKS * tick)
    design = _answers(later, lag_s, window, () if shaft else (2,))
    design = _held(design, shaft(reads)) if shaft else design
    terms, *_ = np.linalg.lstsq(design, current[near], rcond=None)
    left, after = current[near] - design @ terms, (later > 0).any(axis=1)
    if after.sum() < 2 or (~after).sum() < 2 or terms[1] == 0:
        return 0.0
    more = float((left[after] ** 2).mean() - left[~after].var(ddof=1))
    return math.sqrt(max(more, 0.0)) / abs(float(terms[1]))


def noise_of(t: Array, current: Array, began: float, *, tick: float, ticks: int, lag_s: float, shaft: Shaft) -> float:
    """How well the noise of the readings lets `onset` tell that start, s, a standard uncertainty: by how much the misfit grows
    beside its least, where the motion of the shaft begins with the start."""
    window = _window(tick, ticks, 0.0)
    near = (t > began - BEFORE_S) & (t < began + window)
    reads, i = t[near, None] - tick * np.arange(1, ticks + 1), current[near]

    def left(t_0: float) -> float:
        design = _answers(reads - t_0 - DELAY_TICKS * tick, lag_s, window, ())
        design = _held(design, shaft(reads - (t_0 - began)))
        terms, *_ = np.linalg.lstsq(design, i, rcond=None)
        return float(((i - design @ terms) ** 2).sum())

    least = left(began)
    more = (left(began - BESIDE_S) + left(began + BESIDE_S)) / 2 - least
    return BESIDE_S * math.sqrt(least / (len(i) - FREE) / more) if more > 0 else window


def onset(
    t: Array,
    current: Array,
    earliest: float,
    latest: float,
    *,
    tick: float,
    ticks: int,
    lag_s: float,
    window_s: float | None = None,
    period_s: float = 0.0,
    answers: int = 1,
    shaft: Shaft | None = None,
) -> tuple[float, float]:
    """When the set point jumped, s on the time of the samples `t` (n,), and the jump of `current` (n,) over its noise.

    i = i_0 + J u(t) + c v(t), u the amplifiers' answer to a step and v the square of the time since, for the rotor that begins
    to follow; each averaged over the `ticks` readings of a sample. The start with the least misfit is taken, over `window_s`
    from it on (by default ONSET periods: `period_s`, or that of the readings where it is not told).

    Where the samples are those of many `answers` laid over each other they tell more: a term c' v' is fitted besides, v' the
    time since, for a rate that a fast loop turns round within the window; and the noise is that of the jump which they make
    together, as if all that is left of one answer were alike.

    Where the motion of the `shaft` is known it stands for itself: i = i_0 + J (u(t) - y(t)) + d y'(t), as a law makes it that
    goes by the distance from the set point and by the rate.
    """
    window = _window(tick, ticks, period_s) if window_s is None else window_s
    reads = t[:, None] - tick * np.arange(1, ticks + 1)
    near = (t > earliest - BEFORE_S) & (t < latest + window)
    many = answers > 1
    moved = shaft(reads[near]) if shaft else None

    def fitted(t_0: float) -> tuple[float, float, float, float]:
        use = near & (t < t_0 + window)
        powers = () if shaft else (1, 2) if many else (2,)
        design = _answers(reads[use] - t_0 - DELAY_TICKS * tick, lag_s, window, powers)
        design = design if moved is None else _held(design, moved[use[near]])
        terms, *_ = np.linalg.lstsq(design, current[use], rcond=None)
        share = math.sqrt(np.linalg.pinv(design.T @ design)[1, 1] * use.sum() / answers) if many else 1.0
        return float(((current[use] - design @ terms) ** 2).mean()), t_0, float(terms[1]), share

    _, about, *_ = min(fitted(t_0) for t_0 in np.arange(earliest - tick, latest + COARSE_S, COARSE_S))
    _, found, jump, share = min(fitted(t_0) for t_0 in np.arange(about - COARSE_S, about + COARSE_S, FINE_S))
    rest = t < earliest
    noise = max(float(current[rest].std()) * share, 1e-12)
    return float(found) - (0.0 if many or shaft else LATE_S), abs(jump) / noise if rest.sum() > 5 else 0.0
