"""Flux of a winding over its current, from one voltage pulse: what the voltage gives beyond the resistance's share.

    d psi/dt = u - R i,    psi = 0 before the pulse and after it.

The pulse has three parts: the full supply until the current is at its limit, the limit held (there psi stands still, and
R = u/i: of this winding, as warm as it is now, and how it warms), and the opposite voltage until no current is left. Up from
zero, psi = integral of (u - R i); down to zero, psi = integral of (R i - u) over what is left of the pulse. A reading g_u u +
b of the voltage and g i + o of the current give the same R g_u/g at the held end, and, with t the time since the flank's outer
end,

    up:    psi read = g_u psi + (b - R o)(t - integral of i/i_end)
    down:  psi read = g_u psi - b (t - integral of i/i_end) + R (o_down t - o integral of i/i_end) + L o_down

(L o_down: what is read at the end is taken for a current that has its flux), so that gains cost no shape, and offsets little:
R t is small against an inductance. What both read before the pulse is taken off; what is left of offsets is that of a bridge
that is on. `late`, `lean` and `lag` below are the factors of b, o and o_down.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
HELD = 0.4  # share of the pulse, at its end, that tells the resistance
QUIET = 0.001  # of the current's end: less than that is none
LOW, HIGH = 0.05, 0.97  # of the current's end: what of the flanks is taken
AFTER = 10  # samples: of a current that dies away
REST = 10  # samples before a pulse that tell what readings are off
LEAST_A = 0.05  # of a pulse


@dataclass(frozen=True)
class Flank:
    """At each sample (n,) of a flank: current A and flux Wb as they are read, the
    current a sample before, and the factors of the offsets, s and Ohm s."""

    current: Array
    before: Array
    flux: Array
    late: Array
    lean: Array
    lag: Array


@dataclass(frozen=True)
class Pulse:
    """What one pulse shows: current, voltage and resistance of its end, the greatest voltage up, both flanks; by what
    share R grows in a second; noise of the current's reading, A."""

    current: float
    voltage: float
    resistance: float
    highest: float
    up: Flank
    down: Flank
    warming: float
    noise: float


def read(u: Array, i: Array, step_s: float, warming: float | None = None) -> Pulse | None:
    """Of a capture: `u` (n,) V over the step that ends at each sample, `i` (n,) A. None where there is no pulse. `warming` of R
    as the mean of pulses has it; None: as this pulse shows it, which noise makes uncertain."""
    if len(i) < 20 or not (np.isfinite(u).all() and np.isfinite(i).all()):
        return None
    u, i = _from_rest(u, i)
    size = np.abs(i)
    if size.max() < LEAST_A:
        return None
    first, last = _held(u, size)
    if last - first < 4:
        return None
    end, volts = float(i[first:last].mean()), float(u[first:last].mean())
    time = np.arange(len(i)) * step_s
    mean = np.concatenate([[0.0], 0.5 * (i[1:] + i[:-1])])  # over the step that ends at a sample
    ohm, rate, warmer = _resistance(u, i, np.cumsum((mean / end) ** 2) * step_s, (first, last), warming)
    psi, share = np.cumsum(u - ohm * (1 + warmer) * mean) * step_s, np.cumsum(mean) * step_s / end
    up, down = _rising(size, first), _falling(size, last - 1)
    start, stop = up[0], down[-1]

    def flank(index: npt.NDArray[np.intp], flux: Array, late: Array, lean: Array, lag: Array) -> Flank:
        kept = index[(size[index] > LOW * abs(end)) & (size[index] < HIGH * abs(end))]
        return Flank(i[kept], i[np.maximum(kept - 1, 0)], flux[kept], late[kept], lean[kept], lag[kept])

    since, gone = time - time[start] - step_s / 2, share - share[start]  # an offset is in half of the first step's mean
    until, left = time[stop] - time, share[stop] - share
    rising = flank(up, psi - psi[start], since + step_s / 2 - gone, ohm * (gone - since), np.zeros(len(i)))
    henry, rest = _inductance(rising), slice(stop - AFTER // 2, stop + 1)
    final = float((psi[rest] - henry * i[rest]).mean())
    falling = flank(down, psi - final, left - until, -ohm * left, ohm * until + henry)
    highest = float(np.abs(u[start:first]).max())
    noise = float(np.diff(i[first:last]).std()) / math.sqrt(2)
    return Pulse(end, volts, ohm, highest, rising, falling, rate, noise)


def _from_rest(u: Array, i: Array) -> tuple[Array, Array]:
    """Less what both read before the pulse, when there is neither voltage nor current."""
    before = int(np.argmax(np.abs(u) > 0.3 * np.abs(u).max())) - 1
    return (u, i) if before < REST else (u - u[:before].mean(), i - i[:before].mean())


def _resistance(
    u: Array, i: Array, heat: Array, held: tuple[int, int], warming: float | None
) -> tuple[float, float, Array]:
    """R in the middle of the held end, the share of it that comes in a second of the end's current, and by how much of it the
    winding is warmer at each sample: it warms as the integral of i^2, by as much as u/i grows while the current is held (6 A in
    7.8 Ohm and 60 J/K: 0.2 permille in 10 ms)."""
    window, middle = slice(*held), float(heat[slice(*held)].mean())
    slope, ohm = np.polyfit(heat[window] - middle, u[window] / i[window], 1)
    rate = float(slope / ohm) if warming is None else warming
    return float(ohm), rate, (heat - middle) * rate


def _inductance(rising: Flank) -> float:
    """Of small currents: what is left at the end of the pulse has that much flux."""
    few = slice(0, 2)
    return float((rising.flux[few] / rising.current[few]).mean()) if len(rising.current) else 0.0


def _held(u: Array, size: Array) -> tuple[int, int]:
    """Samples of the later part of the held end: the last ones before the voltage turns round."""
    top = float(np.median(size[size > 0.5 * size.max()]))
    on = np.flatnonzero(size > 0.97 * top)
    against = np.flatnonzero(u[on] * np.sign(u[on[0]]) <= 0)
    last = int(on[against[0]]) if against.size else int(on[-1]) + 1
    return last - int(HELD * (last - on[0])), last


def _rising(size: Array, held: int) -> npt.NDArray[np.intp]:
    """Samples from the last one without current on, up to the held end."""
    none = np.flatnonzero(size[:held] < QUIET * size[held])
    return np.arange(int(none[-1]) if none.size else 0, held)


def _falling(size: Array, held: int) -> npt.NDArray[np.intp]:
    """Samples from the held end on, to where no current is left."""
    none = np.flatnonzero(size[held:] < QUIET * size[held])
    last = held + int(none[0]) + AFTER if none.size else len(size)
    return np.arange(held, min(last, len(size) - 1) + 1)
