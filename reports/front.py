"""Page 1: what was judged, worst first, and what a specialist looks at first."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from bench.figures import Figure, Sheet
from reports import text
from reports.figures import Drawn, draw
from reports.view import FigureEntry, ResultRow, Table, Tone

Content = Mapping[str, Any]
SHOWN, BUDGETS, FIGURES = 10, 6, 2
FLAT = 0.8  # of the usual height: figures of page 1, which leave room for what no data can show
WORST_FIRST: tuple[Tone, ...] = ("error", "fail", "indeterminate", "pass", "none")
JUDGED, MEASURED = "What was judged", "What was measured"


def main_first(measurements: Sequence[Content]) -> list[Content]:
    """In their order, a quantity's result of no particular place (the one that counts) before its others."""
    names = list(dict.fromkeys(str(m.get("name", "")) for m in measurements))
    return sorted(measurements, key=lambda m: (names.index(str(m.get("name", ""))), bool(m.get("where"))))


def judged(rows: Sequence[ResultRow]) -> tuple[str, tuple[ResultRow, ...], str]:
    """Title, rows and note of the table of page 1: results with a verdict, the worst first; else the first results."""
    found = sorted((r for r in rows if r.tone != "none"), key=lambda r: WORST_FIRST.index(r.tone))
    title = JUDGED if found else MEASURED
    chosen = found or list(rows)
    left = len(rows) - min(len(chosen), SHOWN)
    passed = sum(r.tone == "pass" for r in chosen[SHOWN:])
    note = f"{left} more result{'s' if left > 1 else ''} in the sections below" if left else ""
    if passed:
        note += f", {passed} of them within their limits"
    return title, tuple(chosen[:SHOWN]), f"{note}." if note else ""


def budgeted(measurements: Sequence[Content]) -> Sequence[Content]:
    """Whose budgets stand in the body of the report: those of the judged results, else the first ones."""
    found = [m for m in measurements if str(m.get("verdict") or "none").lower() != "none"]
    return (found or list(measurements))[:BUDGETS]


def drawn(shown: Iterable[Figure | Sheet]) -> Iterator[Drawn | Sheet]:
    """What a procedure shows, with its figures drawn, those of page 1 flatter than the others."""
    number = 0
    for one in shown:
        if isinstance(one, Sheet):
            yield one
        else:
            number += 1
            yield draw(one, FLAT if number <= FIGURES else 1.0)


def entries(shown: Iterable[Drawn | Sheet]) -> tuple[FigureEntry, ...]:
    """Figures with their numbers; the first ones stand on page 1."""
    figures = (s for s in shown if isinstance(s, Drawn))
    return tuple(
        FigureEntry(n, f.key, text.prose(f.title), text.prose(f.caption), f.svg, n <= FIGURES)
        for n, f in enumerate(figures, 1)
    )


def sheets(shown: Iterable[Drawn | Sheet]) -> tuple[Table, ...]:
    """The procedure's tables."""
    return tuple(
        Table(s.title, s.header, s.rows, s.numeric, s.caption) for s in shown if isinstance(s, Sheet) and s.rows
    )
