"""Hum in a passage: critical speeds in whose peak a line lies."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from bench.findings import Effect, Finding
from bench.uncertainty import interval
from procedures.run_up.estimates import Peak
from procedures.synchronous.hum import Heard, describe


def of_peaks(found: Heard | None, peaks: Sequence[Peak]) -> Iterator[Finding]:
    """Critical speeds in whose peak, down to half power, a line is larger than the amplitude's expanded uncertainty: a passage
    is too short at any speed to tell it apart."""
    for p in peaks if found is not None else ():
        assert found is not None
        known = interval(p.amplitude).U
        lines = [x for x in found.lines(p.low / (2 * math.pi), p.high / (2 * math.pi)) if x.axis == p.axis]
        line = max(lines, key=lambda x: x.size, default=None)
        if line is not None and line.size > known:
            text = (f"{describe(line)} It lies within half power of this critical speed, whose amplitude is known to "
                    f"{known * 1e6:.3f} µm.")  # fmt: skip
            yield Finding("hum", text, p.where, Effect.INDETERMINATE, (f"@{p.where}",))
