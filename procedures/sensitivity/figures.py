"""What the sensitivity draws: |S| over its zones, the Bode pair of S, the open loop about -1, coherence."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from bench.analysis import loop_pictures
from bench.analysis.peaks import Peak
from bench.analysis.responses import Response, loop
from bench.figures import Figure, Series
from bench.uncertainty import interval
from procedures.sensitivity.checks import ZONES
from procedures.sensitivity.estimates import Result, joined_curve
from procedures.sensitivity.margins import modelled
from procedures.sensitivity.steps import MODE, SCAN, name_speed

CLEAR = 0.97  # coherence below which a line is not drawn in the Nyquist plot


def all_figures(results: Sequence[Result]) -> Iterator[Figure]:
    """In the order of the report, by speed."""
    for speed in dict.fromkeys(r.speed for r in results):
        some = [r for r in results if r.speed == speed and r.curve.hz.size]
        if some:
            key = f"{speed * 30 / np.pi:.0f}"
            yield _zones(some, key, name_speed(speed))
            yield _bode(some, key, name_speed(speed))
            yield _nyquist(some, key, name_speed(speed))
            yield _coherence(some, key, name_speed(speed))


def _zones(some: Sequence[Result], key: str, name: str) -> Figure:
    top = max((r for r in some if r.peaks), key=lambda r: r.peaks[0].top.value, default=None)
    peak = None
    if top is not None:
        e, t = top.estimates["s_max"], top.peaks[0].top
        i = interval(e)
        peak = Peak(e.value, i.low, i.high, e.u, t.at, t.u_at, e.value + t.bias, t.bias)
    return loop_pictures.sensitivity(
        f"sensitivity-{key}", f"Sensitivity, {name}", [(r.axis, r.curve) for r in some], ZONES, peak
    )


def _bode(some: Sequence[Result], key: str, name: str) -> Figure:
    """Magnitude in dB over phase in degrees."""
    size = tuple(Series(r.axis, r.curve.hz, 20 * np.log10(np.maximum(np.abs(r.curve.values), 1e-6))) for r in some)
    phase = tuple(Series(r.axis, r.curve.hz, np.degrees(np.unwrap(np.angle(r.curve.values[::-1]))[::-1])) for r in some)
    below = Figure(f"bode-phase-{key}", "", "", "frequency (Hz)", "phase (°)", phase, log_x=True)
    return Figure(f"bode-{key}", f"Bode plot of the sensitivity, {name}", "S = V1/E: magnitude, and phase lead.",
                  "frequency (Hz)", "|S| (dB)", size, log_x=True, below=below)  # fmt: skip


def _nyquist(some: Sequence[Result], key: str, name: str) -> Figure:
    curves = [(r.axis, loop(_clear(r))) for r in some]
    figure = loop_pictures.nyquist(f"nyquist-{key}", f"Open loop, {name}", curves, ZONES[0])
    if any(t.kind == MODE for r in some for t in r.taken):
        return replace(figure, caption=f"{figure.caption} Near bending modes: the models of their lines.")
    return figure


def _clear(r: Result) -> Response:
    """The lines that say something, in order: the survey's, and the model of those about a mode, on whose circle few lie."""
    curve = joined_curve([replace(t, response=modelled(t)) if t.kind == MODE else t for t in r.taken if t.kind != SCAN])
    return curve.at(curve.coherence > CLEAR)


def _coherence(some: Sequence[Result], key: str, name: str) -> Figure:
    series = tuple(Series(r.axis, r.curve.hz, r.curve.coherence) for r in some)
    return Figure(f"coherence-{key}", f"Coherence of injection and reference, {name}", "Over the periods of the multisine.",
                  "frequency (Hz)", "coherence", series, log_x=True)  # fmt: skip
