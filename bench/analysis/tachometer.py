"""The shaft's angle over time from a once-per-turn pulse: splines through the pulses, and what is wrong with them.

An angle by nominal speed runs away from the shaft within seconds; between two pulses it cannot.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from bench.analysis.evened import evened
from bench.analysis.pulses import repaired
from bench.analysis.sampling import Array, increasing
from bench.errors import AnalysisError

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

Integers = npt.NDArray[np.int64]
TURN = 2 * math.pi
ROUNDED_RAD = 1e-3  # an angle so little under a whole turn is a pulse that has just come, rounded


@dataclass(frozen=True)
class Fresh:
    """The `least` and the `most` age of a pulse at the first sample that counts it; the samples are `apart`. All in s."""

    least: float
    most: float
    apart: float


@dataclass(frozen=True)
class Tachometer:
    """Pulse times (m,) s and the turn each begins (m,); times of pulses found `missing` and `doubled`, which are left out.
    `fresh`: how old they were when they were counted, where that was looked at."""

    times: Array
    turns: Integers
    missing: tuple[float, ...] = ()
    doubled: tuple[float, ...] = ()
    fresh: Fresh | None = None

    @property
    def sound(self) -> bool:
        """Every turn gave one pulse."""
        return not (self.missing or self.doubled)

    @cached_property
    def _angle(self) -> CubicSpline:
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.times, TURN * self.turns)

    @cached_property
    def _time(self) -> CubicSpline:
        from scipy.interpolate import CubicSpline

        return CubicSpline(TURN * self.turns, self.times)

    def angle(self, t: npt.ArrayLike) -> Array:
        """Angle of the shaft in rad at times in s, whole turns counted; NaN before the first and after the last pulse."""
        return np.asarray(self._angle(t, extrapolate=False))

    def speed(self, t: npt.ArrayLike) -> Array:
        """rad/s at times in s; NaN before the first and after the last pulse."""
        return np.asarray(self._angle(t, 1, extrapolate=False))

    def time(self, angle: npt.ArrayLike) -> Array:
        """When the shaft was at an angle in rad, whole turns counted, s; NaN outside the pulses."""
        return np.asarray(self._time(angle, extrapolate=False))


def tachometer(times: npt.ArrayLike, numbers: npt.ArrayLike | None = None, step_s: float = 0.0) -> Tachometer:
    """From pulse times (m,) s; `numbers` (m,) counts the pulses where some were not recorded (lost samples). Times that are
    told in steps of `step_s` are evened out where a turn is short beside that.

    Pulses that are missing or doubled are found by their spacing, named by their times, and mended as far as that is
    certain. Every second pulse missing, or one more in the middle of every turn, looks like another speed: see `against`.

    Raises:
        AnalysisError: fewer than four pulses, not in order, or a spacing that no turning shaft has.
    """
    t = increasing(times, "pulses")
    if t.size < 4:
        raise AnalysisError(f"pulses: found {t.size}; expected four or more")
    n = np.arange(t.size) if numbers is None else np.asarray(numbers, np.int64)
    if n.shape != t.shape or not (np.diff(n) > 0).all():
        raise AnalysisError("pulses: found numbers that do not increase with the times")
    kept, turns, missing, doubled = repaired(t, n)
    return Tachometer(evened(t[kept], turns, step_s), turns, tuple(missing), tuple(doubled))


def against(tacho: Tachometer, speed: float, tolerance: float = 0.1) -> str:
    """The pulses' mean speed against another source's, rad/s: "" where they agree, else "missing" or "doubled"."""
    found = TURN * float(tacho.turns[-1] - tacho.turns[0]) / float(tacho.times[-1] - tacho.times[0])
    if abs(found / speed - 1) <= tolerance:
        return ""
    return "missing" if found < speed else "doubled"


def counted(t: npt.ArrayLike, count: npt.ArrayLike, age: npt.ArrayLike, wraps: int = 65536) -> tuple[Array, Integers]:
    """Pulse times (m,) s and numbers (m,) from a counter of pulses and the age of the last one, both read at times `t` (n,).

    The first reading after each pulse is taken: its age is the least. Several pulses between two neighbouring readings are
    spread over them, so that their spacing tells; between readings with others lost they are skipped, not missing.

    Raises:
        AnalysisError: shapes differ, or the counter runs backwards.
    """
    at, ages = increasing(t, "pulse counter"), np.asarray(age, np.float64)
    raw = np.asarray(count, np.float64)
    if raw.shape != at.shape or ages.shape != at.shape:
        raise AnalysisError(f"pulse counter: found {at.shape}, {raw.shape}, {ages.shape}; expected equal shapes")
    steps = np.mod(np.diff(np.rint(raw)).astype(np.int64), wraps)
    if (steps > wraps // 2).any():
        raise AnalysisError("pulse counter: it runs backwards; was the controller started anew?")
    total = np.concatenate([[0], np.cumsum(steps)])
    fresh = np.flatnonzero((steps > 0) & np.isfinite(ages[1:])) + 1
    usual = float(np.median(np.diff(at)))
    times: list[float] = []
    numbers: list[int] = []
    for k in fresh:
        last, since = float(at[k] - ages[k]), float(at[k - 1])
        more = int(steps[k - 1]) - 1
        if more and at[k] - since < 1.5 * usual:
            gap = (last - since) / (more + 1)
            times += [since + gap * (j + 1) for j in range(more)]
            numbers += [int(total[k]) - more + j for j in range(more)]
        times.append(last)
        numbers.append(int(total[k]))
    return np.array(times), np.array(numbers, np.int64)


def fresh(t: npt.ArrayLike, count: npt.ArrayLike, age: npt.ArrayLike) -> Fresh | None:
    """Ages of the pulses that came between two neighbouring samples, at the second of these; None where there are none."""
    at, since = np.diff(np.asarray(t, np.float64)), np.asarray(age, np.float64)[1:]
    apart = float(np.median(at)) if at.size else 0.0
    new = (np.diff(np.asarray(count, np.float64)) == 1) & (at < 1.5 * apart)
    return Fresh(float(since[new].min()), float(since[new].max()), apart) if new.any() else None


def age(angle: npt.ArrayLike, speed: npt.ArrayLike) -> Array:
    """Age of the last pulse in s from an angle that is carried on at `speed` rad/s from it; NaN where there is no speed."""
    w = np.asarray(speed, np.float64)
    since = np.mod(np.asarray(angle, np.float64) + ROUNDED_RAD, TURN) - ROUNDED_RAD
    out: Array = np.where(w > 0, since / np.where(w > 0, w, 1.0), np.nan)
    return out


def edges(t: npt.ArrayLike, signal: npt.ArrayLike, level: float, hysteresis: float) -> Array:
    """Times (m,) s at which a pickup's signal (n,) rises through `level`, between samples by linear interpolation.

    It counts again only after it was below `level - hysteresis`, so that noise on an edge gives one pulse.
    """
    at, x = increasing(t, "pickup"), np.asarray(signal, np.float64)
    state = np.where(x >= level, 1, np.where(x < level - hysteresis, -1, 0))
    known = np.flatnonzero(state)
    if not known.size:
        return np.array([])
    rises = known[1:][(state[known[1:]] == 1) & (state[known[:-1]] == -1)]
    before, after = x[rises - 1], x[rises]
    share = (level - before) / (after - before)
    out: Array = at[rises - 1] + share * (at[rises] - at[rises - 1])
    return out


def wrapped(t: npt.ArrayLike, phase: npt.ArrayLike, speed: npt.ArrayLike) -> tuple[Array, Integers]:
    """Pulse times and numbers from a phase channel (n,) rad that starts anew at every pulse, and its speed rad/s (n,)."""
    at = increasing(t, "phase")
    turn = np.mod(np.asarray(phase, np.float64) + ROUNDED_RAD, TURN)
    count = np.concatenate([[0], np.cumsum(np.diff(turn) < -math.pi)])
    return counted(at, count, age(phase, speed))


def joined(parts: Sequence[tuple[Array, Integers]]) -> tuple[Array, Integers]:
    """Pulses of records that follow each other with equal counters, without repeats."""
    times = np.concatenate([t for t, _ in parts])
    numbers = np.concatenate([n for _, n in parts])
    _, first = np.unique(numbers, return_index=True)
    return times[first], numbers[first]
