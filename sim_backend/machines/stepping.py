"""What a machine does when its set points step: what steps of one size show, and the poles of small motions, from readings of
its ticks. Each machine's `truth_step` makes them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from sim_backend.core import TICK_S

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
SMALL_M = 1e-8
ANSWER = 2  # ticks from a set point's write to the amplifiers: computed one later, applied another one later
DECIMATED_S, ROWS, ORDER = 4e-4, 60, 12  # of the identification: between samples, rows of the Hankel matrix, states
BEGIN_S, LENGTH_S = 6e-4, 0.1  # of the record that it is made of
SLOW_HZ, FAST_HZ, DAMPED = 15.0, 250.0, 0.95  # of the rigid modes: slower are integrators, faster filters and bending
OF_ITS_OWN = 0.75  # of the pole that carries most: what lies farther from it is another oscillation
SWING_S = 0.08  # of the first swing
BAND_S = 0.25, 0.5, 1.0  # of the response that makes the bandwidth: the first that is calm
CALM = 0.01  # of the step, over the last fifth of it
SCANNED = 40  # the first line of the response that is looked at: 20 Hz, where the procedure begins
PHASES = 3  # of the revolution, at which steps begin: what goes with one or two a turn has no mean
# Orders that small motions of a turning shaft are freed of; with two a pole damped by .73 was told .66.
ROUND = range(1, 9)
COORDINATES = "yzx"


@dataclass(frozen=True)
class Watched:
    """How a machine is stepped along one axis and seen. `tick_s`; `seen` makes of its readings (n, m) y, z, x of the centre of
    mass and two tilts as lengths, (5, n) m: as read, or as they are where its second argument says so; `write` puts the set
    point of `axis`, m."""

    axis: str
    seen: Callable[[Array, bool], Array]
    write: Callable[[Any, float], None]
    tick_s: float = TICK_S

    def ticks(self, seconds: float) -> int:
        """How many there are in a time."""
        return round(seconds / self.tick_s)


@dataclass(frozen=True)
class Shown:
    """What steps of one size and direction show together: the mean of their responses `y` (n,) as shares of the step, as read,
    at `t` s from the set point's write; `steady_error` m, of the shaft itself."""

    t: Array
    y: Array
    steady_error: float
    tick_s: float = TICK_S

    @property
    def overshoot(self) -> float:
        """Greatest position beyond the step, as a share of it."""
        return float(self.y[: self._swing].max()) - 1

    @property
    def rise_time(self) -> float:
        """10 to 90 % of the step, s."""
        top = int(np.argmax(self.y[: self._swing])) + 1
        low, high = np.interp((0.1, 0.9), self.y[:top], self.t[:top])
        return float(high - low)

    @property
    def bandwidth(self) -> float:
        """Where the spectrum of the response's derivative first falls below 0.707, Hz: a bending mode may lift it again."""
        ends = [round(s / self.tick_s) for s in BAND_S if s <= len(self.y) * self.tick_s] or [len(self.y)]
        calm = [n for n in ends if np.ptp(self.y[n - n // 5 : n]) < CALM]
        y = self.y[: (*calm, ends[-1])[0]]
        count = round(1 / (0.5 * self.tick_s))  # zeros behind, for lines 0.5 Hz apart
        gain = np.abs(np.fft.rfft(np.diff(y, prepend=y[0]), count))[:1000]
        above = gain >= math.sqrt(0.5)
        falls = np.flatnonzero(above[SCANNED:-1] & ~above[SCANNED + 1 :]) + SCANNED
        if not len(falls):  # between 20 and 500 Hz it does not
            return math.inf
        last = int(falls[0])
        return 0.5 * float(np.interp(-math.sqrt(0.5), -gain[last : last + 2], [last, last + 1]))

    def settling_time(self, band: float, window_s: float) -> float:
        """Until the mean over a window stays in the band about 1, between ticks as they say: a reading stands for half a tick
        either way."""
        total = np.concatenate(([0.0], np.cumsum(self.y)))
        n = round(window_s / self.tick_s)
        at = np.arange(1, len(self.y) + 1)
        mean = (total[at] - total[np.maximum(at - n, 0)]) / np.minimum(at, n)
        beyond = np.abs(mean - 1) - band
        outside = np.flatnonzero(beyond > 0)
        if not len(outside):
            return 0.0
        last = int(outside[-1])
        two = beyond[last : last + 2]
        into = float(two[0] / (two[0] - two[1])) if len(two) == 2 else 0.5
        return float(self.t[last]) + (0.5 + into) * self.tick_s

    @property
    def _swing(self) -> int:
        return round(SWING_S / self.tick_s)


def steps(
    plant: Any, of: Watched, size: float, rest_s: float, record_s: float, *, wait_s: float = 0.0, turn_s: float = 0.0
) -> dict[int, Shown]:
    """Up, back, down and back, after `wait_s` and `rest_s`: by way (1 up, -1 down) what they show together; `turn_s` of a
    revolution, 0 at rest. Where the shaft turns, the mean of steps at PHASES of its revolution, since unbalance makes the
    bearings' slopes go with it."""
    if turn_s:  # as it truly turns: a mean over 2e-4 of a revolution less keeps half a nanometre of an orbit of 2 µm
        turn_s = 2 * math.pi / plant.shaft_speed
    responses: dict[int, list[Array]] = {1: [], -1: []}
    errors: dict[int, list[float]] = {1: [], -1: []}
    for begin, end in ((0.0, size), (size, 0.0), (0.0, -size), (-size, 0.0)):
        way = 1 if end > begin else -1
        plant.run(of.ticks(wait_s))
        before = plant.run(of.ticks(rest_s), 1)[1]
        for phase in range(PHASES if turn_s else 1):
            begun = plant.twin()
            begun.run(of.ticks(phase * turn_s / PHASES))
            moved, at_end = _moved(begun, of, end, before, record_s, turn_s)
            responses[way].append(way * moved / size)
            errors[way].append(at_end - way * size)
        of.write(plant, end)
        plant.run(of.ticks(record_s))
    t = np.asarray(np.arange(of.ticks(record_s)) * of.tick_s, np.float64)
    return {w: Shown(t, np.mean(y, axis=0), float(np.mean(errors[w])), of.tick_s) for w, y in responses.items()}


def _moved(plant: Any, of: Watched, end: float, before: Array, record_s: float, turn_s: float) -> tuple[Array, float]:
    """Along an axis, from where it rested `before`: the position as read (n,) m, and where the shaft itself is in the end. What
    turns with the shaft is taken away, as a twin that makes no step shows it.

    Raises:
        AnalysisError: the shaft does not stay up.
    """
    k, many = COORDINATES.index(of.axis), of.ticks(record_s)
    still = plant.twin()
    of.write(plant, end)
    after, beside = plant.run(many, 1)[1], still.run(many, 1)[1]
    if min(len(after), len(beside)) < many:
        raise AnalysisError(f"steps of {of.axis}: found {len(after)} of {many} ticks; the shaft does not stay up")
    out = []
    for true in (False, True):
        x, twin, rest = (of.seen(trace, true)[k] for trace in (after, beside, before))
        ticks = turn_s / of.tick_s
        out.append(x - (twin - drift(twin, ticks)) - float(drift(rest, ticks).mean()))
    return out[0], float(out[1][-of.ticks(min(0.2, record_s / 4)) :].mean())


def drift(x: Array, ticks: float) -> Array:
    """`x` (n,) without what goes with the revolution of so many ticks, 0 where nothing turns: its means over whole ones, with
    straight lines between their middles."""
    if not ticks:
        return x
    edges = np.arange(0, len(x) + 1e-9, ticks)
    total = np.interp(edges, np.arange(len(x) + 1), np.concatenate(([0.0], np.cumsum(x))))
    middles = (edges[1:] + edges[:-1]) / 2
    return np.asarray(np.interp(np.arange(len(x)) + 0.5, middles, np.diff(total) / np.diff(edges)))


@dataclass(frozen=True)
class Small:
    """Of small motions along an axis: `poles` 1/s of the rigid modes with a positive frequency, their `parts` in a unit step
    when the amplifiers answer."""

    poles: Complex
    parts: Complex

    @property
    def pole(self) -> complex:
        """Of the oscillation as it begins: the mean of the poles, each with its part, of the one that carries most, by the
        integral of its square, and of those that are near it. What lies farther is another oscillation. Not a number where
        nothing swings."""
        if not len(self.poles):
            return complex(math.nan)
        lead = self.poles[int(np.argmax(np.abs(self.parts) ** 2 / -self.poles.real))]
        near = np.abs(self.poles - lead) < OF_ITS_OWN * np.abs(lead)
        return complex((self.parts * self.poles)[near].sum() / self.parts[near].sum())

    @property
    def damping(self) -> float:
        """Damping ratio of that pole."""
        return -self.pole.real / abs(self.pole)

    @property
    def frequency(self) -> float:
        """Natural frequency of that pole, Hz."""
        return abs(self.pole) / (2 * math.pi)


def small(plant: Any, of: Watched, repeats: int = 1, turn_s: float = 0.0) -> Small:
    """Poles by the eigensystem realisation algorithm (Juang and Pappa, 1985) from `repeats` steps of SMALL_M: the mean of what
    each does beside a twin in the same noise that makes none. With `turn_s` they begin round a revolution: the slopes of the
    bearings go round with the unbalance, and what goes with the phase of the shaft is no pole of the mean."""
    k, begin, every = COORDINATES.index(of.axis), of.ticks(BEGIN_S), of.ticks(DECIMATED_S)
    length, gone = begin + of.ticks(LENGTH_S), 0
    each, phases = [], []
    for n in range(repeats):
        if turn_s:
            wait = of.ticks((n * turn_s / repeats - gone * of.tick_s) % turn_s)
            plant.run(wait)
            phases.append((gone + wait) * of.tick_s * plant.shaft_speed)
            gone += wait + length
        other = plant.twin()
        of.write(other, SMALL_M)
        stepped, still = (of.seen(p.run(length, 1)[1], False) for p in (other, plant))
        each.append((stepped - still) / SMALL_M)
    made = np.tensordot(_of_mean(np.array(phases)) if turn_s else np.full(repeats, 1 / repeats), each, axes=1)
    sampled = np.diff(made[:, begin:length:every], axis=1)
    values = _eigenvalues(sampled[np.abs(sampled).max(axis=1) > 1e-6])
    s = np.log(values.astype(complex)) / (every * of.tick_s)
    powers = values[None, :] ** np.arange(sampled.shape[1])[:, None]
    parts = np.linalg.lstsq(powers, sampled[k].astype(complex), rcond=None)[0] / (values - 1)
    hz = np.where(s.imag > 1.0, np.abs(s), 0.0) / (2 * np.pi)
    use = (hz > SLOW_HZ) & (hz < FAST_HZ) & (-s.real < DAMPED * np.abs(s))
    return Small(s[use], parts[use] * np.exp(-s[use] * (begin - ANSWER) * of.tick_s))


def _of_mean(phases: Array) -> Array:
    """Weights (n,) by which responses that begin at `phases` (n,) have a mean: by a fit of it and the orders ROUND."""
    orders = [f(n * phases) for n in ROUND for f in (np.cos, np.sin)]
    return np.asarray(np.linalg.pinv(np.column_stack([np.ones_like(phases), *orders]))[0])


def _eigenvalues(y: Array) -> Complex:
    columns = y.shape[1] - ROWS
    hankel = np.concatenate([y[:, i : i + columns] for i in range(ROWS)])
    u, size, v = np.linalg.svd(hankel[:, :-1], full_matrices=False)
    root = np.sqrt(size[:ORDER])
    return np.asarray(np.linalg.eigvals((u[:, :ORDER].T @ hankel[:, 1:] @ v[:ORDER].T) / np.outer(root, root)))
