"""Where phases draw the shaft: by alignment and side at the last level, and by the current."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from bench.figures import Figure, Series
from procedures.map_zero.estimates import Stator


def all_figures(found: Sequence[Stator]) -> Iterator[Figure]:
    """Alignments, then levels."""
    yield _alignments(found)
    yield _levels(found)


def _alignments(found: Sequence[Stator]) -> Figure:
    series, lines = [], []
    for s in found:
        angles = np.degrees(s.angles)
        order = np.argsort(angles)
        for label, each in (("from below", s.below), ("from above", s.above)):
            series.append(Series(f"{s.motor}, {label}", angles[order], np.degrees(each[order, -1]), "both"))
        lines.append((f"zero of {s.motor}", float(np.degrees(s.estimates["zero"].value))))
    caption = "What the encoder reads at the last level, less where the phase should be aligned. Between the sides is friction."
    return Figure("alignments", "Where phases draw the shaft", caption, "angle / °", "reading less aligned / °", tuple(series),
                  lines=tuple(lines))  # fmt: skip


def _levels(found: Sequence[Stator]) -> Figure:
    series = []
    for s in found:
        for label, each in (("from below", s.below), ("from above", s.above), ("mean of both", s.means)):
            series.append(Series(f"{s.motor}, {label}", s.levels, np.degrees(each.mean(axis=0)), "both"))
    caption = (
        "Mean of all alignments by the current: what friction leaves falls with the torque's stiffness, the mean stays."
    )
    return Figure("levels", "By the current", caption, "current / A", "reading less aligned / °", tuple(series))
