"""Uncertainty budgets as tables: what GUM and EA-4/02 list of each influence."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import takewhile
from types import MappingProxyType
from typing import Any

from bench import display_units
from bench.uncertainty.maineffects import drawn_over_u
from reports import tables, text
from reports.view import BudgetRow, BudgetTable

SMALL_SHARE = 0.01  # of the variance; smaller influences are summed in one line, all of them are in record.json
_WORDS = ((re.compile(r"\bamb\b(?!-)"), "AMB"), (re.compile(r"\bcom to\b"), "centre of mass to"))
# By which a contribution may differ from |c| u, or from that of the t distribution that an influence is drawn from.
LINEAR = 0.05
NOT_LINEAR = "not linear"
TOGETHER = "several influences together"
Content = Mapping[str, Any]


def variance(measurement: Content) -> float:
    """What the squares of a result's contributions are shares of: their sum. By Monte Carlo it is the square of the standard
    uncertainty, of which influences that act together only leave the sum short."""
    whole = math.fsum(float(e.get("contribution") or 0.0) ** 2 for e in measurement.get("budget") or ())
    drawn = measurement.get("method") == "monte-carlo" and whole > 0
    return max(whole, float(measurement.get("standard_uncertainty") or 0.0) ** 2) if drawn else whole


def together(measurement: Content) -> float:
    """The share of a variance that no influence has by itself, 0..1."""
    whole = variance(measurement)
    alone = math.fsum(float(e.get("contribution") or 0.0) ** 2 for e in measurement.get("budget") or ())
    return 1 - alone / whole if whole > 0 else 0.0


def identities(measurements: Iterable[Content]) -> frozenset[str]:
    """Of every influence of every result."""
    return frozenset(str(e.get("influence") or "") for m in measurements for e in m.get("budget") or ())


def named(measurement: Content) -> Content:
    """A measurement with the names of its influences in readers' words: a sensor's with its channel."""
    return {**measurement, "budget": [{**e, "name": _name(e)} for e in measurement.get("budget") or ()]}


def _name(entry: Content) -> str:
    said = str(entry.get("name") or "")
    for pattern, words in _WORDS:
        said = pattern.sub(words, said)
    kind, _, rest = str(entry.get("influence") or "").partition("/")
    channel = rest.partition("/")[0]
    return f"{said} of {channel}" if kind == "sensors" and channel and said in ("gain", "offset") else said


def budget_table(
    measurement: Content, rig: Content = MappingProxyType({}), titles: Mapping[str, str] = MappingProxyType({})
) -> BudgetTable:
    """The budget of one measurement of record.json, largest share first; the estimates are those of the rig file."""
    inputs = {"/".join(path): entry for path, entry in tables.toleranced(rig)}
    unit = str(measurement.get("unit") or "")
    entries = sorted(grouped(measurement.get("budget") or ()), key=lambda e: -abs(float(e.get("contribution") or 0.0)))
    whole = variance(measurement)
    shares = [float(e.get("contribution") or 0.0) ** 2 / whole if whole > 0 else 0.0 for e in entries]
    shown = [i for i, share in enumerate(shares) if share >= SMALL_SHARE]
    rest = [e for i, e in enumerate(entries) if shares[i] < SMALL_SHARE]
    method = "Monte Carlo (JCGM 101)" if measurement.get("method") == "monte-carlo" else "GUM (JCGM 100)"
    return BudgetTable(
        symbol=tables.symbol_of(str(measurement.get("name", "")), titles),
        where=tables.place(measurement),
        unit=text.unit_text(unit),
        result=text.result(measurement.get("value"), measurement.get("expanded_uncertainty"), unit),
        standard_uncertainty=_standard_uncertainty(measurement, unit),
        dof="" if measurement.get("method") == "monte-carlo" else text.degrees_of_freedom(measurement.get("dof")),
        method=method,
        rows=tuple(
            _budget_row(entry, shares[i], unit, inputs)
            for i, entry in zip(shown, _apart([entries[i] for i in shown]), strict=True)
        )
        + _acting_together(measurement),
        rest=_rest(rest, unit),
    )


def _acting_together(measurement: Content) -> tuple[BudgetRow, ...]:
    """The row of what no influence has by itself, if that is much."""
    share = together(measurement)
    if share < SMALL_SHARE:
        return ()
    return (
        BudgetRow(
            name=TOGETHER, estimate=text.DASH, u=text.DASH, kind=text.DASH, distribution=text.DASH, dof=text.DASH,
            sensitivity=text.DASH, contribution=text.significant(math.sqrt(share * variance(measurement))),
            share=f"{100 * share:.1f}{text.NARROW}%", percent=round(100 * share, 2),
        ),
    )  # fmt: skip


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


def _budget_row(entry: Content, share: float, unit: str, inputs: Mapping[str, Content]) -> BudgetRow:
    estimate, u, sensitivity = _input(entry, unit, inputs)
    return BudgetRow(
        name=str(entry.get("name", "")),
        estimate=estimate,
        u=u,
        kind=str(entry.get("type") or text.DASH),
        distribution=str(entry.get("distribution") or text.DASH),
        dof=text.DASH if entry.get("dof") == "" else text.degrees_of_freedom(entry.get("dof")),
        sensitivity=sensitivity,
        contribution=text.significant(abs(float(entry.get("contribution") or 0.0))),
        share=f"{100 * share:.1f}{text.NARROW}%",
        percent=round(100 * share, 2),
    )


def _input(entry: Content, unit: str, inputs: Mapping[str, Content]) -> tuple[str, str, str]:
    """Estimate, standard uncertainty and sensitivity of an influence, with their units; dashes where a budget does not say.
    One whose contribution is not its sensitivity times its uncertainty is called not linear."""
    c, contribution = entry.get("sensitivity"), abs(float(entry.get("contribution") or 0.0))
    curved = c is not None and _not_linear(entry)
    if not c and not curved:
        return text.DASH, text.DASH, text.DASH
    c = float(c or 0.0)
    size, si = float(entry["standard_uncertainty"]) if curved else contribution / abs(c), str(entry.get("unit") or "")
    stored = _stored(str(entry.get("influence")), inputs)
    symbol, one = display_units.of_certificate(si, abs(float(stored["value"])) or size if stored else size)
    ratio = units_over(unit, symbol)
    slope = NOT_LINEAR if curved else text.with_unit(text.significant(c * one, 3), ratio)
    if stored is None:
        return text.DASH, text.with_unit(text.significant(size / one), symbol), slope
    value = text.with_unit(text.plain(float(f"{stored['value'] / one:.12g}")), symbol)
    return value, text.with_unit(text.significant(size / one), symbol), slope


def _not_linear(entry: Content) -> bool:
    """Whether what an influence contributes is something else than |c| u; by Monte Carlo one with few degrees of freedom is
    drawn wider than its u (JCGM 101, 6.4.9.4). Records that do not say u know nothing else."""
    u, dof = entry.get("standard_uncertainty"), entry.get("dof") or math.inf
    if u is None:
        return False
    contribution, linear = (abs(float(x or 0.0)) for x in (entry.get("contribution"), entry.get("sensitivity")))
    linear *= float(u)
    return all(abs(contribution - linear * w) > LINEAR * contribution for w in (1.0, drawn_over_u(dof)))


def sensitivity(entry: Content, unit: str) -> str:
    """The sensitivity of a result in `unit` to an influence, with its unit."""
    return _input(entry, unit, {})[2]


def _stored(identity: str, inputs: Mapping[str, Content]) -> Content | None:
    """The rig file's number behind an influence; one that holds for several places has the place behind its own name."""
    name = tables.RENAMED.get(identity, identity)
    return inputs.get(name) or inputs.get(name.rpartition("/")[0])


def units_over(unit: str, by: str) -> str:
    """The unit of a sensitivity: `N/A` over `mm` is `N/A/mm`; of numbers alone, that of the other."""
    bare, below = "" if unit == "1" else unit, "" if by == "1" else by
    if not below:
        return bare
    return f"{bare or '1'}/{f'({below})' if ' ' in below or '/' in below else below}" if bare != below else ""


def _rest(entries: Sequence[Content], unit: str) -> str:
    if not entries:
        return ""
    combined = math.sqrt(math.fsum(float(e.get("contribution") or 0.0) ** 2 for e in entries))
    noun = "influence" if len(entries) == 1 else "influences"
    amount = text.with_unit(text.significant(combined), unit)
    return f"{len(entries)} further {noun}, each below {100 * SMALL_SHARE:g}{text.NARROW}% of the variance: {amount}"
