"""Pictures of a control loop: its sensitivity over the frequency with zones, and the Nyquist plot."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bench.analysis.peaks import Peak
from bench.analysis.pictures import TURN
from bench.analysis.responses import Response
from bench.figures import Figure, Series


def sensitivity(
    key: str, title: str, curves: Sequence[tuple[str, Response]], zones: Sequence[float], peak: Peak | None = None
) -> Figure:
    """abs(S) of each axis over the zones that end at `zones` (A/B, B/C, C/D), with the interval of the greatest."""
    edges = [0.0, *zones, math.inf]
    bands = tuple((f"zone {name}", low, high) for name, low, high in zip("ABCD", edges[:-1], edges[1:], strict=True))
    series = [Series(label, r.hz, np.abs(r.values)) for label, r in curves]
    notes: tuple[tuple[str, float, float], ...] = ()
    if peak is not None:
        half = np.array([max(peak.high - peak.value, peak.value - peak.low)])
        series.append(Series("maximum, 95 %", np.array([peak.at]), np.array([peak.value]), "points", half))
        notes = ((f"{peak.value:.2f} at {peak.at:.0f} Hz", peak.at, peak.value),)
    return Figure(
        key,
        title,
        "Sensitivity |S| with all other loops closed; zones after ISO 14839-3. The synchronous lines are left out.",
        "frequency (Hz)",
        "|S|",
        tuple(series),
        bands=bands,
        notes=notes,
        log_x=True,
    )


def nyquist(key: str, title: str, curves: Sequence[tuple[str, Response]], peak: float, view: float = 3.0) -> Figure:
    """Open loops about the point -1, with the circle of radius 1/`peak` that they must stay out of."""
    series = [
        Series(f"|S| = {peak:g}", -1 + np.cos(TURN) / peak, np.sin(TURN) / peak, "guide"),
        Series("unit circle", np.cos(TURN), np.sin(TURN), "guide"),
    ]
    for label, r in curves:
        near = np.abs(r.values + 1) < view
        series.append(Series(label, np.where(near, r.values.real, np.nan), np.where(near, r.values.imag, np.nan)))
    series.append(Series("−1", np.array([-1.0]), np.array([0.0]), "mark"))
    return Figure(
        key,
        title,
        "Open loop L = 1/S − 1. Its distance from −1 is 1/|S|; in the dashed circle about −1 the sensitivity is greater than "
        "stated.",
        "real part",
        "imaginary part",
        tuple(series),
        "plane",
    )
