"""Does something swing that no step made? A line in what the probes read while the shaft rests before each step.

Mains hum in probes or cables has one phase at all steps where they follow each other in whole periods of it: it then adds to
every response alike, and no scatter tells it. At rest it stands as a line above what lies beside it in the mean spectrum of all
rests of a group. Noise shakes the loop as well, and makes a hill where its swing is, the narrower the less that is damped: what
a line must stand above is taken relative to that hill, by the poles that the steps show.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding
from bench.uncertainty import interval
from procedures.step.checks import touched
from procedures.step.estimates import Result
from procedures.step.steps import ORDERS, Case, Done, by_group

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
NO_POLES: Complex = np.zeros(0, np.complex128)
LOWEST_HZ, FEWEST = 10.0, 100  # below it a rest has too few periods; samples of a rest
SIDES = 4, 8  # bins beside a line that tell what lies under it; a window of Hann has two
WIDE = 3.0  # bins about an order that are its own: a window of Hann has two, and a line is not at a bin
CLEAR = 6.0  # times that, in power: the mean of 16 rests is there once in 1e12, a swing of damping 0.2 has 2
NEAR = 0.2  # of a pole's size: how far apart two responses put the same one
MATTERS = 0.5  # of an overshoot's U: less moves nothing that is told


def find_hum(steps: Sequence[Done], results: Mapping[Case, Result]) -> Iterator[Finding]:
    """A finding for each group of steps whose overshoot a line at rest moves by more than MATTERS of its U."""
    groups = by_group(list(steps))
    own = {g: shared_poles([r for c, r in results.items() if c.group == g]) for g in groups}
    for group, of in groups.items():
        doubts = [interval(r.estimates["overshoot"]).U * c.size for c, r in results.items()
                  if c.group == group and "overshoot" in r.estimates]  # fmt: skip
        turned = [n * float(np.mean([d.speeds for d in of])) / (2 * np.pi) for n in ORDERS]
        rests, period = [d.rest for d in of], float(np.median(np.diff(of[0].t)))
        hz, amplitude = surest(rests, period, (own[group], np.concatenate([*own.values()])), turned)
        if doubts and amplitude > MATTERS * min(doubts):
            text = (f"while the shaft rests before the steps its position swings by {amplitude * 1e6:.2g} µm at {hz:.3g} Hz: "
                    "mains hum in probes or cables, or something that shakes the stand; and so do the responses.")  # fmt: skip
            yield Finding("hum", text, group, Effect.INDETERMINATE, touched(of, steps))


def shared_poles(results: Sequence[Result]) -> Complex:
    """Decaying poles, rad/s, that half of the responses of a group show, within NEAR of their size. What fewer show was fitted
    to their noise: a hill about it hides what lies beside a line, and the loop's own swing was taken for hum."""
    swings = [r.swing.poles[r.swing.poles.real < 0] for r in results if r.swing is not None]
    found = np.concatenate([NO_POLES, *swings])
    if not len(found):
        return found
    near = np.stack([(np.abs(found[:, None] - s) < NEAR * np.abs(found[:, None])).any(axis=1) for s in swings])
    return np.asarray(found[2 * near.sum(axis=0) >= len(swings)])


def surest(
    rests: Sequence[Array], period: float, hills: Sequence[Complex], orders: Sequence[float] = ()
) -> tuple[float, float]:
    """`line` where it is one above each of `hills`, sets of poles: where a loop swings at one frequency along y and at another
    along z, the flank of one was taken for a line beside the hill of the other."""
    told = {line(rests, period, poles, orders) for poles in hills}
    return next(iter(told)) if len(told) == 1 else (0.0, 0.0)


def line(
    rests: Sequence[Array], period: float, poles: Complex = NO_POLES, orders: Sequence[float] = ()
) -> tuple[float, float]:
    """Frequency, Hz, and amplitude, m, of the plainest line in the mean spectrum of rests with samples every `period` s; zeros
    where there is none. `poles` are the loop's, rad/s; `orders` of the shaft, Hz, are no lines of it."""
    many = min(map(len, rests))
    if many < FEWEST:
        return 0.0, 0.0
    window, t = np.hanning(many), np.linspace(-1, 1, many)
    still = [x[-many:] - np.polyval(np.polyfit(t, x[-many:], 1), t) for x in rests]
    power = np.mean([np.abs(np.fft.rfft(x * window)) ** 2 for x in still], axis=0)
    first, beside = max(round(LOWEST_HZ * many * period), SIDES[1] + 1), np.arange(SIDES[0], SIDES[1] + 1)
    at = np.arange(first, len(power) - SIDES[1])
    at = at[[all(abs(k - hz * many * period) > WIDE for hz in orders) for k in at]]
    if not len(at):
        return 0.0, 0.0
    hill = _hill(np.arange(len(power)) / (many * period), poles)
    level = power / hill
    floor = hill[at] * np.maximum(level[at[:, None] - beside].mean(axis=1), level[at[:, None] + beside].mean(axis=1))
    k = int(np.argmax(power[at] / floor))
    if power[at[k]] < CLEAR * floor[k]:
        return 0.0, 0.0
    return float(at[k] / (many * period)), float(2 * np.sqrt(power[at[k]]) / window.sum())


def _hill(hz: Array, poles: Complex) -> Array:
    """Power at frequencies of white noise, half of it through the loop: 1 + |T|^2 with T = (w^2 - 2 Re p jw') / (s - p)(s - p*)
    of the pole p, w = |p|, s = jw'; of several poles the greatest."""
    s = 2j * np.pi * hz[:, None]
    swung = poles[(poles.imag > 0) & (poles.real < 0)]
    if not len(swung):
        return np.ones(len(hz))
    through = (np.abs(swung) ** 2 - 2 * swung.real * s) / ((s - swung) * (s - swung.conj()))
    return np.asarray(1 + (np.abs(through) ** 2).max(axis=1))
