"""What a stepped current draws: along and across over time, half-bridges beside limits, the small signal over frequency."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from bench.figures import Figure, Series
from procedures.current_step import fit
from procedures.current_step.estimates import Place
from procedures.current_step.plan import Plan

Array = npt.NDArray[np.float64]
BEGUN = 0.01  # of a step: from there on it is seen
SHOWN_RISES = 4.0  # after the step


def all_figures(places: Sequence[Place], plan: Plan) -> list[Figure]:
    """In the order of the report: the large step of each place, then the small signal of all, then the half-bridges."""
    if not places:
        return []
    return [*(_step(p, plan) for p in places), _band(places, plan), *(f for p in places for f in _bridges(p))]


def _window(p: Place) -> slice:
    after = round(SHOWN_RISES * p.estimates["rise_time"].value / p.tick_s)
    return slice(max(p.lead - after // 3, 0), p.lead + after)


def _begun(p: Place) -> int:
    """The last sample before the step is seen."""
    return int(np.flatnonzero(p.along.mean(axis=0)[: p.lead] < BEGUN)[-1])


def _ms(p: Place) -> Array:
    at = _window(p)
    return np.asarray((np.arange(p.along.shape[1])[at] - _begun(p)) * p.tick_s * 1e3, np.float64)


def _step(p: Place, plan: Plan) -> Figure:
    at, t, rise = _window(p), _ms(p), p.estimates["rise_time"]
    d, q = p.along.mean(axis=0)[at], p.across.mean(axis=0)[at]
    begun = np.flatnonzero(d < 0.01)
    start = float(t[begun[-1]]) if len(begun) else float(t[0])
    size = plan.size_A
    reference = Series(
        "reference", np.array([t[0], start, start, t[-1]]), size * np.array([0.0, 0.0, 1.0, 1.0]), "guide"
    )
    below = Figure(
        f"across-{p.name}", "", "", "time / ms", f"{p.step.across} / mA", (Series("across", t, 1e3 * size * q),)
    )
    return Figure(
        f"step-{p.name}", f"Large step at {p.name}",
        f"Mean of {len(p.along)} steps of {size:g} A, time from where the current begins to move. 10 to 90 % takes "
        f"{rise.value * 1e3:.4g} ms. Below, the current across, less that before the step.",
        "time / ms", f"{p.step.along} / A", (Series("along", t, size * d), reference),
        lines=(("10 %", 0.1 * size), ("90 %", 0.9 * size)), below=below,
    )  # fmt: skip


def _bridges(p: Place) -> list[Figure]:
    if not p.step.currents:
        return []
    at, t, limits = _window(p), _ms(p), p.limits["large"]
    first = next(iter(zip(p.large, p.edges["large"], strict=True)))
    taken, edge = first[0], first[1][0]
    rows = slice(edge.at - p.lead + at.start, edge.at - p.lead + at.stop)
    size = fit.amplitude(taken.currents - taken.currents[:, : edge.at - p.lead].mean(axis=1, keepdims=True))[rows]
    below = None
    if len(taken.voltages) and limits.voltage == limits.voltage:
        inductance = limits.inductance
        sent = fit.given(taken.voltages, taken.currents, inductance, taken.tick_s)[:, rows]
        half = limits.voltage_limit
        ends = () if half != half else (("half of the supply", half), ("less half of it", -half))
        names = [Series("half-bridges", t[: sent.shape[1]], v) for v in sent]
        below = Figure(f"voltages-{p.name}", "", "", "time / ms", "given / V", tuple(names), lines=ends)
    lines = () if limits.current_limit != limits.current_limit else (("limit of the controller", limits.current_limit),)
    caption = (
        "Amplitude of the inductor currents of the half-bridges in the first large step, their offsets taken off. Below, what "
        "each gives: the voltage behind its filter and the slope of its current times the stated filter inductance."
    )
    return [
        Figure(f"bridges-{p.name}", f"Half-bridges at {p.name}", caption, "time / ms", "inductor current / A",
               (Series("amplitude", t, size),), lines=lines, below=below)
    ]  # fmt: skip


def _band(places: Sequence[Place], plan: Plan) -> Figure:
    series, marks = [], []
    for p in places:
        band = p.estimates["bandwidth_small"].value
        hz = np.geomspace(band / 20, band * 4, 200)
        series.append(Series(p.name, hz / 1e3, np.abs(fit.gains(p.small, hz, p.tick_s))))
        marks.append(Series("−3 dB", np.array([band / 1e3]), np.array([fit.MINUS_3_DB]), "mark"))
    both = tuple(s for pair in zip(series, marks, strict=True) for s in pair)
    return Figure(
        "small", "Small signal over frequency",
        f"Fourier transform of the derivative of the response to steps of {plan.small_A:g} A, mean of "
        f"{plan.small_repeats} up and back. What a rise time says as 1/(3 t_r), and the bandwidth by design, are others.",
        "frequency / kHz", "gain / 1", both, lines=(("−3 dB", fit.MINUS_3_DB),), log_x=True, log_y=True,
    )  # fmt: skip
