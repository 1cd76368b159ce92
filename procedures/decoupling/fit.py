"""The bare numbers of a held axis: what it moves by, what crosses over to it, what friction takes of it.

Of the held axis, q its place, F what its loop asks for, in newtons of the controller's own map, which are kappa true ones, and
c what the moved axis puts on it:

    J q'' = kappa F + c - b q' - friction + constant

While the other axis slides, friction of a bearing whose balls roll and slip along one path lies along that axis; what is left
of it across is like viscous drag, b = F_c/|v| (all rates along the surface), and c = J q'' - kappa F + b q' up to a constant.
That is a balance, not a model of the loop: it holds whatever gains the loop has, in the mean over a count's chatter.

b and what is left of Coulomb friction are told apart by two slow sines of the held axis' own set point, of so many and a half
periods to one of the motion: they change sign from period to period, and the cross force does not. The force in phase with the
rate is 4/pi F_c + b w a, of which the speed w a changes the second part alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
HALF = math.sqrt(2 * math.log(2))  # a Gauss function is a half there, standard deviations


@dataclass(frozen=True)
class Sine:
    """constant + amplitude sin(2 pi t/period + phase)."""

    amplitude: float
    phase: float
    constant: float
    period: float

    def angle(self, t: Array) -> Array:
        """Of the sine, rad."""
        out: Array = 2 * math.pi * t / self.period + self.phase
        return out


def sine(t: Array, x: Array, period: float) -> Sine:
    """Of readings (n,) at times s."""
    a = 2 * math.pi * t / period
    terms = np.linalg.lstsq(np.column_stack([np.sin(a), np.cos(a), np.ones_like(a)]), x, rcond=None)[0]
    return Sine(float(math.hypot(terms[0], terms[1])), float(math.atan2(terms[1], terms[0])), float(terms[2]), period)


def periods(t: Array, x: Array, period: float, count: int, samples: int) -> Array:
    """Whole periods (count, samples) of readings (n,), from the first one on, by straight lines where samples are missing."""
    grid = t[0] + np.arange(count * samples) * (period / samples)
    out: Array = np.interp(grid, t, x).reshape(count, samples)
    return out


def smoothed(x: Array, period: float, hz: float, order: int = 0) -> Array:
    """Periods (count, samples) through a Gauss filter that lets half through at `hz`, without their mean over all; or their
    derivative of that order to time."""
    whole = x.reshape(-1)
    f = np.arange(whole.size // 2 + 1) / (period * len(x))
    gain = np.exp(-0.5 * (HALF * f / hz) ** 2) * (2j * math.pi * f) ** order
    gain[0] = 0.0
    out: Array = np.fft.irfft(np.fft.rfft(whole) * gain, whole.size).reshape(x.shape)
    return out


def sliding(moved: Sine, t: Array, share: float) -> Bools:
    """Where a set point goes faster than a share of its greatest speed."""
    out: Bools = np.abs(np.cos(moved.angle(t))) >= share
    return out


@dataclass(frozen=True)
class Cross:
    """Cross force of a held axis over periods of the moved one: `wave` (n,) in their mean, without its mean over where `on`;
    its effective value and its peak there, the slope over what the moved axis' loop asks for, and each of them by period
    (p,); effective value without the drag's part, `plain`, and of that part, `dragged`; of what the moved axis' loop asks
    for, `other`; how often the held axis' reading `changes` there in a period; how fast the cross force changes over its size,
    `pace` rad/s."""

    wave: Array
    on: Bools
    rms: float
    peak: float
    slope: float
    by_period: tuple[Array, Array, Array]
    plain: float
    dragged: float
    other: float
    changes: float
    pace: float


def cross(
    force: Array, other: Array, place: Array, period: float, on: Bools, hz: float, inertia: float, drag: float
) -> Cross:
    """Of periods (p, n): what the held axis' loop asks for, what the moved one's does, the held axis' reading.

    The effective value is less what the scatter of the periods adds to it. A period's share in it is its projection on the
    mean: sum c_j c/(n rms).
    """
    without = inertia * smoothed(place, period, hz, 2) - smoothed(force, period, hz)
    all_periods = without + drag * smoothed(place, period, hz, 1)
    by = _centred(smoothed(other, period, hz), on).mean(axis=0)
    wave = all_periods.mean(axis=0)
    rate = np.gradient(wave, period / wave.size)[on]
    told = _told(_centred(all_periods, on), by)
    part = _centred(all_periods - without, on).mean(axis=0)
    return Cross(
        wave=wave - float(wave[on].mean()),
        on=on,
        rms=_effective(_centred(all_periods, on)),
        peak=float(told[1].mean()),
        slope=float(told[2].mean()),
        by_period=told,
        plain=_effective(_centred(without, on)),
        dragged=math.sqrt(float((part**2).mean())),
        other=math.sqrt(float((by**2).mean())),
        changes=float((np.diff(place, axis=1)[:, on[1:]] != 0).sum()) / len(place),
        pace=float(rate.std() / max(wave[on].std(), 1e-300)),
    )


def _effective(every: Array) -> float:
    mean = every.mean(axis=0)
    noise = float((every.var(axis=0, ddof=1) / len(every)).mean())
    return math.sqrt(max(float((mean**2).mean()) - noise, 0.0))


def _told(every: Array, by: Array) -> tuple[Array, Array, Array]:
    """Of periods (p, m), each (p,): share in the effective value, value where the mean has its peak, slope over `by`."""
    mean, power = every.mean(axis=0), float(by @ by)
    k = int(np.argmax(np.abs(mean)))
    shares = (every @ mean) / max(len(mean) * math.sqrt(float((mean**2).mean())), 1e-300)
    slopes = (every @ by) / power if power > 0 else np.zeros(len(every))
    return shares, math.copysign(1.0, mean[k]) * every[:, k], slopes


def _centred(x: Array, on: Bools) -> Array:
    """Periods (p, m) of those places alone, all without the mean of their mean."""
    some = x[:, on]
    out: Array = some - some.mean()
    return out


@dataclass(frozen=True)
class Nudge:
    """How a held axis follows a small slow sine of its own set point: share of its size, and the force in phase with its rate
    (all of it where the axis does not move); its greatest `speed`."""

    follow: float
    drag: float
    speed: float


def nudge(force: Array, place: Array, sent: Sine, t: Array, on: Bools) -> Nudge:
    """Of an even number of periods (p, n) of the moved axis, over each of which the held axis' sine changes its sign; `t` (n,)
    of the first one, over places where the other axis slides."""
    signs = (-1.0) ** np.arange(len(force))[:, None]
    a = sent.angle(t)[on]
    basis = np.column_stack([np.sin(a), np.cos(a)])
    (fs, fc), (xs, xc) = (np.linalg.lstsq(basis, (x * signs).mean(axis=0)[on], rcond=None)[0] for x in (force, place))
    went, asked = complex(xs, xc), complex(fs, fc)  # z = s + j c of s sin + c cos = Im(z exp(j a))
    size = abs(went)
    speed = 2 * math.pi / sent.period * sent.amplitude
    if size < 1e-3 * sent.amplitude:
        return Nudge(0.0, abs(asked), speed)
    return Nudge(size / sent.amplitude, (asked * went.conjugate()).imag / size, speed)


def dragging(slow: Nudge, fast: Nudge) -> float:
    """b, by what more speed adds to the force."""
    return max((fast.drag - slow.drag) / (fast.speed - slow.speed), 0.0)
