"""Vectors that a record holds by their components, as amount and angle: so people read them and plots show them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
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


@dataclass(frozen=True)
class Vector:
    """Of one name and place: amount and `expanded` in SI, `angle` in [0, 2 pi) and its half width `swings`, rad."""

    amount: float
    expanded: float
    angle: float
    swings: float

    @property
    def points(self) -> bool:
        """Whether the angle says something."""
        return self.swings <= MOST_ANGLE


def vectors(record: Content) -> dict[tuple[str, Any], Vector]:
    """By name without its end, and place."""
    return {key: _vector(a, b, r) for key, a, b, r in _found(record)}


def _told(record: Content) -> dict[tuple[str, Any], tuple[str, ...]]:
    """By name without its end, and place."""
    return {key: _row(a, _vector(a, b, r)) for key, a, b, r in _found(record)}


def _found(record: Content) -> Iterator[tuple[tuple[str, Any], Content, Content, float]]:
    """Key, both components and their correlation."""
    measurements = [m for m in record.get("measurements") or () if isinstance(m, Mapping)]
    for a, b, r in _pairs(measurements, _coefficients(record, measurements)):
        yield (str(a["name"]).removesuffix(COS), a.get("where")), a, b, r


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


def _vector(cosine: Content, sine: Content, r: float) -> Vector:
    """Amount and angle with their half widths, linear in those of the components and their correlation."""
    c, s = float(cosine["value"]), float(sine["value"])
    u, v = (float(m.get("expanded_uncertainty") or 0.0) for m in (cosine, sine))
    size = math.hypot(c, s)
    along = math.sqrt(max(0.0, (c * u) ** 2 + (s * v) ** 2 + 2 * r * c * s * u * v)) / size if size else max(u, v)
    across = math.sqrt(max(0.0, (s * u) ** 2 + (c * v) ** 2 - 2 * r * c * s * u * v)) / size**2 if size else math.inf
    return Vector(size, along, math.atan2(s, c) % (2 * math.pi), across)


def _row(cosine: Content, v: Vector) -> tuple[str, ...]:
    symbol, one = display_units.of_result(str(cosine.get("unit") or ""), v.amount)
    angle = text.result(math.degrees(v.angle), math.degrees(v.swings), "deg") if v.points else text.DASH
    return (
        str(cosine["name"]).removesuffix(COS).replace("_", " "),
        tables.place(cosine),
        text.result(v.amount / one, v.expanded / one, symbol),
        text.with_unit(text.significant(2 * v.amount / one, 3), symbol) if cosine.get("unit") == "m" else text.DASH,
        angle,
    )
