"""Figures as data: a procedure says what to draw, `reports` draws it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Series:
    """One curve or cloud of points. `u` draws 95 % error bars of half-length `u` on y."""

    label: str
    x: Array
    y: Array
    style: Literal["line", "points", "both"] = "line"
    u: Array | None = None


@dataclass(frozen=True)
class Figure:
    """One figure: `kind` "xy", "plane" (xy with equal scales), or "polar" with x an angle in rad. Values are in the units
    that the labels name."""

    key: str  # file-safe, unique in a report
    title: str
    caption: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    kind: Literal["xy", "plane", "polar"] = "xy"
    lines: tuple[tuple[str, float], ...] = field(default=())  # horizontal lines: label, y
