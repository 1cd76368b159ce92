"""A result in one cell of a terminal: value and U in the unit in which such are told."""

from __future__ import annotations

from bench import display_units
from bench.uncertainty import stated


def with_unit(value: float, expanded: float, unit: str) -> str:
    """`75.43 ± 0.38 N/A`, of SI numbers."""
    symbol, one = display_units.of_result(unit, max(abs(value), expanded))
    return f"{stated(value / one, expanded / one)}{unit_text(symbol)}".replace("+-", "±")


def unit_text(symbol: str) -> str:
    """A unit behind a number; nothing for 1."""
    return "" if symbol == "1" else f" {symbol}".replace(" u", " µ")
