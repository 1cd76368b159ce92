"""What machine figures have beyond curves: maps, zones, ridges, marks, notes, and polar plots of vectors."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.ticker import MaxNLocator, NullFormatter

from bench.figures import Figure, Grid, Series
from reports.figurestyle import GRID, INK, tick_text

ZONES = ("#e4f2e7", "#fdf6d8", "#fde6cf", "#f8d4cf")  # best to worst, pale: curves stand out
COLOURS = "viridis"
SPECIAL = ("faint", "guide", "mark", "box", "ridge")
GREY = "#8b949e"


def special(axes: Axes, series: Series, look: dict[str, Any], position: int, label: str) -> Artist:
    """Draws a faint curve, a guide, a mark, a box or a ridge."""
    if series.style == "faint":
        return axes.plot(series.x, series.y, color=GREY, linewidth=0.5, label=label, zorder=1.9)[0]
    if series.style == "guide":
        return axes.plot(series.x, series.y, color=look["color"], linestyle=(0, (4, 3)), linewidth=0.6, label=label)[0]
    if series.style == "mark":
        return axes.plot(
            series.x, series.y, linestyle="none", marker="o", markersize=4.2, color=look["color"], label=label, zorder=5
        )[0]
    if series.style == "box":
        return axes.plot(series.x, series.y, linestyle="none", marker="s", markersize=8.5, markerfacecolor="none",
                         markeredgewidth=0.8, color=look["color"], label=label, zorder=5)[0]  # fmt: skip
    order = 2 + 0.001 * position
    if series.y.size:
        axes.fill_between(series.x, series.y, series.y.min(), color="white", linewidth=0, zorder=order)
    return axes.plot(series.x, series.y, color=look["color"], linewidth=0.5, label=label, zorder=order + 0.0005)[0]


def bands(axes: Axes, figure: Figure) -> list[Artist]:
    """Shaded bands behind the curves; the axis goes on to show where the worst begins, not to its end, and from where the best
    one begins, or from below a curve that goes farther down."""
    if not figure.bands:
        return []
    out: list[Artist] = []
    ys = [float(np.nanmax(s.y)) for s in figure.series if s.y.size]
    top = 1.12 * max([*ys, figure.bands[-1][1]])
    for k, (label, low, high) in enumerate(figure.bands):
        colour = ZONES[min(k, len(ZONES) - 1)]
        out.append(axes.axhspan(low, min(high, top), color=colour, linewidth=0, zorder=0, label=label))
    low = figure.bands[0][1]
    deepest = min([low, *(float(np.nanmin(s.y)) for s in figure.series if s.y.size)])
    axes.set_ylim(low if deepest == low else deepest - 0.06 * (top - deepest), top)
    return out


def notes(axes: Axes, figure: Figure) -> None:
    """Small texts a little right of and above their points."""
    for text, x, y in figure.notes:
        axes.annotate(
            text,
            (x, y),
            xytext=(2.5, 2.5),
            textcoords="offset points",
            fontsize=5.5,
            color=INK,
            zorder=6,
            annotation_clip=True,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 0.3},
        )


def grid(axes: Axes, found: Grid) -> None:
    """Values in colours with their scale beside them; an image within the drawing, for it has too many cells for shapes."""
    values = np.ma.masked_invalid(found.values)
    top = float(values.max()) if values.count() else 1.0
    low = top / 10**found.decades if found.decades else float(values.min()) if values.count() else 0.0
    norm = LogNorm(low, top) if found.decades and top > 0 else Normalize(low, top)
    if found.decades and top > 0:
        values = np.ma.maximum(values, low)
    mesh = axes.pcolormesh(found.x, found.y, values, cmap=COLOURS, norm=norm, shading="nearest", rasterized=True)
    bar = axes.figure.colorbar(mesh, ax=axes, pad=0.02, aspect=28)
    bar.set_label(found.label)
    bar.ax.yaxis.set_major_formatter(tick_text())
    bar.ax.yaxis.set_minor_formatter(NullFormatter())
    bar.outline.set_linewidth(0.4)


def vector_axes(axes: Any, figure: Figure, dense: list[Series]) -> None:
    """Polar axes from zero, lag clockwise from the top."""
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(-1)
    top = max((float(np.max(s.y)) for s in dense if s.y.size), default=1.0)
    axes.set_rlim(0, 1.08 * top if top > 0 else 1.0)
    axes.set_thetagrids(np.arange(0, 360, 30), [f"{k}°" for k in range(0, 360, 30)])
    axes.yaxis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_formatter(tick_text())
    axes.set_rlabel_position(_emptiest(dense))
    axes.set_xlabel(f"angle: {figure.x_label}\nradius: {figure.y_label}")
    axes.grid(True, color=GRID, linewidth=0.5)
    axes.spines["polar"].set_color(GRID)


def _emptiest(dense: list[Series]) -> float:
    """Where the numbers of the radial axis cover least of what is drawn, degrees."""
    candidates = np.arange(15.0, 360.0, 30.0)
    if not any(s.x.size for s in dense):
        return 157.5
    ways = [
        np.interp(np.linspace(0, 1, 400), np.linspace(0, 1, s.x.size), s.y * np.exp(1j * s.x))
        for s in dense
        if s.x.size
    ]
    drawn = np.concatenate(ways)
    rays = np.linspace(0.2, 1.0, 17) * float(np.abs(drawn).max())
    nearest = [np.abs(drawn[:, None] - rays * np.exp(1j * np.radians(c))).min(axis=0).clip(max=0.25 * rays[-1]).sum()
               for c in candidates]  # fmt: skip
    return float(candidates[int(np.argmax(nearest))])
