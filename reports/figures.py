"""Draws `bench.figures.Figure` as SVG, for both outputs, at the width it is printed (half of an A4 text block).

No pyplot (it costs half a second and keeps global state). Labels are plain text, so `$` is a dollar; only symbols with a
subscript are set as such.
Equal figures give equal bytes.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure as Canvas
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator

from bench.errors import BenchError
from bench.figures import Array, Figure, Series
from reports import figureaxes as axes_of
from reports import figurekinds as kinds
from reports import text
from reports.figurestyle import DASHES, INK, MARKERS, PALETTE, STYLE

WIDTH_IN, HEIGHT_IN = 3.42, 2.75  # 87 mm: half of the A4 text block
BARS = "Error bars are 95 % intervals."
MAX_LINE_POINTS = 1200  # about three per printed dot column at 300 dpi; beyond, min and max per bin


@dataclass(frozen=True)
class Drawn:
    """A drawn figure: SVG text whose ids all start with the figure's key, with its title and caption."""

    key: str
    title: str
    caption: str
    svg: str


def draw(figure: Figure, height: float = 1.0) -> Drawn:
    """The figure as SVG; `height` is that of its panels over the usual one, with letters as large.

    Raises:
        BenchError: a series has x, y or u of different lengths, or cannot be drawn.
    """
    for panel in _panels(figure):
        for series in panel.series:
            _same_length(panel, series)
    with warnings.catch_warnings(), mpl.rc_context(STYLE):
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")  # a box in a label, not a failed report
        try:
            svg = _svg(figure, height)
        except (ValueError, TypeError, OverflowError) as error:
            raise BenchError(f"figure {figure.key!r} cannot be drawn: {error}") from error
    return Drawn(figure.key, figure.title, _caption(figure), _with_own_ids(svg, figure.key))


def _caption(figure: Figure) -> str:
    """With what its error bars are, where it has any and its own words do not say so."""
    drawn = any(s.u is not None and bool((np.abs(s.u) > 0).any()) for panel in _panels(figure) for s in panel.series)
    told = any(words in figure.caption for words in ("95 % interval", "bars"))
    return f"{figure.caption} {BARS}" if drawn and not told else figure.caption


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


def _svg(figure: Figure, height: float) -> str:
    panels = _panels(figure)
    around = figure.kind in ("polar", "vectors")
    if figure.closer is not None:
        return _beside(figure, figure.closer, height)
    size = (WIDTH_IN, height * HEIGHT_IN * (1 + 0.45 * (len(panels) - 1)) + (0.45 if around else 0.0))
    canvas = Canvas(figsize=size, layout="constrained")
    FigureCanvasSVG(canvas)
    every = [
        canvas.add_subplot(len(panels), 1, k + 1, projection="polar" if around else None) for k in range(len(panels))
    ]
    drawn: list[Artist] = []
    for axes, panel in zip(every, panels, strict=True):
        artists = _panel(axes, panel)
        if not drawn:
            drawn += artists
        elif {str(a.get_label()) for a in artists} - {str(a.get_label()) for a in drawn}:
            _own_legend(axes, artists)
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


def _beside(figure: Figure, closer: tuple[float, float, float], height: float) -> str:
    """A plane, and beside it the part of it that is too small to be seen there."""
    canvas = Canvas(figsize=(WIDTH_IN, 0.8 * max(height, 0.9) * HEIGHT_IN), layout="constrained")
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
    for said in canvas.findobj(Text):
        _set_symbols(said)
    out = io.StringIO()
    canvas.savefig(out, format="svg", dpi=220, metadata={"Date": None, "Creator": None})
    return out.getvalue()


def _set_symbols(said: Any) -> None:
    """A letter with its subscript in place of `D_max`; everything else of a text stays as it is."""
    parts = text.symbols(said.get_text())
    if not any(below for _, below in parts):
        return
    said.set_parse_math(True)
    said.set_text(
        "".join(f"${part}_\\mathrm{{{below}}}$" if below else part.replace("$", r"\$") for part, below in parts)
    )


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
        drawn += axes_of.polar(axes, figure, dense)
    elif figure.kind == "vectors":
        kinds.vector_axes(axes, figure, dense)
    else:
        drawn += axes_of.plain(axes, figure)
        drawn += kinds.bands(axes, figure)
    kinds.notes(axes, figure)
    if not any(s.x.size for s in dense) and figure.grid is None:
        axes.text(0.5, 0.5, "no data", transform=axes.transAxes, ha="center", va="center", color=INK)
    told = [(d, s) for s, look, d in zip(dense, looks, drawn, strict=False) if s.style != "ridge" and "fit" not in look]
    shown = [d for d, s in told if s.label]
    return shown + drawn[len(dense) :]


def _looks(dense: list[Series]) -> list[dict[str, Any]]:
    """Of each series: curves take the colours in turn, marks that of the curve before, guides, boxes and ridges ink."""
    curves = [s for s in dense if s.style not in kinds.SPECIAL and _fitted(s, dense) is None]
    looks: list[dict[str, Any]] = []
    taken = 0
    for series in dense:
        of = _fitted(series, dense[: len(looks)])
        if series.style in ("faint", "guide", "box", "ridge"):
            looks.append({"color": INK, "marker": ""})
        elif of is not None:
            looks.append({**looks[of], "fit": True})
        elif series.style == "mark":
            looks.append({**_look(max(taken - 1, 0), len(curves)), "marker": "o"})
        else:
            looks.append(_look(taken, len(curves)))
            taken += 1
    lines = [look for series, look in zip(dense, looks, strict=True) if series.style == "line" and "fit" not in look]
    for k, look in enumerate(lines if len(curves) <= len(PALETTE) else ()):
        look["dashes"] = DASHES[k % len(DASHES)]  # colours alone look alike in grey print
    return looks


def _fitted(series: Series, before: Sequence[Series]) -> int | None:
    """Of the points that a line was fitted to, by labels: `3 A` and `3 A, fit`. It looks like them and needs no legend."""
    labels = [s.label if s.style == "points" else None for s in before]
    stem = series.label.removesuffix(" fit").removesuffix(",")
    return labels.index(stem) if series.style == "line" and stem != series.label and stem in labels else None


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
        return kinds.special(axes, series, look, position, axes_of.named(series.label))
    face = {} if series.style == "line" else {"markerfacecolor": "white", "markeredgewidth": 0.9}
    style = {
        "linestyle": "none" if series.style == "points" else look.get("dashes", "-"),
        "marker": "" if series.style == "line" else look["marker"],
        "color": look["color"],
        "label": axes_of.named(series.label),
        **face,
    }
    if series.u is None:
        return axes.plot(series.x, series.y, **style)[0]
    u = np.where(np.isfinite(series.u), np.abs(series.u), 0.0)
    return axes.errorbar(series.x, series.y, yerr=u, elinewidth=0.8, capsize=2.0, capthick=0.8, **style)  # type: ignore[return-value]


def _legend(canvas: Canvas, drawn: list[Artist]) -> None:
    """Under the axes, so that it never covers data; as many columns as the labels allow. None for a single series."""
    if len(drawn) < 2:
        return
    longest = max(len(str(artist.get_label())) for artist in drawn)
    columns = max(1, min(len(drawn), 56 // (longest + 7)))
    canvas.legend(handles=drawn, loc="outside lower center", ncols=columns, handlelength=1.8, columnspacing=1.2)


def _own_legend(axes: Axes, drawn: list[Artist]) -> None:
    """Within a panel that shows something else than the one above, where it covers least."""
    if len(drawn) > 1:
        axes.legend(handles=drawn, loc="best", ncols=2, handlelength=1.8, columnspacing=1.2)


def _with_own_ids(svg: str, key: str) -> str:
    """The drawing alone, with ids of its own: several stand in one HTML page."""
    body = svg[svg.index("<svg") :]
    own = re.sub(r"[^A-Za-z0-9_-]", "-", key)
    body = re.sub(r'\bid="', f'id="{own}-', body)
    body = re.sub(r"url\(#", f"url(#{own}-", body)
    return re.sub(r'href="#', f'href="#{own}-', body)
