"""Rows of the report from the content of a rig file and of a record."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import takewhile
from typing import Any

from bench import units
from reports import text
from reports.view import BudgetRow, BudgetTable, Correlations, Fact, Symbol, Table

SMALL_SHARE = 0.0005  # of the variance; smaller influences are summed in one line, all of them are in record.json
PAGE_WIDTH = 14  # columns of a correlation matrix
NARROW_NAME = 6  # letters that the head of such a column holds
SMALL_CORRELATION = 0.05
MOST_PAIRS = 40
_WRITTEN = {"m": (("um", 1e-4), ("mm", 1.0)), "kg": (("mg", 1e-4), ("g", 1e-2)), "rad": (("deg", math.inf),)}
# Ends of the names of settings, SI and told: a plan takes either.
_SETTINGS = (
    ("_rad_s", "rad/s", (("_rpm", math.inf),)), ("_rad", "rad", (("_mrad", 0.02), ("_deg", math.inf))),
    ("_m", "m", (("_um", 1e-3),)), ("_kg", "kg", (("_g", 1e-2),)), ("_A", "A", (("_mA", 0.1),)),
)  # fmt: skip
NOT_INPUTS = ("simulation", "plans", "envelope", "parameters", "laboratory", "settling")
Content = Mapping[str, Any]


def symbol_of(name: str) -> Symbol:
    letter, subscript = text.symbol(name)
    return Symbol(name, letter, subscript)


def place(measurement: Content) -> str:
    """Where a measurement of record.json belongs; empty where its name tells."""
    where = str(measurement.get("where") or "")
    return "" if where == str(measurement.get("name", "")) else where


def budget_table(measurement: Content) -> BudgetTable:
    """The budget of one measurement of record.json, largest share first."""
    unit = str(measurement.get("unit") or "")
    entries = sorted(grouped(measurement.get("budget") or ()), key=lambda e: -abs(float(e.get("contribution") or 0.0)))
    variance = math.fsum(float(e.get("contribution") or 0.0) ** 2 for e in entries)
    shares = [float(e.get("contribution") or 0.0) ** 2 / variance if variance > 0 else 0.0 for e in entries]
    shown = [i for i, share in enumerate(shares) if share >= SMALL_SHARE]
    rest = [e for i, e in enumerate(entries) if shares[i] < SMALL_SHARE]
    method = "Monte Carlo (JCGM 101)" if measurement.get("method") == "monte-carlo" else "GUM (JCGM 100)"
    return BudgetTable(
        symbol=symbol_of(str(measurement.get("name", ""))),
        where=place(measurement),
        unit=text.unit_text(unit),
        result=text.result(measurement.get("value"), measurement.get("expanded_uncertainty"), unit),
        standard_uncertainty=_standard_uncertainty(measurement, unit),
        dof="" if measurement.get("method") == "monte-carlo" else text.degrees_of_freedom(measurement.get("dof")),
        method=method,
        rows=tuple(
            _budget_row(entry, shares[i]) for i, entry in zip(shown, _apart([entries[i] for i in shown]), strict=True)
        ),
        rest=_rest(rest, unit),
    )


def _standard_uncertainty(measurement: Content, unit: str) -> str:
    u = measurement.get("standard_uncertainty")
    return "not stated" if u is None else text.with_unit(text.significant(u), unit)


def grouped(entries: Sequence[Content]) -> list[Content]:
    """The entries of a budget with the parts of one scatter as one entry: those of Type A whose identities differ in
    numbers only (`RUN/scatter/0/1`, `RUN/scatter/0/2`). The record keeps them apart, because correlations need that."""
    groups: dict[str, list[Content]] = {}
    for number, entry in enumerate(entries):
        first, *rest = str(entry.get("influence") or number).split("/")
        stem = "/".join([first, *filter(None, (part.rstrip("0123456789") for part in rest))])
        groups.setdefault(stem if entry.get("type") == "A" else f"{number}:", []).append(entry)
    return [members[0] if len(members) == 1 else _together(members) for members in groups.values()]


def _together(members: Sequence[Content]) -> Content:
    dofs = {m.get("dof") for m in members}
    names = [re.sub(r" at \S+°| \(\d+\)", "", str(m.get("name") or "")) for m in members]
    bare, bracket, run = names[0].partition(" [")
    if len(set(names)) > 1:
        same = takewhile(lambda letters: len(set(letters)) == 1, zip(*names, strict=False))
        bare = "".join(letters[0] for letters in same).partition(" [")[0]
    bare = bare.rstrip(" ,;(/")
    return {
        **members[0],
        "name": f"{bare}, {len(members)} parts{bracket}{run}",
        "contribution": math.hypot(*(float(m.get("contribution") or 0.0) for m in members)),
        "sensitivity": None,
        "dof": members[0].get("dof") if len(dofs) == 1 else "",
    }


def _apart(entries: Sequence[Content]) -> list[Content]:
    """Influences of one name (the two components of a vector, say) told apart by the end of their identities."""
    count = Counter(str(e.get("name") or "") for e in entries)
    return [
        {**e, "name": f"{e['name']} ({_end(str(e['influence']))})"}
        if count[str(e.get("name") or "")] > 1 and e.get("influence") else e
        for e in entries
    ]  # fmt: skip


def _end(identity: str) -> str:
    """The last part of an identity; the unit r/min is none of its strokes."""
    return re.split(r"/(?!min\b)", identity)[-1]


def _budget_row(entry: Content, share: float) -> BudgetRow:
    sensitivity = entry.get("sensitivity")
    return BudgetRow(
        name=str(entry.get("name", "")),
        kind=str(entry.get("type") or text.DASH),
        distribution=str(entry.get("distribution") or text.DASH),
        dof=text.DASH if entry.get("dof") == "" else text.degrees_of_freedom(entry.get("dof")),
        sensitivity=text.significant(sensitivity, 3),
        contribution=text.significant(abs(float(entry.get("contribution") or 0.0))),
        share=f"{100 * share:.1f}{text.NARROW}%",
        percent=round(100 * share, 2),
    )


def _rest(entries: Sequence[Content], unit: str) -> str:
    if not entries:
        return ""
    combined = math.sqrt(math.fsum(float(e.get("contribution") or 0.0) ** 2 for e in entries))
    noun = "influence" if len(entries) == 1 else "influences"
    amount = text.with_unit(text.significant(combined), unit)
    return f"{len(entries)} further {noun}, each below {100 * SMALL_SHARE:g}{text.NARROW}% of the variance: {amount}"


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


def traceability(rig: Content) -> Table:
    """The toleranced numbers of the rig file with their sources; equal sensors share one row."""
    groups: dict[tuple[str, ...], list[tuple[str, ...]]] = {}
    for path, stored in toleranced(rig):
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
    symbol = next((symbol for symbol, below in _WRITTEN.get(si, ()) if 0 < size < below), si)
    one = units.unit(symbol).factor if symbol != si else 1.0
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


def correlations(record: Content) -> Correlations | None:
    """The matrix over the measurements; None for fewer than two. What a page's width does not hold is told by pairs.

    Accepts a square list of rows in the order of the measurements, or the same under `names` and `matrix`.
    """
    found = record.get("correlations")
    names = [str(m.get("name", "")) for m in record.get("measurements") or ()]
    if isinstance(found, Mapping):
        names, found = [str(n) for n in found.get("names", names)], found.get("matrix")
    if not found or len(names) < 2 or len(found) != len(names):
        return None
    if len(names) > PAGE_WIDTH:
        return _pairs(names, found)
    if all(r is None or abs(r) < SMALL_CORRELATION for a, row in enumerate(found) for r in row[:a]):
        return _pairs(names, found)
    heads = tuple(_placed(name) for name in names)
    narrow = all(not place and (symbol.subscript or len(symbol.plain) < NARROW_NAME) for symbol, place in heads)
    columns = tuple(s if narrow else symbol_of(str(k)) for k, (s, _) in enumerate(heads, 1))
    return Correlations(columns, tuple(tuple(_coefficient(r) for r in row) for row in found), heads)


def _pairs(names: Sequence[str], matrix: Sequence[Sequence[float | None]]) -> Correlations:
    """The pairs of most correlation, largest first."""
    above = ((matrix[a][b], a, b) for a in range(len(names)) for b in range(a))
    known = sorted(
        ((r, a, b) for r, a, b in above if r is not None and abs(r) >= SMALL_CORRELATION), key=lambda p: -abs(p[0])
    )
    pairs = tuple((_placed(names[b]), _placed(names[a]), _coefficient(r)) for r, a, b in known[:MOST_PAIRS])
    count = len(names) * (len(names) - 1) // 2
    note = (
        f"{len(known)} of the {count} pairs have a coefficient of at least {SMALL_CORRELATION} in size"
        f"{f'; the {MOST_PAIRS} largest are listed' if len(known) > MOST_PAIRS else ''}. record.json has the whole matrix."
    )
    return Correlations((), (), (), pairs, note)


def _placed(name: str) -> tuple[Symbol, str]:
    """The symbol of `K_i@upper`, and its place."""
    symbol, _, place = name.partition("@")
    return symbol_of(symbol), place


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
    for end, si, written in _SETTINGS:
        if key.endswith(end) and not key.endswith("_kg_m"):
            size = max(abs(v) for v in many)
            told = next((other for other, below in written if size < below), "")
            if not told:
                break
            one = units.unit(units.SUFFIXES[told[1:]]).factor / units.unit(si).factor
            numbers = [float(f"{v / one:.12g}") for v in many]
            return key.removesuffix(end) + told, numbers if isinstance(value, list | tuple) else numbers[0]
    return key, value


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
