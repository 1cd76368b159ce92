"""Vectors that a record holds by their components, as amount and angle: so people read them and plots show them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from bench import display_units
from reports import tables, text
from reports.view import ResultRow, Table

COS, SIN = "_cos", "_sin"
MOST_ANGLE = math.radians(45)  # a half width beyond which an angle says nothing
Content = Mapping[str, Any]


def table(record: Content) -> Table:
    """A row for each pair of results `x_cos`, `x_sin` of one place; no rows where a record has none."""
    return Table("", ("Vector", "Where", "Amount", "Peak to peak", "Angle"), tuple(_told(record).values()), (2, 3, 4))


def folded(record: Content, measurements: Sequence[Content], rows: Sequence[ResultRow]) -> list[ResultRow]:
    """Rows of results in which a vector that nothing judged is one, by amount and angle, in the place of its two components."""
    told, out = _told(record), []
    for m, row in zip(measurements, rows, strict=True):
        name, where = str(m.get("name", "")), m.get("where")
        stem = name.removesuffix(COS).removesuffix(SIN)
        vector = told.get((stem, where)) if stem != name and row.tone == "none" else None
        if vector is None:
            out.append(row)
        elif name.endswith(COS):
            _, _, amount, _, angle = vector
            called = row.symbol.plain.rpartition(", ")[0] or row.symbol.plain
            turned = f" ∠ {angle}" if angle != text.DASH else ""
            out.append(replace(row, symbol=replace(row.symbol, plain=called), result=f"{amount}{turned}"))
    return out


def _told(record: Content) -> dict[tuple[str, Any], tuple[str, ...]]:
    """By name without its end, and place."""
    measurements = [m for m in record.get("measurements") or () if isinstance(m, Mapping)]
    pairs = _pairs(measurements, _coefficients(record, measurements))
    return {(str(a["name"]).removesuffix(COS), a.get("where")): _row(a, b, r) for a, b, r in pairs}


def _pairs(
    measurements: Sequence[Content], coefficients: Mapping[tuple[int, int], float]
) -> Iterator[tuple[Content, Content, float]]:
    sines = {(str(m["name"]).removesuffix(SIN), m.get("where")): k for k, m in enumerate(measurements)
             if str(m.get("name", "")).endswith(SIN)}  # fmt: skip
    for k, m in enumerate(measurements):
        name = str(m.get("name", ""))
        other = sines.get((name.removesuffix(COS), m.get("where"))) if name.endswith(COS) else None
        if other is not None and m.get("value") is not None and measurements[other].get("value") is not None:
            yield m, measurements[other], coefficients.get((k, other), 0.0)


def _coefficients(record: Content, measurements: Sequence[Content]) -> dict[tuple[int, int], float]:
    """Correlations by the places of two results in the record, where it has a matrix that fits them."""
    found = record.get("correlations")
    matrix = found.get("matrix") if isinstance(found, Mapping) else found
    names = [str(n) for n in found.get("names") or ()] if isinstance(found, Mapping) else []
    if not matrix:
        return {}
    if not names:
        names = [str(m.get("name", "")) for m in measurements]
    at = {name: k for k, name in enumerate(names)}
    own = [at.get(f"{m.get('name')}@{m.get('where')}", at.get(str(m.get("name")))) for m in measurements]
    return {
        (a, b): matrix[i][j] or 0.0 for a, i in enumerate(own) for b, j in enumerate(own)
        if a != b and i is not None and j is not None and _same_vector(measurements[a], measurements[b])
    }  # fmt: skip


def _same_vector(a: Content, b: Content) -> bool:
    stems = {str(m.get("name", "")).removesuffix(COS).removesuffix(SIN) for m in (a, b)}
    return len(stems) == 1 and a.get("where") == b.get("where")


def _row(cosine: Content, sine: Content, r: float) -> tuple[str, ...]:
    """Amount and angle with their half widths, linear in those of the components and their correlation."""
    c, s = float(cosine["value"]), float(sine["value"])
    u, v = (float(m.get("expanded_uncertainty") or 0.0) for m in (cosine, sine))
    size = math.hypot(c, s)
    along = math.sqrt(max(0.0, (c * u) ** 2 + (s * v) ** 2 + 2 * r * c * s * u * v)) / size if size else max(u, v)
    across = math.sqrt(max(0.0, (s * u) ** 2 + (c * v) ** 2 - 2 * r * c * s * u * v)) / size**2 if size else math.inf
    symbol, one = display_units.of_result(str(cosine.get("unit") or ""), size)
    known = across <= MOST_ANGLE
    return (
        str(cosine["name"]).removesuffix(COS).replace("_", " "),
        tables.place(cosine),
        text.result(size / one, along / one, symbol),
        text.with_unit(text.significant(2 * size / one, 3), symbol) if cosine.get("unit") == "m" else text.DASH,
        text.result(math.degrees(math.atan2(s, c)) % 360, math.degrees(across), "deg") if known else text.DASH,
    )
