"""Rows of the report from the content of a rig file and of a record."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from bench import display_units
from reports import text
from reports.view import Correlations, Fact, Symbol, Table

SETTING_DIGITS = 7  # of a setting that is told in another unit than the plan has it in
PAGE_WIDTH = 14  # columns of a correlation matrix
NARROW_NAME = 6  # letters that the head of such a column holds
SMALL_CORRELATION = 0.05
MOST_PAIRS = 40
# Identities of influences that are not the path of their number in the rig file's content.
RENAMED = {"masses/hanger": "hanger", "masses/density": "mass_density"}
NOT_INPUTS = ("simulation", "plans", "envelope", "parameters", "laboratory", "settling")
Content = Mapping[str, Any]


def symbol_of(name: str, titles: Mapping[str, str] = MappingProxyType({})) -> Symbol:
    """A quantity as readers know it: by its title, else as a letter with its subscript, else in words."""
    if name in titles:
        return Symbol(titles[name], titles[name], "")
    letter, subscript = text.symbol(name)
    return (
        Symbol(name, letter, subscript) if subscript else Symbol(name.replace("_", " "), letter.replace("_", " "), "")
    )


def called(said: str, titles: Mapping[str, str], names: Collection[str] = ()) -> str:
    """A text with the titles of quantities in place of names that are no words: those with a stroke in them. Other `names`
    that are no symbols are told in words."""
    words = {n: n.replace("_", " ") for n in names if not text.SYMBOL.fullmatch(n)} | dict(titles)
    found = sorted((n for n in words if "_" in n), key=len, reverse=True)
    if not found:
        return said
    return re.sub(rf"\b({'|'.join(map(re.escape, found))})\b", lambda m: words[m[0]], said)


def place(measurement: Content) -> str:
    """Where a measurement of record.json belongs; empty where its name tells."""
    where = str(measurement.get("where") or "")
    return "" if where == str(measurement.get("name", "")) else where


def stated(entry: Content) -> str:
    """The uncertainty of a rig file's number, as its source states it."""
    unit = str(entry.get("unit") or "")
    if entry.get("half_width") is not None:
        amount = f"± {text.with_unit(text.plain(entry['half_width']), unit)}"
    elif entry.get("u") is not None:
        k = entry.get("k") or 1
        amount = f"{'u' if k == 1 else 'U'} = {text.with_unit(text.plain(entry['u']), unit)} (k = {text.plain(k)})"
    else:
        return "none stated"
    distribution = entry.get("distribution")
    return f"{amount}, {distribution}" if distribution else amount


def toleranced(tree: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Content]]:
    """Every number with a tolerance in a rig file's content, with its path, in file order."""
    if isinstance(tree, Mapping):
        if isinstance(tree.get("value"), int | float) and ("u" in tree or "half_width" in tree):
            yield path, tree
            return
        for key, branch in tree.items():
            if path or key not in NOT_INPUTS:  # what only the simulator draws from is no reader's business
                yield from toleranced(branch, (*path, str(key)))
    elif isinstance(tree, list | tuple):
        for index, branch in enumerate(tree):
            yield from toleranced(branch, (*path, str(index + 1)))


def traceability(rig: Content, influences: Collection[str]) -> Table:
    """The toleranced numbers of the rig file on which results rest, by the identities of their `influences`, with their
    sources; equal sensors share one row."""
    groups: dict[tuple[str, ...], list[tuple[str, ...]]] = {}
    for path, stored in toleranced(rig):
        identity = "/".join(path)
        if not any(RENAMED.get(i, i) == identity or i.startswith(f"{identity}/") for i in influences):
            continue
        entry = _told(stored)
        unit = str(entry.get("unit") or "")
        value = text.with_unit(text.plain(entry["value"]), unit)
        source = str(entry.get("source") or "source not stated")
        kind = path[0] + "." + path[-1] if len(path) > 2 else ".".join(path)
        groups.setdefault((kind, value, stated(entry), source), []).append(path)
    rows = tuple((_group_name(paths), *key[1:]) for key, paths in groups.items())
    return Table("", ("Rig file entry", "Value", "Uncertainty as stated", "Source"), rows)


def _told(entry: Content) -> Content:
    """A number of the rig file, SI, in the unit that such numbers are written in."""
    si = str(entry.get("unit") or "")
    stated_as = [abs(float(entry[key])) for key in ("value", "u", "half_width") if entry.get(key) is not None]
    size = next((x for x in stated_as if x), 0.0)
    symbol, one = display_units.of_certificate(si, size)
    numbers = {k: entry[k] / one for k in ("value", "u", "half_width") if isinstance(entry.get(k), int | float)}
    return {**entry, **numbers, "unit": symbol}


def _group_name(paths: Sequence[tuple[str, ...]]) -> str:
    if len(paths) == 1:
        return ".".join(paths[0])
    members = ", ".join(".".join(p[1:-1]) for p in paths)
    return f"{paths[0][0]}: {paths[0][-1]} of {members}"


def calibrations(found: Any) -> Table:
    """The earlier calibrations that a run used; no rows where it used none."""
    entries = [c for c in found or () if isinstance(c, Mapping)] if isinstance(found, list | tuple) else []
    rows = tuple(
        tuple(str(cell or text.DASH) for cell in (
            c.get("procedure"), c.get("run_id"), text.moment(c.get("date"))[:10], c.get("due"), c.get("state"),
            c.get("sha256"),
        ))
        for c in entries
    )  # fmt: skip
    return Table("", ("Procedure", "Run", "Date", "Due", "State", "SHA-256 of its recording"), rows)


def correlations(record: Content, titles: Mapping[str, str]) -> Correlations | None:
    """The matrix over the measurements; None for fewer than two. What a page's width does not hold is told by pairs.

    Accepts a square list of rows in the order of the measurements, or the same under `names` and `matrix`.
    """
    names, found = _matrix(record)
    if len(names) < 2 or len(found) != len(names):
        return None
    small = all(r is None or abs(r) < SMALL_CORRELATION for a, row in enumerate(found) for r in row[:a])
    if small or len(names) > PAGE_WIDTH:
        return _pairs(names, found, titles)
    heads = tuple(_placed(name, titles) for name in names)
    narrow = all(not place and (symbol.subscript or len(symbol.plain) < NARROW_NAME) for symbol, place in heads)
    columns = tuple(s if narrow else symbol_of(str(k)) for k, (s, _) in enumerate(heads, 1))
    return Correlations(columns, tuple(tuple(_coefficient(r) for r in row) for row in found), heads)


def _matrix(record: Content) -> tuple[list[str], Sequence[Sequence[float | None]]]:
    found = record.get("correlations")
    names = [str(m.get("name", "")) for m in record.get("measurements") or ()]
    if isinstance(found, Mapping):
        names, found = [str(n) for n in found.get("names", names)], found.get("matrix")
    return names, found or ()


def _pairs(names: Sequence[str], matrix: Sequence[Sequence[float | None]], titles: Mapping[str, str]) -> Correlations:
    """The pairs of most correlation, largest first."""
    above = ((matrix[a][b], a, b) for a in range(len(names)) for b in range(a))
    known = sorted(
        ((r, a, b) for r, a, b in above if r is not None and abs(r) >= SMALL_CORRELATION), key=lambda p: -abs(p[0])
    )
    pairs = tuple(
        (_placed(names[b], titles), _placed(names[a], titles), _coefficient(r)) for r, a, b in known[:MOST_PAIRS]
    )
    count = len(names) * (len(names) - 1) // 2
    note = (
        f"{len(known)} of the {count} pairs have a coefficient of at least {SMALL_CORRELATION} in size"
        f"{f'; the {MOST_PAIRS} largest are listed' if len(known) > MOST_PAIRS else ''}. record.json has the whole matrix."
    )
    return Correlations((), (), (), pairs, note)


def _placed(name: str, titles: Mapping[str, str]) -> tuple[Symbol, str]:
    """The symbol of `K_i@upper`, and its place."""
    symbol, _, place = name.partition("@")
    return symbol_of(symbol, titles), place


def _coefficient(r: float | None) -> str:
    if r is None:
        return text.DASH
    rounded = f"{r:.2f}"
    return rounded.replace("-", text.MINUS) if float(rounded) else "0"


def facts(tree: Any, prefix: str = "") -> Iterator[Fact]:
    """Settings, flat: `masses[2].value` style labels, short lists on one line."""
    if isinstance(tree, Mapping) and "value" in tree and ("u" in tree or "half_width" in tree):
        value = text.with_unit(text.plain(tree["value"]), str(tree.get("unit") or ""))
        yield Fact(prefix, f"{value}; {stated(tree)}")
    elif isinstance(tree, Mapping):
        for key, branch in tree.items():
            yield from facts(branch, f"{prefix}.{key}" if prefix else str(key))
    elif isinstance(tree, list | tuple) and any(isinstance(b, Mapping) for b in tree):
        for index, branch in enumerate(tree):
            yield from facts(branch, f"{prefix}[{index + 1}]")
    else:
        yield Fact(prefix, inline(tree))


def settings(plan: Content) -> Iterator[Fact]:
    """The settings of a plan, each under the name and in the unit in which it is usually given."""
    for key, value in plan.items():
        name, told = _setting(str(key), value)
        yield from facts(told, name)


def _setting(key: str, value: Any) -> tuple[str, Any]:
    many = value if isinstance(value, list | tuple) else [value]
    if not many or any(isinstance(v, bool) or not isinstance(v, int | float) for v in many):
        return key, value
    name, exact = display_units.of_setting(key, many)
    numbers = [float(f"{v:.{SETTING_DIGITS}g}") for v in exact]
    return name, value if name == key else numbers if isinstance(value, list | tuple) else numbers[0]


def inline(value: Any) -> str:
    """One setting on one line."""
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        return text.plain(value)
    if isinstance(value, list | tuple):
        return ", ".join(inline(v) for v in value) or "none"
    return str(value)
