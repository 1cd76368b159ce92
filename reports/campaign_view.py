"""The view model of a campaign's summary: a head, and sections of tables and figures, as finished text.

Both outputs print these strings and compute nothing, so the HTML and the PDF cannot disagree.
"""

from __future__ import annotations

from dataclasses import dataclass

from reports.view import Fact, FigureEntry, Symbol, Tone


@dataclass(frozen=True)
class Cell:
    """A table cell: a symbol or a text, a second line in small print under it, and how it is set."""

    text: str = ""
    small: str = ""
    symbol: Symbol | None = None
    strong: bool = False
    equation: bool = False  # `_` sets what follows low
    tone: Tone | None = None  # a verdict


@dataclass(frozen=True)
class Grid:
    """A table. `widths` are shares of the page's width; `right` the columns set flush right."""

    header: tuple[str, ...]
    widths: tuple[float, ...]
    rows: tuple[tuple[Cell, ...], ...]
    right: tuple[int, ...] = ()


@dataclass(frozen=True)
class Picture:
    """A figure; `wide` ones take the whole width of the page."""

    figure: FigureEntry
    wide: bool = False


@dataclass(frozen=True)
class Section:
    """A part of the summary; what is empty is left out."""

    title: str
    lead: str = ""
    grid: Grid | None = None
    pictures: tuple[Picture, ...] = ()
    facts: tuple[Fact, ...] = ()
    note: str = ""


@dataclass(frozen=True)
class SummaryView:
    """A summary."""

    title: str
    campaign: str  # the directory's name, on every page
    simulated: str  # the banner, empty for a real rig
    outcome: str
    tone: Tone
    outcome_text: str
    identification: tuple[Fact, ...]
    sections: tuple[Section, ...]
    end: str
