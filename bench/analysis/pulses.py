"""Pulses that are missing or doubled, by the spacing of the others."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
TOLERANCE = 0.15  # of a turn's time: a shaft cannot change its speed by more within one turn, above a crawl
TOLERANCES = (0.02, 0.05, TOLERANCE)  # the tightest that explains the spacing decides between explanations
CRAWL = 0.47  # log of the change beyond which no turn follows another
MOST_MISSING = 3  # in a row; beyond that the spacing is guesswork
AROUND = 8  # intervals to either side that say how long a turn takes


def repaired(t: Array, numbers: Integers) -> tuple[Integers, Integers, list[float], list[float]]:
    """Which pulses to keep (m,), the turn each of them begins (m,), and the times of missing and of doubled ones.

    Of several readings of the spacing (a turn is the short interval, the usual one, the long one, or two together) that
    with fewest defects is taken, at equal ones the former.

    Raises:
        AnalysisError: none explains the spacing.
    """
    first, end = _crawl(np.diff(t) / np.diff(numbers))
    kept, turns, missing, doubled = _mended(t[first:end], numbers[first:end])
    return kept + first, turns, missing, doubled


def _crawl(gaps: Array) -> tuple[int, int]:
    """First pulse and end of the pulses of a shaft that really turns: one that has just started, or is about to stop, changes
    its speed by much in a turn, and every turn by less (or more) than the one before. No echo, no missing pulse does that."""
    change = np.log(gaps[:-1] / gaps[1:])

    def steps(c: Array) -> int:
        k = 0
        while k + 1 < c.size and np.log1p(TOLERANCE) <= c[k] < CRAWL and 0 < c[k + 1] < c[k]:
            k += 1
        return k

    return steps(change), gaps.size + 1 - steps(-change[::-1])


def _mended(t: Array, numbers: Integers) -> tuple[Integers, Integers, list[float], list[float]]:
    """As `repaired`, of a shaft that turns."""
    gaps = np.diff(t) / np.diff(numbers)
    if (np.abs(np.log(gaps[1:] / gaps[:-1])) < np.log1p(TOLERANCE)).all():
        return np.arange(t.size), numbers - numbers[0], [], []
    for tolerance in TOLERANCES:
        walks = [_walk(t, numbers, turn, first, tolerance) for turn in _lengths(gaps) for first in (0, 1)]
        found = [w for w in walks if w is not None]
        if found:
            return min(found, key=lambda w: len(w[2]) + len(w[3]))
    raise AnalysisError(
        f"pulses: the time between two goes from {gaps.min():.4g} s to {gaps.max():.4g} s, which neither missing nor "
        "doubled pulses explain; see to the pickup and its level"
    )


def _lengths(gaps: Array) -> list[Array]:
    """Candidates for the time of a turn at each interval (m,), by order statistics of those around it."""
    pairs = gaps + np.append(gaps[1:], gaps[-2])
    around = [slice(max(0, k - AROUND), k + AROUND) for k in range(gaps.size)]
    shares = [np.array([np.quantile(gaps[s], q, method="lower") for s in around]) for q in (0.5, 0.2, 0.8)]
    return [*shares, np.array([np.median(pairs[s]) for s in around])]


def _walk(
    t: Array, numbers: Integers, turn: Array, first: int, tolerance: float
) -> tuple[Integers, Integers, list[float], list[float]] | None:
    """From pulse to pulse one turn (or some, with missing ones) at a time; None where that cannot be."""
    kept, turns = [first], [0]
    missing: list[float] = []
    doubled = [float(x) for x in t[:first]]
    k = first
    while k < t.size - 1:
        j, found = k + 1, 0
        while j < t.size:
            apart = (t[j] - t[k]) / turn[k]
            recorded = numbers[j] - numbers[k]
            count = max(int(recorded), round(apart)) if j == k + 1 else 1
            if apart > count + tolerance * count or count - recorded > MOST_MISSING:
                return None
            if abs(apart - count) <= tolerance * (1 if count < 3 else count / 2):
                found = count
                break
            j += 1
        if not found:  # the record ends within a turn
            doubled += [float(x) for x in t[k + 1 :]]
            break
        if abs(turn[min(j, t.size - 2)] / turn[k] - 1) > 2 * tolerance * found:
            return None  # the length of a turn does not jump
        between = [float(x) for x in t[k + 1 : j]]
        if between and between[0] - t[k] > 0.5 * turn[k]:
            return None  # an echo comes after its pulse; this started at the echo
        doubled += between
        lacking = found - int(numbers[j] - numbers[k]) if j == k + 1 else 0
        missing += [float(t[k] + (t[j] - t[k]) * (i + 1) / found) for i in range(max(lacking, 0))]
        kept.append(j)
        turns.append(turns[-1] + found)
        k = j
    return (np.array(kept), np.array(turns), missing, doubled) if len(kept) > 3 else None
