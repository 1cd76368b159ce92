"""What the shaft's own motion is in the current that answers a step, so that what is left tells when the step began.

A law that goes by the distance from its set point and by the rate of the shaft makes i = J (u(t) - y(t)) - d y'(t), y as a
share of the step; and y is read as well. A square of time in the place of y and y' holds until the shaft turns the current
round. That goes with the period of the telemetry over the rise, and with the damping: in the four periods of 0.5 ms that are
looked at, 1.35 rises of a rotor of 60 g, its start was told 0.09 ms early.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from procedures.amb_rotor.machine import AmbRotor
from procedures.amb_rotor.onset import ONSET, Shaft
from procedures.step import response

Array = npt.NDArray[np.float64]
# Of a controller's ticks, by which a current begins to follow a reading: computed until the next one, and held for one. A rate
# is older: a difference of two readings is that of their middle, and what keeps its noise down takes about a tick more. Without
# noise the start is then 20 us late at most where a tick is a fifth of the telemetry's period or less (40 without that tick).
HELD_TICKS, RATE_TICKS = 1.5, 1.5
OLD_TICKS = (0.0, 3.0)  # a rate that is told at once, and one of a filter of two ticks: what a controller may do
# Of how far the shaft goes: noise of the steps' mean, beyond which its rate is told worse than a square of time stands for it.
# A loop of 24 Hz goes a fifth of its step, of which a step's noise was 7 %, and its start was told 0.3 ms early; a spindle's is
# 0.4 %.
NOISY, LAST = 0.015, 3  # samples that tell how far


def by_distance(machine: AmbRotor) -> bool:
    """Whether the controller's law goes by the distance from the set point. One that makes forces of a model takes away the
    magnets' negative stiffness too, and its currents go by other shares of position and set point."""
    return not machine.can.flatness


class Push(NamedTuple):
    """What of a step shows when its set point acted, on the time `t` (n,) s of its samples, between `earliest` and `latest`:
    the `control` current (n,) A, each the mean of `ticks` readings `tick` s apart, which amplifiers lag by `lag_s`; the
    position `y` (n,) as a share of the step, None where single readings were captured, of which `window_s` is looked at."""

    t: Array
    control: Array
    y: Array | None
    earliest: float
    latest: float
    tick: float
    ticks: int
    lag_s: float
    window_s: float | None = None


class Motion(NamedTuple):
    """Of a shaft as shares of its step `y` (n,), `since` (n,) s its start; the `noise` of one of these."""

    since: Array
    y: Array
    noise: float


def motion(pushes: Sequence[Push], begans: Array, sizes: Sequence[float]) -> Motion:
    """As steps of one axis show it together, of which each began at `begans` (n,) s on its own time and went `sizes` (n,) m
    far: their mean by the square of the size, since their noise is the same."""
    tick, period = pushes[0].tick, pushes[0].tick * pushes[0].ticks
    since = np.arange(-ONSET, 2 * ONSET, 1 / response.FINE) * period
    weights = np.square(sizes) / np.square(sizes).sum()
    mean, noise = np.zeros(len(since)), 0.0
    for p, began, weight in zip(pushes, begans, weights, strict=True):
        assert p.y is not None
        near = (p.t > began - 2 * ONSET * period) & (p.t < began + 3 * ONSET * period)
        # a reading stands for half a tick either way, and the last is one tick old
        fine, curve = response.curve(p.t[near] - tick / 2, p.y[near])
        mean += weight * np.interp(began + since, fine, curve)
        noise += weight**2 * float(p.y[p.t <= p.earliest].var())
    return Motion(since, mean, math.sqrt(noise))


def is_told(of: Motion, period_s: float) -> bool:
    """Whether it shows how the shaft moves while the start is looked for: not one that hardly does, beside noise."""
    gone = of.y[of.since < ONSET * period_s][-LAST * response.FINE :].mean()
    return bool(of.noise < NOISY * gone)


def shafts(of: Motion, pushes: Sequence[Push], begans: Array, rate_ticks: float = RATE_TICKS) -> list[Shaft]:
    """The motion of each step, that began at `begans` (n,) s on its own time, as the amplifiers answer it; its rate so much
    older than its position."""
    first, apart = pushes[0], float(of.since[1] - of.since[0])
    ages = [(HELD_TICKS + old) * first.tick for old in (0.0, rate_ticks)]
    # before the start it rests: what is read then is noise, which would make the motion less than it is, and the start early
    moves = [np.where(of.since < 0, 0.0, x) for x in (of.y, np.gradient(of.y, of.since))]
    both = [_lagged(x, first.lag_s, apart) for x in moves]

    def shaft(began: float) -> Shaft:
        return lambda reads: np.column_stack(
            [np.interp(reads - began - age, of.since, x).mean(axis=1) for age, x in zip(ages, both, strict=True)]
        )

    return [shaft(began) for began in begans]


def _lagged(x: Array, lag_s: float, apart: float) -> Array:
    """`x` (n,), `apart` s from each other with straight lines between, as an amplifier of the first order follows it."""
    from scipy import signal

    keep = np.exp(-apart / lag_s)
    share = (1 - keep) * lag_s / apart
    followed, _ = signal.lfilter([1 - share, share - keep], [1.0, -keep], x, zi=[share * x[0]])
    return np.asarray(followed)
