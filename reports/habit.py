"""Results in the field's own units: g mm of unbalance, um of motion. A record is SI and stays so."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bench import units

Content = Mapping[str, Any]


def told(measurement: Content) -> Content:
    """A measurement of record.json with every number of its unit in the field's own."""
    numbers = [measurement.get("value"), measurement.get("expanded_uncertainty")]
    largest = max((abs(x) for x in numbers if isinstance(x, int | float)), default=0.0)
    symbol, one = units.habit(str(measurement.get("unit") or ""), largest)
    if one == 1.0 and symbol == measurement.get("unit"):
        return measurement
    return {
        **measurement,
        "unit": symbol,
        **_divided(measurement, ("value", "standard_uncertainty", "expanded_uncertainty"), one),
        "interval": [None if x is None else x / one for x in measurement.get("interval") or (None, None)],
        "limit": _limit(measurement.get("limit"), symbol, one),
        "budget": [{**e, **_divided(e, ("contribution", "sensitivity"), one)} for e in measurement.get("budget") or ()],
    }


def _limit(limit: Content | None, symbol: str, one: float) -> Content | None:
    return None if limit is None else {**limit, "unit": symbol, **_divided(limit, ("low", "high"), one)}


def _divided(entry: Content, names: tuple[str, ...], one: float) -> dict[str, float | None]:
    return {n: None if entry.get(n) is None else entry[n] / one for n in names}
