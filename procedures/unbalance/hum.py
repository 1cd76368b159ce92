"""Hum in a dwell's vectors: dwells that a line in the probes may move."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from bench.findings import Effect, Finding
from bench.uncertainty import interval
from procedures.synchronous.hum import REACH, Heard, describe, duration, leak
from procedures.unbalance.checks import its_own
from procedures.unbalance.estimates import Result


def of_dwells(found: Heard | None, results: Sequence[Result]) -> Iterator[Finding]:
    """Dwells whose vectors a line may move by more than their expanded uncertainty."""
    if found is None:
        return
    for r in results:
        d = r.dwell
        reach = REACH / duration(d)
        turns = d.speed / (2 * math.pi)
        known = [min(interval(r.estimates[name, a]).U for name in ("vector_cos", "vector_sin")) for a in d.machine.axes]
        off = [(x.size * leak(d, x.hz), x) for x in found.lines(turns - reach, turns + reach)]
        worst = max(off, key=lambda o: o[0] / known[o[1].probe], default=None)
        if worst is None or worst[0] <= known[worst[1].probe]:
            continue
        size, line = worst
        low, high = (60 * (line.hz + side * reach) for side in (-1, 1))
        text = (f"{describe(line)} Here, at {turns:.2f} Hz, the vector may be off by {size * 1e6:.3f} µm, "
                f"{size / known[line.probe]:.1f} times its U. Below {low:.0f} and above {high:.0f} r/min it is told "
                "apart.")  # fmt: skip
        yield Finding("hum", text, d.where, Effect.INDETERMINATE, its_own(d))
