"""Counts of a recording, and the names of things in a report's words."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterable, Mapping
from typing import Any

from reports import tables, text
from reports.view import Table

MOST_ALIKE = 12  # streams that differ in a number only and still get a line each
Content = Mapping[str, Any]


def words(key: str) -> str:
    """`latitude_deg` -> `Latitude (°)`, `air_density` -> `Air density`."""
    head, _, tail = key.rpartition("_")
    units = {"deg": "°", "m": "m", "c": "°C", "k": "K", "pa": "Pa"}
    name, unit = (head, f" ({units[tail]})") if head and tail in units else (key, "")
    name = name.replace("_", " ")
    return name[:1].upper() + name[1:] + unit


def counts(title: str, tree: Any) -> Iterable[Table]:
    """Counts as tables: one of the plain values, one for each group of like entries (a row per link or stream)."""
    if dataclasses.is_dataclass(tree) and not isinstance(tree, type):
        tree = dataclasses.asdict(tree)
    if not isinstance(tree, Mapping) or not tree:
        return
    flat = {k: v for k, v in tree.items() if not isinstance(v, Mapping)}
    nested = {k: v for k, v in tree.items() if isinstance(v, Mapping) and v}
    if flat:
        yield Table(title, ("", "Count"), tuple((words(str(k)), tables.inline(v)) for k, v in flat.items()), (1,))
    leaves = {k: v for k, v in nested.items() if not any(isinstance(x, Mapping) for x in v.values())}
    if leaves:
        yield _crossed(f"{title}, by link and stream", leaves)
    for key in nested.keys() - leaves.keys():
        yield from counts(f"{title}: {key}", nested[key])


def _crossed(title: str, leaves: Mapping[Any, Content]) -> Table:
    """A row for each link or stream and a column for each count, whichever way round they are given: of the two it is the
    streams that grow many (a capture is one)."""
    leaves = _folded(leaves)
    rows, columns = [str(k) for k in leaves], list(dict.fromkeys(str(c) for v in leaves.values() for c in v))
    cells = [[tables.inline(v[c]) if c in v else text.DASH for c in columns] for v in leaves.values()]
    if len(columns) > len(rows):
        rows, columns, cells = columns, rows, [list(row) for row in zip(*cells, strict=True)]
    named = zip(rows, cells, strict=True)
    made = sorted(((name, *row) for name, row in named), key=lambda row: _natural(row[0]))
    return Table(title, ("", *map(words, columns)), tuple(made), tuple(range(1, len(columns) + 1)))


def _folded(leaves: Mapping[Any, Content]) -> Mapping[Any, Content]:
    """Streams that differ in a number only (captures) as one of their sum, where there are too many to be read."""
    families: dict[str, list[str]] = {}
    for name in sorted({str(c) for v in leaves.values() for c in v}, key=_natural):
        families.setdefault(name.rstrip("0123456789"), []).append(name)
    sums = {stem: f"{names[0]} to {names[-1]}" for stem, names in families.items() if len(names) > MOST_ALIKE}
    out: dict[Any, dict[str, Any]] = {}
    for key, counted in leaves.items():
        row: dict[str, Any] = {}
        for name, count in counted.items():
            place = sums.get(str(name).rstrip("0123456789"), str(name))
            row[place] = row[place] + count if place in row else count
        out[key] = row
    return out


def _natural(name: str) -> list[tuple[str, int]]:
    """capture/2 before capture/10."""
    return [(words, int(number or 0)) for words, number in re.findall(r"(\D*)(\d*)", name)]
