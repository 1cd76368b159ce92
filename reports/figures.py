"""Draws `bench.figures.Figure` as SVG, for both outputs, at the width it is printed (half of an A4 text block).

No pyplot (it costs half a second and keeps global state) and no mathtext: labels are plain text, so `$` is a dollar.
Equal figures give equal bytes.
"""

from __future__ import annotations

import io
import re
import warnings
from dataclasses import dataclass, replace
from textwrap import shorten
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure as Canvas
from matplotlib.ticker import MaxNLocator, MultipleLocator

from bench.errors import BenchError
from bench.figures import Array, Figure, Series
from reports import figurekinds as kinds
from reports.figurestyle import GRID, INK, MARKERS, PALETTE, STYLE, tick_text

WIDTH_IN, HEIGHT_IN = 3.42, 2.75  # 87 mm: half of the A4 text block
MAX_LINE_POINTS = 1200  # about three per printed dot column at 300 dpi; beyond, min and max per bin


@dataclass(frozen=True)
class Drawn:
    """A drawn figure: SVG text whose ids all start with the figure's key, with its title and caption."""

    key: str
    title: str
    caption: str
    svg: str


def draw(figure: Figure) -> Drawn:
    """The figure as SVG.

    Raises:
        BenchError: a series has x, y or u of different lengths, or cannot be drawn.
    """
    for panel in _panels(figure):
        for series in panel.series:
            _same_length(panel, series)
    with warnings.catch_warnings(), mpl.rc_context(STYLE):
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")  # a box in a label, not a failed report
        try:
            svg = _svg(figure)
        except (ValueError, TypeError, OverflowError) as error:
            raise BenchError(f"figure {figure.key!r} cannot be drawn: {error}") from error
    return Drawn(figure.key, figure.title, figure.caption, _with_own_ids(svg, figure.key))


def _same_length(figure: Figure, series: Series) -> None:
    lengths = {"x": np.size(series.x), "y": np.size(series.y)}
    if series.u is not None:
        lengths["u"] = np.size(series.u)
    if len(set(lengths.values())) > 1:
        raise BenchError(
            f"figure {figure.key!r}, series {series.label!r}: found lengths {lengths}; expected equal ones"
        )


def _panels(figure: Figure) -> list[Figure]:
    """The figure and those below it."""
    return [figure, *(_panels(figure.below) if figure.below else [])]


def _svg(figure: Figure) -> str:
    panels = _panels(figure)
    around = figure.kind in ("polar", "vectors")
    if figure.closer is not None:
        return _beside(figure, figure.closer)
    size = (WIDTH_IN, HEIGHT_IN * (1 + 0.45 * (len(panels) - 1)) + (0.45 if around else 0.0))
    canvas = Canvas(figsize=size, layout="constrained")
    FigureCanvasSVG(canvas)
    every = [
        canvas.add_subplot(len(panels), 1, k + 1, projection="polar" if around else None) for k in range(len(panels))
    ]
    drawn: list[Artist] = []
    for axes, panel in zip(every, panels, strict=True):
        artists = _panel(axes, panel)
        drawn += [] if drawn else artists
        if panel.below:
            axes.tick_params(labelbottom=False)
            axes.set_xlabel("")
            if not panel.log_x:
                axes.sharex(every[-1])
    for axes, panel in zip(every[:-1], panels[:-1], strict=True):
        if panel.log_x:  # an axis that is not drawn yet has a range that a logarithm does not
            axes.sharex(every[-1])
    _legend(canvas, drawn)
    return _saved(canvas)


def _beside(figure: Figure, closer: tuple[float, float, float]) -> str:
    """A plane, and beside it the part of it that is too small to be seen there."""
    canvas = Canvas(figsize=(WIDTH_IN, 0.8 * HEIGHT_IN), layout="constrained")
    FigureCanvasSVG(canvas)
    whole, near = canvas.add_subplot(1, 2, 1), canvas.add_subplot(1, 2, 2)
    drawn = _panel(whole, figure)
    _panel(near, replace(figure, notes=()))
    x, y, reach = closer
    near.set_xlim(x - reach, x + reach)
    near.set_ylim(y - reach, y + reach)
    near.set_ylabel("")
    for axes in (whole, near):
        axes.set_aspect("equal", adjustable="box")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 2.5, 5, 10]))
    _legend(canvas, drawn)
    return _saved(canvas)


def _saved(canvas: Canvas) -> str:
    out = io.StringIO()
    canvas.savefig(out, format="svg", dpi=220, metadata={"Date": None, "Creator": None})
    return out.getvalue()


def _panel(axes: Axes, figure: Figure) -> list[Artist]:
    """Draws one panel; what stands in the legend."""
    polar = figure.kind == "polar"
    dense = [_finite(s) for s in figure.series]
    looks = _looks(dense)
    drawn = [
        _plot(axes, _closed(series) if polar else series, look, position)
        for position, (series, look) in enumerate(zip(dense, looks, strict=True))
    ]
    if figure.grid is not None:
        kinds.grid(axes, figure.grid)
    if polar:
        drawn += _polar_axes(axes, figure, dense)
    elif figure.kind == "vectors":
        kinds.vector_axes(axes, figure, dense)
    else:
        drawn += _plain_axes(axes, figure)
        drawn += kinds.bands(axes, figure)
    kinds.notes(axes, figure)
    if not any(s.x.size for s in dense) and figure.grid is None:
        axes.text(0.5, 0.5, "no data", transform=axes.transAxes, ha="center", va="center", color=INK)
    return [d for s, d in zip(dense, drawn, strict=False) if s.style != "ridge"] + drawn[len(dense) :]


def _looks(dense: list[Series]) -> list[dict[str, Any]]:
    """Of each series: curves take the colours in turn, marks that of the curve before, guides and ridges ink."""
    curves = [s for s in dense if s.style not in kinds.SPECIAL]
    looks: list[dict[str, Any]] = []
    taken = 0
    for series in dense:
        if series.style in ("faint", "guide", "ridge"):
            looks.append({"color": INK, "marker": ""})
        elif series.style == "mark":
            looks.append({**_look(max(taken - 1, 0), len(curves)), "marker": "o"})
        else:
            looks.append(_look(taken, len(curves)))
            taken += 1
    return looks


def _look(position: int, count: int) -> dict[str, Any]:
    """Colour and marker of a series: seven distinct colours, beyond that an ordered scale."""
    marker = MARKERS[position % len(MARKERS)]
    if count <= len(PALETTE):
        return {"color": PALETTE[position], "marker": marker}
    return {"color": mpl.colormaps["viridis"](0.92 * position / (count - 1)), "marker": marker}


def _finite(series: Series) -> Series:
    """The series without points that are not finite, long lines reduced to their envelope."""
    x, y = np.asarray(series.x, np.float64), np.asarray(series.y, np.float64)
    u = None if series.u is None else np.asarray(series.u, np.float64)
    keep = np.isfinite(x) & np.isfinite(y)
    x, y, u = x[keep], y[keep], None if u is None else u[keep]
    if x.size > MAX_LINE_POINTS and u is None:
        x, y = envelope(x, y, MAX_LINE_POINTS)
    return Series(series.label, x, y, series.style, u)


def envelope(x: Array, y: Array, points: int) -> tuple[Array, Array]:
    """At most `points` of the curve: per bin of samples its least and its greatest y, in their order.

    Every extreme that a full plot would show is kept, which plain thinning does not promise.
    """
    bins = points // 2
    edges = np.linspace(0, y.size, bins + 1).astype(np.intp)
    starts = edges[:-1]
    bin_of = np.repeat(np.arange(bins), np.diff(edges))
    order = np.lexsort((y, bin_of))
    lowest, highest = order[starts], order[edges[1:] - 1]
    chosen = np.unique(np.concatenate([lowest, highest]))
    return x[chosen], y[chosen]


def _closed(series: Series) -> Series:
    """A line all around the circle ends where it began."""
    x = series.x
    if series.style == "points" or x.size < 3:
        return series
    step = float(np.max(np.diff(x), initial=0.0))
    if not 0 < 2 * np.pi - (x[-1] - x[0]) <= 1.5 * step:
        return series
    u = None if series.u is None else np.append(series.u, series.u[0])
    return Series(series.label, np.append(x, x[0] + 2 * np.pi), np.append(series.y, series.y[0]), series.style, u)


def _plot(axes: Axes, series: Series, look: dict[str, Any], position: int = 0) -> Artist:
    """Draws one series and returns what stands for it in the legend."""
    if series.style in kinds.SPECIAL:
        return kinds.special(axes, series, look, position, _short(series.label))
    face = {} if series.style == "line" else {"markerfacecolor": "white", "markeredgewidth": 0.9}
    style = {
        "linestyle": "none" if series.style == "points" else "-",
        "marker": "" if series.style == "line" else look["marker"],
        "color": look["color"],
        "label": _short(series.label),
        **face,
    }
    if series.u is None:
        return axes.plot(series.x, series.y, **style)[0]
    u = np.where(np.isfinite(series.u), np.abs(series.u), 0.0)
    return axes.errorbar(series.x, series.y, yerr=u, elinewidth=0.8, capsize=2.0, capthick=0.8, **style)  # type: ignore[return-value]


def _short(label: str) -> str:
    """A label that fits its legend line; a leading underscore would hide it from the legend."""
    return shorten(label, 48, placeholder="…").lstrip("_") or "series"


def _line_style(position: int) -> dict[str, Any]:
    return {"color": INK, "linestyle": ("--", ":", "-.")[position % 3], "linewidth": 0.8}


def _plain_axes(axes: Axes, figure: Figure) -> list[Artist]:
    axes.set_xlabel(shorten(figure.x_label, 56, placeholder="…"))
    axes.set_ylabel(shorten(figure.y_label, 40, placeholder="…"))
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
    if figure.ticks:
        axes.set_xticks([x for _, x in figure.ticks], [label for label, _ in figure.ticks])
    if figure.below is not None and figure.below.downward:
        axes.set_ylim(bottom=0)  # the amplitude over its lag
    for axis, label in ((axes.xaxis, figure.x_label), (axes.yaxis, figure.y_label)):
        _degrees(axis, label)
    return [
        axes.axhline(level, label=_short(label), **_line_style(position))
        for position, (label, level) in enumerate(figure.lines)
    ]


def _degrees(axis: Any, label: str) -> None:
    """Angles over half a turn and more have their ticks at quarters of it."""
    span = float(np.ptp(axis.get_view_interval()))
    if label.endswith("(°)") and span >= 150:
        axis.set_major_locator(MultipleLocator(45 if span < 200 else 90 if span < 600 else 180))


def _polar_axes(axes: Any, figure: Figure, dense: list[Series]) -> list[Artist]:
    """The radial axis spans the data, not zero: what matters around a turn is the variation."""
    ys = [y for s in dense for u in (0.0 if s.u is None else s.u,) for y in (s.y - u, s.y + u) if s.y.size]
    values = np.concatenate([*ys, [level for _, level in figure.lines]]) if ys or figure.lines else np.zeros(1)
    low, high = float(np.min(values)), float(np.max(values))
    span = (high - low) or abs(high) or 1.0
    axes.set_rlim(low - 0.6 * span, high + 0.1 * span)
    axes.yaxis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_formatter(tick_text())
    axes.set_rlabel_position(67.5)
    for text in axes.get_yticklabels():  # readable where a curve passes behind
        text.set_bbox({"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6})
    axes.set_xlabel(f"angle: {figure.x_label}\nradius: {figure.y_label}")
    axes.grid(True, color=GRID, linewidth=0.5)
    axes.spines["polar"].set_color(GRID)
    turn = np.linspace(0, 2 * np.pi, 181)
    return [
        axes.plot(turn, np.full(turn.size, level), label=_short(label), **_line_style(position))[0]
        for position, (label, level) in enumerate(figure.lines)
    ]


def _legend(canvas: Canvas, drawn: list[Artist]) -> None:
    """Under the axes, so that it never covers data; as many columns as the labels allow. None for a single series."""
    if len(drawn) < 2:
        return
    longest = max(len(str(artist.get_label())) for artist in drawn)
    columns = max(1, min(len(drawn), 56 // (longest + 7)))
    canvas.legend(handles=drawn, loc="outside lower center", ncols=columns, handlelength=1.8, columnspacing=1.2)


def _with_own_ids(svg: str, key: str) -> str:
    """The drawing alone, with ids of its own: several stand in one HTML page."""
    body = svg[svg.index("<svg") :]
    own = re.sub(r"[^A-Za-z0-9_-]", "-", key)
    body = re.sub(r'\bid="', f'id="{own}-', body)
    body = re.sub(r"url\(#", f"url(#{own}-", body)
    return re.sub(r'href="#', f'href="#{own}-', body)
