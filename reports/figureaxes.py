"""Axes of a figure: labels, ticks, levels; plain ones and polar ones."""

from __future__ import annotations

from textwrap import shorten
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, MaxNLocator, MultipleLocator, NullFormatter

from bench.figures import Figure, Series
from reports import text
from reports.figurestyle import GRID, INK, tick_text

FEW_DECADES = 2.0  # a logarithmic axis that spans fewer has numbers at 2 and 5 too


def named(label: str) -> str:
    """A label that fits its legend line; a leading underscore would hide it from the legend."""
    return shorten(text.prose(label), 48, placeholder="…").lstrip("_") or "series"


def _line_style(position: int) -> dict[str, Any]:
    return {"color": INK, "linestyle": ("--", ":", "-.")[position % 3], "linewidth": 0.8}


def plain(axes: Axes, figure: Figure) -> list[Artist]:
    axes.set_xlabel(shorten(text.prose(figure.x_label), 56, placeholder="…"))
    axes.set_ylabel(shorten(text.prose(figure.y_label), 40, placeholder="…"))
    axes.grid(True, color=GRID, linewidth=0.5)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.margins(x=0.04, y=0.08)
    if figure.kind == "plane":
        axes.set_aspect("equal", adjustable="datalim")
    if figure.log_x:
        axes.set_xscale("log")
    if figure.downward:
        axes.invert_yaxis()
    if figure.log_y:
        axes.set_yscale("log")
    for axis, log in ((axes.xaxis, figure.log_x), (axes.yaxis, figure.log_y)):
        if not log:
            axis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 2.5, 5, 10]))
        axis.set_major_formatter(tick_text())
        if log:
            _decades(axis)
    if figure.ticks:
        axes.set_xticks([x for _, x in figure.ticks], [label for label, _ in figure.ticks])
    if figure.y_ticks:
        axes.set_yticks([y for _, y in figure.y_ticks], [label for label, _ in figure.y_ticks])
    if figure.below is not None and figure.below.downward:
        axes.set_ylim(bottom=0)  # the amplitude over its lag
    for axis, label in ((axes.xaxis, figure.x_label), (axes.yaxis, figure.y_label)):
        _degrees(axis, label)
    return [
        axes.axhline(level, label=named(label), **_line_style(position))
        for position, (label, level) in enumerate(figure.lines)
    ]


def _decades(axis: Any) -> None:
    """Numbers of a logarithmic axis: at the decades, and between them where there are few; none at what is between those."""
    low, high = np.log10(np.clip(axis.get_view_interval(), 1e-300, None))
    if abs(high - low) < FEW_DECADES:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(tick_text())
    axis.set_minor_formatter(NullFormatter())


def _degrees(axis: Any, label: str) -> None:
    """Angles over half a turn and more have their ticks at quarters of it."""
    span = float(np.ptp(axis.get_view_interval()))
    if label.endswith("(°)") and span >= 150:
        axis.set_major_locator(MultipleLocator(45 if span < 200 else 90 if span < 600 else 180))


def polar(axes: Any, figure: Figure, dense: list[Series]) -> list[Artist]:
    """The radial axis spans the data, not zero: what matters around a turn is the variation."""
    ys = [y for s in dense for u in (0.0 if s.u is None else s.u,) for y in (s.y - u, s.y + u) if s.y.size]
    values = np.concatenate([*ys, [level for _, level in figure.lines]]) if ys or figure.lines else np.zeros(1)
    low, high = float(np.min(values)), float(np.max(values))
    span = (high - low) or abs(high) or 1.0
    axes.set_rlim(low - 0.6 * span, high + 0.1 * span)
    axes.yaxis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_formatter(tick_text())
    axes.set_rlabel_position(67.5)
    for number in axes.get_yticklabels():  # readable where a curve passes behind
        number.set_bbox({"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6})
    axes.set_xlabel(f"angle: {figure.x_label}\nradius: {figure.y_label}")
    axes.grid(True, color=GRID, linewidth=0.5)
    axes.spines["polar"].set_color(GRID)
    turn = np.linspace(0, 2 * np.pi, 181)
    return [
        axes.plot(turn, np.full(turn.size, level), label=named(label), **_line_style(position))[0]
        for position, (label, level) in enumerate(figure.lines)
    ]
