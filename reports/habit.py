"""Results in the field's own units: g mm of unbalance, um of motion. A record is SI and stays so."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bench import display_units

Content = Mapping[str, Any]
LIMIT_DIGITS = 5


def told(measurement: Content) -> Content:
    """A measurement of record.json with every number of its unit in the field's own."""
    numbers = [measurement.get("value"), measurement.get("expanded_uncertainty")]
    largest = max((abs(x) for x in numbers if isinstance(x, int | float)), default=0.0)
    symbol, one = display_units.of_result(str(measurement.get("unit") or ""), largest)
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
    """Without the last digits that the division makes: a limit is a number that was stated."""
    if limit is None:
        return None
    divided = _divided(limit, ("low", "high"), one)
    told = {k: None if x is None else float(f"{x:.{LIMIT_DIGITS}g}") for k, x in divided.items()}
    return {**limit, "unit": symbol, **told}


def _divided(entry: Content, names: tuple[str, ...], one: float) -> dict[str, float | None]:
    return {n: None if entry.get(n) is None else entry[n] / one for n in names}
