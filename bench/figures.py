"""Figures and tables as data: a procedure says what to show, `reports` shows it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Series:
    """One curve or cloud of points. `u` draws 95 % error bars of half-length `u` on y.

    "faint" is a thin grey curve, "ridge" a thin one that hides what is behind and below it, "guide" a dashed curve in ink for
    limits and circles, "mark" filled dots in the colour of the curve before, "box" open squares in ink about points. What has
    no `label` is not in the legend.
    """

    label: str
    x: Array
    y: Array
    style: Literal["line", "points", "both", "faint", "ridge", "guide", "mark", "box"] = "line"
    u: Array | None = None


@dataclass(frozen=True)
class Grid:
    """Values (rows, columns) in colours, over columns at `x` and rows at `y`; NaN is left blank. `label` names them with
    their unit; `decades`, over how many the colours go down logarithmically from the greatest, 0 for a linear scale."""

    x: Array
    y: Array
    values: Array
    label: str
    decades: float = 0.0


@dataclass(frozen=True)
class Figure:
    """One figure: `kind` "xy", "plane" (xy with equal scales), "polar" with x an angle in rad, or "vectors" (polar from zero, x
    a phase lag in rad, against the rotation: clockwise from the top). Values are in the units that the labels name."""

    key: str  # file-safe, unique in a report
    title: str
    caption: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    kind: Literal["xy", "plane", "polar", "vectors"] = "xy"
    lines: tuple[tuple[str, float], ...] = field(default=())  # horizontal lines: label, y
    bands: tuple[tuple[str, float, float], ...] = field(default=())  # shaded from y to y, best first: label, low, high
    notes: tuple[tuple[str, float, float], ...] = field(default=())  # small texts beside a point: text, x, y
    grid: Grid | None = None
    log_x: bool = False
    log_y: bool = False
    ticks: tuple[tuple[str, float], ...] = field(default=())  # names in place of numbers on the x axis: text, x
    y_ticks: tuple[tuple[str, float], ...] = field(default=())  # the same on the y axis
    downward: bool = False  # y grows downwards, as phase lags are drawn
    closer: tuple[float, float, float] | None = None  # of a plane: beside it the same, about x, y and so far each way
    below: Figure | None = None  # a second panel on the same x axis, of which labels, series and the like are drawn


@dataclass(frozen=True)
class Sheet:
    """A table of finished texts for page 1, such as the weights of a correction; `numeric` columns are set flush right."""

    key: str  # unique in a report
    title: str
    caption: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numeric: tuple[int, ...] = ()


Shown = Figure | Sheet
