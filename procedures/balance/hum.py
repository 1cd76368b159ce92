"""Hum in a balancing: what a line in the probes at a speed of the runs makes of unbalance and influence coefficients."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from bench.findings import Effect, Finding
from bench.uncertainty import Estimate, interval
from bench.units import RPM
from procedures.balance.estimates import Balanced
from procedures.balance.steps import BASE, Recorded
from procedures.synchronous import hum
from procedures.synchronous.dwells import Complex, Dwell

TWO_RUNS = math.sqrt(2)  # an influence coefficient is a difference of two, in which the line has any phase
Influences = Mapping[tuple[str, str], tuple[Estimate, Estimate]]


def of_balance(
    found: hum.Heard | None, recorded: Recorded, balance: Balanced, shown: Sequence[str], influences: Influences
) -> Iterator[Finding]:
    """Speeds at which a line may move the unbalance of a run in `shown`, or an influence coefficient, by more than its
    expanded uncertainty. Every run is in all results: the finding is of all."""
    dwells = sorted((d for d in recorded.of(BASE) if not d.again), key=lambda d: d.wanted)
    if found is None or len(dwells) != len(balance.solved.influence):
        return
    for s, d in enumerate(dwells):
        turns, reach = d.speed / (2 * math.pi), hum.REACH / hum.duration(d)
        lines = list(found.lines(turns - reach, turns + reach))
        off = [
            (*_worst(found.at(x.hz) * hum.leak(d, x.hz), s, balance, shown, influences, found.axes), x) for x in lines
        ]
        ratio, what, line = max(off, key=lambda o: o[0], default=(0.0, "", None))
        if line is not None and ratio > 1:
            text = (f"{hum.describe(line)} Here, at {turns:.2f} Hz, {what} may be off by {ratio:.1f} times its U. Below "
                    f"{60 * (line.hz - reach):.0f} and above {60 * (line.hz + reach):.0f} r/min it is told apart.")  # fmt: skip
            yield Finding("hum", text, _name(d), Effect.INDETERMINATE)


def _name(d: Dwell) -> str:
    return f"{d.wanted * RPM:.0f} r/min"


def _worst(
    h: Complex, s: int, balance: Balanced, shown: Sequence[str], influences: Influences, axes: Sequence[str]
) -> tuple[float, str]:
    """What a line `h` (4,) m at the s-th speed moves most, over its U, and its name. It moves the readings that an unbalance
    follows from, and the influence coefficients by which it does."""
    all_ = balance.solved.influence
    weights = [abs(balance.trials.unbalance(p)) for p in (0, 1)]
    sides = [plane.name for plane in balance.planes]
    read = np.zeros(all_.shape[:2], complex)
    read[s] = h
    moved = np.abs(np.linalg.lstsq(all_.reshape(-1, 2), read.reshape(-1), rcond=None)[0])
    out = []
    for run in shown:
        share = TWO_RUNS * float(np.abs(balance.unbalance[run].values).max()) / min(weights)
        for p, side in enumerate(sides):
            known = min(interval(e).U for e in balance.parts[run][2 * p : 2 * p + 2])
            out.append((float(moved[p]) * math.hypot(1, share) / known, f"the unbalance {side}, {run},"))
    for p, side in enumerate(sides if s == len(all_) - 1 else ()):  # stated at the highest speed alone
        for k, axis in enumerate(axes):
            known = min(interval(e).U for e in influences[axis, side])
            out.append((TWO_RUNS * abs(h[k]) / weights[p] / known, f"the influence of a weight {side} on {axis}"))
    return max(out)
