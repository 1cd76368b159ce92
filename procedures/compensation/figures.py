"""What the compensation draws: reduction over the speed, and the switch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from bench.figures import Figure, Series
from bench.uncertainty import Estimate, coverage_factor
from bench.units import RPM
from procedures.compensation.switching import WITHIN_S, Switched
from procedures.synchronous.estimates import Result

MOST_POINTS = 4000


def draw_reductions(found: Sequence[tuple[Result, Estimate]]) -> Iterator[Figure]:
    """Reduction of what the probes read over the speed, by setting."""
    series = []
    for variant in dict.fromkeys(r.dwell.variant for r, _ in found):
        some = [(r, e) for r, e in found if r.dwell.variant == variant]
        x = np.array([RPM * r.dwell.speed for r, _ in some])
        y = np.array([100 * e.value for _, e in some])
        u = np.array([100 * coverage_factor(float("inf")) * e.u for _, e in some])
        series.append(Series(variant, x, y, "both", u))
    yield Figure("reduction", "Reduction of the synchronous amplitude", "Order 1 as the probes read it, root mean square "
                 "of the four, against no compensation at the same speed.", "speed (r/min)", "reduction (%)", tuple(series),
                 lines=(("90 %", 90.0),))  # fmt: skip


def draw_switch(s: Switched) -> Iterator[Figure]:
    """The amplitude over time, and the four readings."""
    t, size = s.course()
    rpm = f"{s.speed * RPM:.0f} r/min"
    yield Figure("switch-amplitude", f"Switched on at {rpm}: amplitude of order 1", "Root mean square of the "
                 f"four probes, over six turns each; switched on at 0. The dashed lines cross at 20 %, to be reached at "
                 f"{WITHIN_S * 1e3:.0f} ms.", "time (ms)", "amplitude (µm 0-pk)",
                 (Series("order 1", 1e3 * t, 1e6 * size, "both"),
                  Series(f"{WITHIN_S * 1e3:.0f} ms", np.full(2, 1e3 * WITHIN_S), np.array([0.0, 1e6 * size.max()]), "guide")),
                 lines=(("20 %", 0.2e6 * float(size[t < -3 * s.turn].mean())),))  # fmt: skip
    part = slice(None, None, max(1, -(-len(s.t) // MOST_POINTS)))
    places = zip(s.axes, s.positions, strict=True)
    series = tuple(Series(a, 1e3 * s.t[part], 1e6 * x[part] - 40 * k) for k, (a, x) in enumerate(places))
    yield Figure("switch-readings", f"Switched on at {rpm}: the readings", "As read, noise and runout included; "
                 "each one below the one before, 40 µm apart.", "time (ms)", "reading (µm)",
                 series)  # fmt: skip
