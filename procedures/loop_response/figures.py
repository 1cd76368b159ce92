"""What the responses draw: |y/r| with its -3 dB, and |S| over the zones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from bench.figures import Figure, Series
from bench.uncertainty import interval
from procedures.loop_response.estimates import Result
from procedures.loop_response.fit import HALF
from procedures.loop_response.steps import Taken
from procedures.sensitivity.checks import ZONES


def all_figures(results: Sequence[Result]) -> Iterator[Figure]:
    """In the order of the report."""
    if any(r.response for r in results):
        yield _responses([r for r in results if r.response])
    if any(r.sensitivity for r in results):
        yield _sensitivities([r for r in results if r.sensitivity])


def _curve(some: Sequence[Taken], label: str) -> Series:
    lines = [t.line for t in some if t.line is not None]
    return Series(label, np.array([t.hz for t in some]), np.array([x.size for x in lines]))


def _responses(some: Sequence[Result]) -> Figure:
    series, notes = [], []
    for r in some:
        series.append(_curve(r.response, r.axis))
        if "bandwidth" in r.estimates:
            at = r.estimates["bandwidth"].value
            series.append(Series(f"{r.axis}, -3 dB", np.array([at]), np.array([HALF]), "mark"))
            notes.append((f"{r.axis} {at:.0f} Hz", at, HALF))
    caption = ("Amplitude of the reading over that of the reference, which was injected with its rate; all other loops closed. "
               "Dots: where each falls through -3 dB.")  # fmt: skip
    return Figure("response", "Response of the loops to their references", caption, "frequency (Hz)", "|y/r|", tuple(series),
                  lines=(("-3 dB", HALF),), log_x=True)  # fmt: skip


def _sensitivities(some: Sequence[Result]) -> Figure:
    edges = [0.0, *ZONES, np.inf]
    bands = tuple((f"zone {n}", low, high) for n, low, high in zip("ABCD", edges[:-1], edges[1:], strict=True))
    series, notes = [_curve(r.sensitivity, r.axis) for r in some], []
    worst = max((r for r in some if "s_max" in r.estimates), key=lambda r: r.estimates["s_max"].value, default=None)
    if worst is not None:
        size, at = worst.estimates["s_max"], worst.estimates["s_max_hz"].value
        i = interval(size)
        half = np.array([max(i.high - size.value, size.value - i.low)])
        series.append(Series("greatest, 95 %", np.array([at]), np.array([size.value]), "points", half))
        notes.append((f"{worst.axis}: {size.value:.2f} at {at:.1f} Hz", at, size.value))
    caption = "|S| by a sine added to the reading, all other loops closed; zones after ISO 14839-3."
    return Figure("sensitivity", "Sensitivity of the loops", caption, "frequency (Hz)", "|S|", tuple(series), bands=bands,
                  notes=tuple(notes), log_x=True)  # fmt: skip
