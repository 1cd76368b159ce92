"""Quantities with many results (by speed, probe, setting): one line for each, with the influences that carry its budget."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from reports import budgets, text
from reports.view import ManyResults, ManyRow, ResultRow

MANY = 5  # results of one quantity that still get a budget each
TOLD = 2  # influences of a line
BRACKETS = "In brackets the interval, where it is by Monte Carlo (JCGM 101) or does not lie about the value"
SMALL = 0.1  # of the variance; smaller ones are not told in a line
Content = Mapping[str, Any]


def names(measurements: Iterable[Content]) -> set[str]:
    """Quantities of which there are many results."""
    return {name for name, count in Counter(str(m.get("name", "")) for m in measurements).items() if count > MANY}


def grouped(measurements: Sequence[Content], rows: Sequence[ResultRow]) -> tuple[ManyResults, ...]:
    """Those results by quantity, in the order in which they come; `rows` as they would be told one by one."""
    chosen = names(measurements)
    groups: dict[str, list[tuple[Content, ResultRow]]] = {}
    for m, row in zip(measurements, rows, strict=True):
        if str(m.get("name", "")) in chosen:
            groups.setdefault(str(m["name"]), []).append((m, row))
    made = [_group(members) for members in groups.values()]
    return tuple(sorted(made, key=lambda group: not group.judged))  # what was judged is looked for first


def _group(members: Sequence[tuple[Content, ResultRow]]) -> ManyResults:
    first = members[0][1]
    probabilities = ", ".join(dict.fromkeys(row.probability for _, row in members))
    limits = list(dict.fromkeys((row.limit, row.limit_source) for _, row in members))
    drawn = any(row.interval for _, row in members)
    said = "; ".join(
        " ".join(filter(None, (f"Limit {limit}", source))) for limit, source in limits if limit != text.DASH
    )
    return ManyResults(
        symbol=first.symbol,
        about=first.about,
        note=". ".join(filter(None, (f"{len(members)} results, p = {probabilities}", BRACKETS * drawn, said))) + ".",
        judged=any(row.tone != "none" for _, row in members),
        rows=tuple(ManyRow(row, row.interval.rpartition(": ")[2], carried(m)) for m, row in members),
    )


def carried(measurement: Content) -> str:
    """The influences with the greatest shares of a variance, and how many others there are."""
    entries = budgets.grouped(measurement.get("budget") or ())
    squares = sorted(
        ((float(e.get("contribution") or 0.0) ** 2, str(e.get("name", ""))) for e in entries), reverse=True
    )
    whole = budgets.variance(measurement)
    if whole <= 0:
        return text.DASH
    told = [(s / whole, name) for s, name in squares[:TOLD] if s / whole >= SMALL] or [
        (squares[0][0] / whole, squares[0][1])
    ]
    parts = [f"{name} {100 * share:.0f}{text.NARROW}%" for share, name in told]
    if (share := budgets.together(measurement)) >= SMALL:
        parts.append(f"{budgets.TOGETHER} {100 * share:.0f}{text.NARROW}%")
    left = len(squares) - len(told)
    return ", ".join(parts) + (f"; {left} more" if left else "")
