"""The standard's diagram: deviations over targets, up and down, their means and two standard deviations either way."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from bench.figures import Figure, Series, Sheet, Shown
from bench.rigfile.model import RigFile
from procedures.positioning.estimates import Result
from procedures.positioning.standard import DOWN, UP, Array, by_target

WAYS = ((UP, "up"), (DOWN, "down"))


def all_figures(results: Sequence[Result], rig: RigFile) -> Iterator[Shown]:
    """Of each axis the diagram, then readings over time, then what the figures are."""
    del rig
    yield from (_diagram(r) for r in results)
    yield from (_over_time(r) for r in results)
    yield from (_sheet(r) for r in results)


def _scales(r: Result) -> tuple[float, str, float, str]:
    return (1e3, "mm", 1e6, "µm") if r.unit == "m" else (180 / math.pi, "°", 180 / math.pi, "°")


def _diagram(r: Result) -> Figure:
    far, place, near, small = _scales(r)
    t, at = by_target(r.deviations), r.taken.tested.at * far
    n, aside = r.deviations.shape[-1], 0.008 * float(np.ptp(at))
    series = []
    for way, name in WAYS:
        shift = aside if way == UP else -aside
        x = np.repeat(at + shift, n)
        series.append(Series(f"mean {name}", at + shift, t.mean[way] * near, "both"))
        series.append(Series(f"x_ij {name}", x, r.deviations[way].ravel() * near, "points"))
        series += [Series("", at + shift, (t.mean[way] + k * t.s[way]) * near, "faint") for k in (2, -2)]
    series.append(Series("mean of both", at, t.mean.mean(axis=0) * near, "guide"))
    low, high = float((t.mean - 2 * t.s).min()) * near, float((t.mean + 2 * t.s).max()) * near
    caption = (f"Deviations of axis {r.name} from its targets by {r.taken.tested.by.instrument}, about the mean of all: each "
               "approach, means each way, and ±2 s as thin lines. A is from the lowest to the highest of these, E and M are "
               "those of the means. Ways stand a little aside, so that both show.")  # fmt: skip
    return Figure(f"deviations-{r.name}", f"Deviations by target, {r.name}", caption, f"target / {place}",
                  f"deviation / {small}", tuple(series), lines=(("A, from", low), ("A, to", high)))  # fmt: skip


def _over_time(r: Result) -> Figure:
    _, _, near, small = _scales(r)
    off: Array = r.deviations - r.deviations.mean(axis=-1, keepdims=True)
    series = []
    for way, name in WAYS:
        order = np.argsort(r.taken.times[way].ravel())
        series.append(Series(name, r.taken.times[way].ravel()[order], off[way].ravel()[order] * near, "points"))
    caption = (
        "Each reading less the mean of its target and way, over the time of the run: what warms or slips goes one way."
    )
    return Figure(f"run-{r.name}", f"Readings over the run, {r.name}", caption, "time / s", f"off the mean / {small}",
                  tuple(series))  # fmt: skip


def _sheet(r: Result) -> Sheet:
    far, place, near, small = _scales(r)
    digits = 4 if small == "°" else 2
    t = by_target(r.deviations)
    columns = (*t.mean, *t.s, t.reversal, t.repeatability)
    rows = tuple(
        (f"{p * far:.6g}", *(f"{c[k] * near:z.{digits}f}" for c in columns))
        for k, p in enumerate(r.taken.tested.at.tolist())
    )
    caption = f"By target: place in {place}, all others in {small}."
    header = ("P_i", "mean up", "mean down", "s up", "s down", "B_i", "R_i")
    return Sheet(f"targets-{r.name}", f"Targets of {r.name}", caption, header, rows, tuple(range(7)))
