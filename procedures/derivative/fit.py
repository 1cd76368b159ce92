"""The bare model: what an estimator that is reset every P samples makes of a sine, by the samples' place in that period.

The estimate is linear in the positions, and its weights repeat every P samples. So the samples at one place j of the period see
one time-invariant filter, and over y = Re Y exp(j w t) they are Re H_j j w Y exp(j w t). Their mean over j is the gain at the
line, what differs from it the sidebands at f +- n/eps, and

    error^2 = mean_j |H_j - 1|^2 = |mean_j H_j - 1|^2 + mean_j |H_j - mean H|^2.

Noise adds to a square. Two stretches of a record have noise of their own: the product of the one's H_j - 1 with the conjugate
of the other's has the same mean, without it.

That noise is at the ends above all: an estimate looks back over its window, so that a stretch that is cut off sharply takes
part of its answer from the one before. What one stretch lacks there the next one has too much, their mean hardly knows it, and
their scatter would be some three times too great. Each is weighed by a Hann window, which has no ends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
MOVING_HZ = 1500.0  # above it the body does not follow its own noise
SOUGHT = (0.5, 1.5)  # times what the controller takes the exciter's frequency for: between them it is looked for
SEEN = 1000.0  # times the scatter of its square by white noise: a sine, and none of the body's own ringing


@dataclass(frozen=True)
class Places:
    """H_j of a line, (b, P) by stretch of the record and place in the period; `amplitude` m of the position, 0-pk."""

    h: Complex
    amplitude: float

    @property
    def gain(self) -> Complex:
        """Mean over the period, (b,)."""
        return np.asarray(self.h.mean(axis=1))

    def square(self, use: npt.NDArray[np.bool_], about: Complex | float = 1.0) -> float:
        """mean_j |H_j - about|^2 without what noise adds, of the stretches `use` (b,)."""
        off = (self.h - about)[use]
        count = len(off)
        whole, own = np.abs(off.sum(axis=0)) ** 2, (np.abs(off) ** 2).sum(axis=0)
        return float((whole - own).mean() / (count * (count - 1)))

    @property
    def error(self) -> tuple[float, float]:
        """RMS error over the derivative's rms, and its standard uncertainty by the jackknife over stretches."""
        return self._rooted(1.0)

    @property
    def sideband(self) -> tuple[float, float]:
        """Of that what is at f +- n/eps."""
        return self._rooted(self.gain[:, None])

    def _rooted(self, about: Complex | float) -> tuple[float, float]:
        count = len(self.h)
        value = self.square(np.ones(count, bool), about)
        less = [self.square(np.arange(count) != k, about) for k in range(count)]
        u = float(np.sqrt((count - 1) * np.var(less)))
        root = float(np.sqrt(max(value, u)))  # of a square that is lost in its noise
        return float(np.sqrt(max(value, 0.0))), u / (2 * root) if root > 0 else 0.0


def places(y: Array, v: Array, hz: float, beside: float, spacing: int, tick_s: float, blocks: int) -> Places:
    """H_j of position (n,) m and velocity (n,) m/s under a sine at `hz`, with whatever goes with `beside` Hz taken out.

    Raises:
        AnalysisError: a stretch has too few periods of the resets for the sine.
    """
    length = len(y) // blocks // spacing * spacing
    if length < 8 * spacing:
        raise AnalysisError(f"{hz:g} Hz: found {len(y)} samples; expected {8 * blocks * spacing} or more")
    found, sizes, weight = [], [], np.sqrt(endless(length))
    for b in range(blocks):
        at = slice(b * length, (b + 1) * length)
        t = (np.arange(length) + b * length) * tick_s
        design = terms(t, hz, beside) * weight[:, None]
        position = np.linalg.lstsq(design, weight * y[at], rcond=None)[0]
        phasor = position[1] - 1j * position[2]
        rows = (weight * v[at]).reshape(-1, spacing)
        each = [np.linalg.lstsq(design[j::spacing], rows[:, j], rcond=None)[0] for j in range(spacing)]
        out = np.array([c[1] - 1j * c[2] for c in each])
        found.append(out / (2j * np.pi * hz * phasor))
        sizes.append(abs(phasor))
    return Places(np.array(found), float(np.mean(sizes)))


def detuned(y: Array, hz: float, beside: float, tick_s: float) -> float:
    """By how much of itself the frequency of a line in a position (n,) m is off `hz`, by the phases of both halves."""
    half = len(y) // 2
    t = np.arange(2 * half) * tick_s
    phasors = []
    for part in (slice(0, half), slice(half, 2 * half)):
        found = np.linalg.lstsq(terms(t[part], hz, beside), y[part], rcond=None)[0]
        phasors.append(found[1] - 1j * found[2])
    return float(np.angle(phasors[1] / phasors[0]) / (2 * np.pi * hz * half * tick_s))


def exciter_hz(y: Array, near: float, tick_s: float) -> float:
    """Hz of the sine that explains most of a quiet position (n,) m, sought about `near` Hz; `near` where none is seen.

    The greatest of the spectrum under a window without ends, then least squares within a bin of it. The controller compensates
    at the frequency that it takes the exciter for: of one that turns 5 % faster, twelve times the noise is left in the
    position, and a sine of another frequency that is taken out of the record leaves it there.
    """
    from scipy.optimize import minimize_scalar  # here: what a procedure requires is known without it

    n = len(y)
    hz, power = np.fft.rfftfreq(n, tick_s), np.abs(np.fft.rfft((y - y.mean()) * endless(n)))
    among = np.flatnonzero((hz > SOUGHT[0] * near) & (hz < SOUGHT[1] * near))
    if not among.size:
        return near
    t = (np.arange(n) - n / 2) * tick_s

    def left(at: float) -> float:
        design = terms(t, at)
        return float(((y - design @ np.linalg.lstsq(design, y, rcond=None)[0]) ** 2).sum())

    top, bin_hz = float(hz[among[int(np.argmax(power[among]))]]), float(hz[1])
    found = float(minimize_scalar(left, bounds=(top - bin_hz, top + bin_hz), method="bounded").x)
    least, whole = left(found), float(((y - y.mean()) ** 2).sum())
    return found if (whole - least) * n > SEEN * least else near


def endless(n: int) -> Array:
    """Hann's window (n,), of mean 1."""
    return np.asarray(1 - np.cos(2 * np.pi * (np.arange(n) + 0.5) / n))


def terms(t: npt.NDArray[Any], *lines: float) -> Array:
    """A constant, and cosine and sine of each line, (n, 1 + 2 m)."""
    waves = [f(2 * np.pi * hz * t) for hz in lines for f in (np.cos, np.sin)]
    return np.column_stack([np.ones_like(t), *waves])


def noise(
    y: Array,
    v: Array,
    beside: float,
    spacing: int,
    tick_s: float,
    blocks: int,
    power: Callable[[npt.NDArray[Any]], Array],
) -> Array:
    """Noise of the velocity over that of the position (b,) 1/s, by stretch of a quiet record, as white noise would have it.

    `power` is the estimator's own mean square per position, 1/s^2 of Hz. The position's noise is what it has from MOVING_HZ on,
    where the body itself does not move, each frequency weighed by `power`: a sensor's noise is seldom as great at all of them,
    and taken as white from the upper half alone, noise through a low-pass of 3 kHz made this 17 % too great. Below MOVING_HZ
    the body does move, and what the estimator makes of what differs there from that noise is taken off. The velocity is
    without what goes with the place in the period and with `beside` Hz.
    """
    length, out = len(y) // blocks // spacing * spacing, []
    hz = np.fft.rfftfreq(length, tick_s)[1:]
    gained, slow = power(hz), hz < MOVING_HZ
    for b in range(blocks):
        at = slice(b * length, (b + 1) * length)
        design = terms((np.arange(length) + b * length) * tick_s, beside)
        position = y[at] - design @ np.linalg.lstsq(design, y[at], rcond=None)[0]
        spectrum = np.abs(np.fft.rfft(position)[1:]) ** 2 / length
        white = float(spectrum[~slow] @ gained[~slow]) / float(gained[~slow].sum())
        moved = float((spectrum[slow] - white) @ gained[slow]) * 2 / length
        out.append(np.sqrt(max(_by_places(v[at], design, spacing) - moved, 0.0) / white))
    return np.array(out)


def _by_places(v: Array, design: Array, spacing: int) -> float:
    """Mean square of a velocity (n,) m/s without what `design` (n, m) explains of it at each place in the period."""
    rows = v.reshape(-1, spacing)
    left = np.empty_like(rows)
    for j in range(spacing):
        own = design[j::spacing]
        left[:, j] = rows[:, j] - own @ np.linalg.lstsq(own, rows[:, j], rcond=None)[0]
    return float((left**2).mean() * len(rows) / (len(rows) - design.shape[1]))
