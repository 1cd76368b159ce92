"""Results as lines of the terminal: as on page 1 of the report, vectors that nothing judged by amount and angle."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from bench import display_units
from bench.record.limits import Verdict
from bench.record.records import LimitEntry, Measurement, Record
from bench.record.told import unit_text, with_unit
from bench.uncertainty import stated
from reports.vectors import COS, SIN, Vector, vectors

ORDER = (Verdict.FAIL, Verdict.INDETERMINATE, Verdict.MISSING, Verdict.PASS, Verdict.NONE)


@dataclass(frozen=True)
class Row:
    """One result: its quantity with its place, its value with its interval, the verdict and the limit."""

    quantity: str
    where: str
    value: str
    verdict: Verdict
    limit: str

    @property
    def name(self) -> str:
        return titled(self.quantity, self.where)


def rows(record: Record, results: Sequence[Measurement]) -> list[Row]:
    """Judged results first, the worst of them before the others; then by quantity, and of each the one of no particular place
    before the others."""
    found = vectors({"measurements": [vars(m) for m in record.measurements], "correlations": vars(record.correlations)})
    listed = list(_rows(results, found))
    quantities = list(dict.fromkeys(r.quantity for r in listed))
    return sorted(listed, key=lambda r: (ORDER.index(r.verdict), *_main_first(r, quantities)))


def spread(found: Sequence[Row], most: int) -> list[Row]:
    """At most so many, in their order: the first ones of each quantity, so that none crowds out the others."""
    quantities = list(dict.fromkeys(r.quantity for r in found))
    ranks = dict.fromkeys(quantities, 0)
    ranked: list[tuple[int, int]] = []
    for k, row in enumerate(found):
        ranked.append((ranks[row.quantity], k))
        ranks[row.quantity] += 1
    return [found[k] for k in sorted(k for _, k in sorted(ranked)[:most])]


def titled(quantity: str, where: str) -> str:
    """With its place."""
    return f"{quantity} ({where})" if where else quantity


def _main_first(row: Row, quantities: Sequence[str]) -> tuple[int, bool]:
    return (0, False) if row.verdict is not Verdict.NONE else (quantities.index(row.quantity), bool(row.where))


def _rows(results: Sequence[Measurement], found: dict[tuple[str, str], Vector]) -> Iterator[Row]:
    judged = {(_stem(m), m.where) for m in results if m.verdict is not Verdict.NONE}
    for m in results:
        key = (_stem(m), m.where)
        v = found.get(key) if key[0] != m.name and key not in judged else None
        if v is None:
            yield Row(m.name, m.where, _value(m), m.verdict, limit(m.limit))
        elif m.name.endswith(COS):
            yield Row(key[0], m.where, _of_vector(v, m.unit), m.verdict, "")


def _stem(m: Measurement) -> str:
    return m.name.removesuffix(COS).removesuffix(SIN)


def _value(m: Measurement) -> str:
    if m.value is None or m.expanded_uncertainty is None:
        return "not measured"
    return with_unit(m.value, m.expanded_uncertainty, m.unit)


def _of_vector(v: Vector, unit: str) -> str:
    symbol, one = display_units.of_result(unit, max(v.amount, v.expanded))
    told = f"{stated(v.amount / one, v.expanded / one)}{unit_text(symbol)}"
    angle = f" ∠ {stated(math.degrees(v.angle), math.degrees(v.swings))}°" if v.points else ""
    return f"{told}{angle}".replace("+-", "±")


def limit(entry: LimitEntry | None) -> str:
    """Its range in the unit in which its ends are told."""
    if entry is None:
        return ""
    symbol, one = display_units.of_result(entry.unit, max(abs(x) for x in (entry.low, entry.high) if x is not None))
    unit = unit_text(symbol)
    low, high = (None if x is None else f"{x / one:.4g}" for x in (entry.low, entry.high))
    if low is None:
        return f"at most {high}{unit}"
    return f"at least {low}{unit}" if high is None else f"{low} to {high}{unit}"
