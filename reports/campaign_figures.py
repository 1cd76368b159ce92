"""The figures of a campaign's summary, as SVG in the style of the reports' other figures."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure as Canvas

from reports.campaign_symbols import axis_label as label
from reports.figures import Drawn, _with_own_ids
from reports.figurestyle import GRID, INK, PALETTE, STYLE

Array = npt.NDArray[np.float64]
WIDE_IN = 6.85  # 174 mm: the A4 text block
PANEL_IN, BETWEEN_IN = 1.25, 0.32  # a row of small panels, and what lies between two of them
GOOD, BAD = "#0072B2", "#D55E00"
KINDS = {  # first part of an influence's identity -> legend, colour
    "sensors": ("sensors: gains and offsets", PALETTE[0]),
    "masses": ("masses, buoyancy", PALETTE[1]),
    "geometry": ("lengths, gap, stiffness", PALETTE[2]),
    "machine": ("machine: inertias, asymmetry", PALETTE[3]),
    "site": ("gravity, air", PALETTE[4]),
    "hook": ("seat of the hook", PALETTE[5]),
    "run": ("the runs: scatter, hysteresis", "#8a939d"),
}


@dataclass(frozen=True)
class Made:
    """A constant for the figure of uncertainties: relative expanded uncertainty, shares of the variance by kind."""

    name: str
    relative: float
    shares: Mapping[str, float]


@dataclass(frozen=True)
class Judged:
    """A quantity for the figures of many rigs; `ratios` are error over U by rig, U on the side towards the
    truth."""

    name: str
    judged: bool
    passed: bool
    coverage: float
    band: tuple[float, float]
    width: float | None
    width_range: tuple[float, float] | None
    seeds: Array
    ratios: Array
    holds: npt.NDArray[np.bool_]


def uncertainties(constants: Sequence[Made]) -> Drawn:
    """Relative uncertainty of every constant, and what it is made of."""

    def paint(canvas: Canvas) -> None:
        left, right = canvas.subplots(1, 2, sharey=True, width_ratios=(1, 1.6))
        y = np.arange(len(constants))[::-1]
        percent = np.array([100 * c.relative for c in constants])
        left.barh(y, percent, height=0.62, color=GOOD)
        _log_percent(left, percent)
        for at, value in zip(y, percent, strict=True):
            left.annotate(f"{value:.2g} %", (value, at), (2, 0), textcoords="offset points", va="center", fontsize=6.5)
        left.set_yticks(y, [label(c.name) for c in constants])
        left.set_xlabel("expanded uncertainty, % of the value")
        start = np.zeros(len(constants))
        for kind, (text, colour) in KINDS.items():
            part = np.array([100 * c.shares.get(kind, 0.0) for c in constants])
            if part.max(initial=0.0) >= 0.5:
                right.barh(y, part, height=0.62, left=start, color=colour, label=text, edgecolor="white", linewidth=0.4)
            start += part
        right.set_xlim(0, 100)
        right.set_xlabel("share of the variance, %")
        canvas.legend(*right.get_legend_handles_labels(), loc="outside lower center", ncols=4, handlelength=1.0)
        for axes in (left, right):
            _quiet(axes, "x")
            axes.set_ylim(-0.7, len(constants) - 0.3)

    return _drawn(
        "uncertainties", "What is known, and what limits it",
        "Left: expanded uncertainty of each constant relative to its value, on a logarithmic scale. Right: where its "
        "variance comes from. Influences that stand in the rig file are the same in every run of the chain.",
        (WIDE_IN, 1.0 + 0.19 * len(constants)), paint,
    )  # fmt: skip


def _log_percent(axes: Axes, percent: Array) -> None:
    positive = percent[percent > 0]
    if positive.size:
        axes.set_xscale("log")
        axes.set_xlim(10 ** math.floor(math.log10(positive.min())), positive.max() * 3.2)
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")


def correlations(names: Sequence[str], matrix: Sequence[Sequence[float]]) -> Drawn:
    """The correlation matrix as a map."""
    n = len(names)

    def paint(canvas: Canvas) -> None:
        axes = canvas.add_subplot()
        values = np.array(matrix, dtype=np.float64)
        axes.imshow(values, cmap="RdBu_r", vmin=-1, vmax=1)
        ticks = [label(name) for name in names]
        axes.set_xticks(range(n), ticks, rotation=90 if n > 12 else 0)
        axes.set_yticks(range(n), ticks)
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
        axes.set_xticks(np.arange(n + 1) - 0.5, minor=True)
        axes.set_yticks(np.arange(n + 1) - 0.5, minor=True)
        axes.grid(True, which="minor", color="white", linewidth=1.0)
        axes.tick_params(which="minor", length=0)
        for row in range(n):
            for column in range(n):
                value = values[row, column]
                if row != column and abs(value) >= 0.005:
                    axes.text(column, row, f"{value:.2f}".replace("0.", ".", 1).replace("-", "\u2212"), ha="center",
                              va="center", fontsize=6.2 if n <= 14 else 5.0,
                              color="white" if abs(value) > 0.6 else INK)  # fmt: skip

    return _drawn(
        "correlations", "Correlations along the chain",
        "Correlation coefficients between the constants, from the influences that they share; below 0.005 left empty. "
        "A model that uses several constants needs these: the full matrix is in model.json.",
        (WIDE_IN, min(WIDE_IN, 1.0 + 0.27 * n)), paint,
    )  # fmt: skip


def bands(rows: Sequence[Judged], rigs: int) -> Drawn:
    """Coverage and width of every quantity against their bands."""

    def paint(canvas: Canvas) -> None:
        left, right = canvas.subplots(1, 2, sharey=True)
        y = np.arange(len(rows))[::-1]
        low, high = rows[0].band
        left.axvspan(100 * low, 100 * high, color="#e3f0e8", zorder=0)
        left.axvline(95, color=INK, linewidth=0.7, linestyle="--")
        right.axvspan(0.8, 1.25, color="#e3f0e8", zorder=0)
        right.axvline(1.0, color=INK, linewidth=0.7, linestyle="--")
        most = 1.6
        for at, row in zip(y, rows, strict=True):
            face = {"color": GOOD if row.passed else BAD, "markerfacecolor": None if row.judged else "white"}
            left.plot(100 * row.coverage, at, "o", markersize=4.5, **face)
            if row.width is not None and row.width_range is not None:
                reach = [row.width_range[0], min(row.width_range[1], 3.0)]
                right.plot(reach, [at, at], color=face["color"], linewidth=1.2)
                right.plot(min(row.width, 3.0), at, "o", markersize=4.5, **face)
                most = max(most, min(row.width, 3.0) + 0.1)
        left.set_yticks(y, [label(r.name) for r in rows])
        span = max(100 * (high - low), 100 * (0.95 - min(r.coverage for r in rows)) + 2)
        left.set_xlim(max(-2, 95 - 1.25 * span), min(101.0, 95 + 1.25 * span))
        right.set_xlim(min(0.6, *(r.width for r in rows if r.width is not None), 0.6) - 0.05, most)
        left.set_xlabel("intervals that hold the truth, %")
        right.set_xlabel("1 / 95th percentile of |error|/U")
        for axes in (left, right):
            _quiet(axes, "x")
            axes.set_ylim(-0.7, len(rows) - 0.3)

    return _drawn(
        "bands", "Coverage and width against their bands",
        f"Left: coverage over {rigs} virtual rigs; the band is 0.95 ± 3.3 \u221a(0.95 \u00b7 0.05/N). Right: width of the "
        "intervals, with the 95 % range that so many rigs allow. Hollow: measured, but not judged.",
        (WIDE_IN, 0.8 + 0.21 * len(rows)), paint,
    )  # fmt: skip


def histograms(rows: Sequence[Judged]) -> Drawn:
    """Error over U of each quantity."""

    def paint(canvas: Canvas, panels: Sequence[Axes]) -> None:
        bins = 40 if len(rows[0].ratios) >= 200 else 20
        edges = [4 * k / bins - 2 for k in range(bins + 1)]
        middle = np.linspace(-2, 2, 201)
        for axes, row in zip(panels, rows, strict=False):
            shown = np.clip(row.ratios, -1.999, 1.999)
            axes.axvspan(-1, 1, color="#eef3f7", zorder=0)
            for some, colour in ((row.holds, GOOD), (~row.holds, BAD)):  # one outline, where `hist` makes a patch a bin
                axes.stairs(np.histogram(shown[some], edges)[0], edges, fill=True, color=colour)
            count = len(row.ratios) * (edges[1] - edges[0])
            axes.plot(middle, count * 1.96 / math.sqrt(2 * math.pi) * np.exp(-((1.96 * middle) ** 2) / 2), color=INK,
                      linewidth=0.8)  # fmt: skip
            axes.set_xlim(-2, 2)
            axes.set_title(f"{label(row.name)}   {100 * row.coverage:.1f} %", fontsize=7.5)

    return _multiples(
        "histograms", "Error over expanded uncertainty",
        "One panel for each quantity, with its coverage. U is the half width on the side towards the truth: within \u22121 and "
        "1 the interval holds it; misses are orange. The line is a normal distribution whose 95 % lies there.",
        rows, "error / U", "rigs", paint,
    )  # fmt: skip


def scatters(rows: Sequence[Judged]) -> Drawn:
    """Error over U by rig: a drift or a cluster shows here and not in a histogram."""

    seeds = np.concatenate([row.seeds for row in rows])
    first, last = float(seeds.min(initial=np.inf)), float(seeds.max(initial=-np.inf))
    beside = 0.05 * (last - first) or 0.5

    def paint(canvas: Canvas, panels: Sequence[Axes]) -> None:
        for axes, row in zip(panels, rows, strict=False):
            if len(seeds):
                axes.set_xlim(first - beside, last + beside)
            axes.axhspan(-1, 1, color="#eef3f7", zorder=0)
            shown = np.clip(row.ratios, -2.4, 2.4)
            size = 1.6 if len(row.seeds) > 200 else 2.6
            axes.plot(row.seeds[row.holds], shown[row.holds], "o", markersize=size, color=GOOD, markeredgewidth=0,
                      alpha=0.7)  # fmt: skip
            axes.plot(
                row.seeds[~row.holds], shown[~row.holds], "o", markersize=size + 0.8, color=BAD, markeredgewidth=0
            )
            axes.set_ylim(-2.5, 2.5)
            axes.set_title(label(row.name), fontsize=7.5)

    return _multiples(
        "scatters", "Error over expanded uncertainty, rig by rig",
        "Misses are orange; beyond \u00b12.4 drawn at the edge.", rows, "seed", "error / U", paint,
    )  # fmt: skip


def _multiples(
    key: str, title: str, caption: str, rows: Sequence[Judged], x: str, y: str,
    paint: Callable[[Canvas, Sequence[Axes]], None],
) -> Drawn:  # fmt: skip
    columns = min(4, len(rows))
    lines = math.ceil(len(rows) / columns)

    def whole(canvas: Canvas) -> None:
        panels: list[Axes] = list(
            canvas.subplots(lines, columns, squeeze=False).ravel()
        )  # shared axes cost their square
        _spread(canvas, lines, columns)
        paint(canvas, panels)
        for number, axes in enumerate(panels):
            if number >= len(rows):
                axes.set_visible(False)
                continue
            _quiet(axes, "y")
            axes.tick_params(labelbottom=number >= len(rows) - columns)
            if number >= len(rows) - columns:
                axes.set_xlabel(x)
            if number % columns == 0:
                axes.set_ylabel(y)

    return _drawn(key, title, caption, (WIDE_IN, 0.35 + PANEL_IN * lines), whole, layout=None)


def _spread(canvas: Canvas, lines: int, columns: int) -> None:
    """Panels of one size with room for their ticks and titles: matplotlib's own layout measures every letter of a hundred of
    them twice."""
    wide, high = canvas.get_size_inches()
    room = {"left": 0.5 / wide, "right": 1 - 0.08 / wide, "bottom": 0.42 / high, "top": 1 - 0.22 / high}
    across, down = (wide - 0.58) / columns, (high - 0.64) / lines
    canvas.subplots_adjust(**room, wspace=BETWEEN_IN / (across - BETWEEN_IN), hspace=BETWEEN_IN / (down - BETWEEN_IN))


def _quiet(axes: Axes, grid: Any) -> None:
    axes.grid(True, axis=grid, color=GRID, linewidth=0.5)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _drawn(
    key: str, title: str, caption: str, size: tuple[float, float], paint: Callable[[Canvas], None],
    layout: Literal["constrained"] | None = "constrained",
) -> Drawn:  # fmt: skip
    with mpl.rc_context({**STYLE, "text.parse_math": True, "mathtext.fontset": "dejavusans"}):
        canvas = Canvas(figsize=size, layout=layout)
        FigureCanvasSVG(canvas)
        paint(canvas)
        out = io.StringIO()
        canvas.savefig(out, format="svg", metadata={"Date": None, "Creator": None})
    return Drawn(key, title, caption, _with_own_ids(out.getvalue(), key))
