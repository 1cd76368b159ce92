"""What the zeros draw: of each motor the current across over that along the field."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from bench.figures import Figure, Series
from procedures.encoder_zero.estimates import At, Result
from procedures.encoder_zero.groups import ALONG
from procedures.encoder_zero.steps import Taken, column


def all_figures(results: Sequence[Result], taken: Sequence[Taken]) -> Iterator[Figure]:
    """In the order of the report."""
    for found in results:
        for motor in found.group.motors:
            yield _figure(found, motor, taken)


def _figure(found: Result, motor: str, taken: Sequence[Taken]) -> Figure:
    group = found.group
    series = []
    for k, at in enumerate(found.places):
        some = [t for t in taken if (t.motor, t.way, t.place, t.trial) == (motor, ALONG, k, "") and t.means is not None]
        x, y = np.array([(t.means[column(group, motor, ALONG)], t.means[column(group, motor, "")])  # type: ignore[index]
                         for t in some]).T  # fmt: skip
        ends = np.array([x.min(), x.max()])
        line = y.mean() + (ends - x.mean()) * _slope(at, motor)
        series += [Series(f"place {k + 1}", x, 1e3 * y, "points"), Series(f"line, place {k + 1}", ends, 1e3 * line)]
    zero = math.degrees(found.estimates["zero", motor].value)
    several = (
        " Others of its loop share the reference across, so that the slope is their part of it."
        if len(group.motors) > 1
        else ""
    )
    caption = f"Means of the currents of {motor} under each step, the mover held; zero {zero:.3f}° electrical.{several}"
    return Figure(f"zero-{motor}", f"Zero of {motor}", caption, "current along the field (A)", "current across (mA)",
                  tuple(series))  # fmt: skip


def _slope(at: At, motor: str) -> float:
    group = at.answers.group
    row = at.answers.rows.mean(axis=0)[group.stepped.index((motor, ALONG))]
    return float(row[column(group, motor, "") - 1] / row[column(group, motor, ALONG) - 1])
