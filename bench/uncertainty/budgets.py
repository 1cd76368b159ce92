"""Uncertainty budgets, and rounding a result to its uncertainty."""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import ROUND_HALF_EVEN, Context, Decimal
from typing import Literal

from bench.uncertainty.coverage import Interval
from bench.uncertainty.estimate import Estimate

LONG = Context(prec=700)  # digits between the greatest float and the smallest: quantize refuses what does not fit


@dataclass(frozen=True, slots=True)
class BudgetRow:
    """One influence: its contribution in the estimate's unit, sensitivity c (the derivative at the inputs' values), its
    share of the variance, 0..1, and its own standard uncertainty u in its unit.

    The contribution is |c| u; in an interval by Monte Carlo it is what the influence has of the draws' standard deviation."""

    name: str
    id: str
    contribution: float
    sensitivity: float
    kind: Literal["A", "B"]
    distribution: str
    dof: float
    share: float
    unit: str = ""  # of the influence
    u: float = 0.0


def budget(estimate: Estimate, found: Interval | None = None) -> list[BudgetRow]:
    """All influences, the largest contribution first; equal ones by id. With `found`, the estimate's interval, they are those
    of its standard uncertainty: by Monte Carlo the shares add up to less than 1 where influences act together only."""
    drawn = {} if found is None else found.contributions
    u = found.u if drawn and found and found.u is not None else estimate.u
    rows = []
    for i, c in estimate.sensitivities.items():
        part = drawn.get(i.id, 0.0) if drawn else abs(c * i.u)
        share = (part / u) ** 2 if u > 0 else 0.0
        rows.append(BudgetRow(i.name, i.id, part, c, i.kind, i.distribution, i.dof, share, i.unit, i.u))
    return sorted(rows, key=lambda row: (-row.contribution, row.id))


def round_to_uncertainty(value: float, expanded: float) -> tuple[str, str]:
    """Value and expanded uncertainty as text: two significant digits of U, the value to the same place (GUM 7.2.6)."""
    value, expanded = float(value), float(expanded)  # numpy's numbers print their type
    if not (math.isfinite(value) and math.isfinite(expanded)) or expanded <= 0:
        return repr(value), repr(expanded)
    place = int(f"{expanded:.1e}".partition("e")[2]) - 1  # after rounding: 0.0996 is 1.0e-01
    return _at_place(value, place), _at_place(expanded, place)


def _at_place(number: float, place: int, power: int = 0) -> str:
    """A number rounded at the decade `place`, over 10^power."""
    return f"{rounded_at(number, place).scaleb(-power, LONG):f}"


def rounded_at(number: float, place: int) -> Decimal:
    """A number rounded at the decade `place`, ties to even, however many digits that leaves."""
    return Decimal(repr(float(number))).quantize(Decimal(1).scaleb(place), ROUND_HALF_EVEN, LONG)


def power_out(largest: float, place: int) -> int:
    """The power of ten to take out of a number that ends at the decade `place`: zero where it reads well as it is, from
    0.001 to 999999; else a multiple of three where no digit is lost by it."""
    exponent = math.floor(math.log10(largest)) if largest > 0 else 0
    if place <= 0 and -3 <= exponent < 6:
        return 0
    thousand = 3 * math.floor(exponent / 3)
    return thousand if place <= thousand else exponent


def stated(value: float, expanded: float, sign: str = "+-") -> str:
    """`73.21 +- 0.12`, or with a power of ten that binds both, `(-12.34 +- 0.32)e-6`: a result as a line of text has it."""
    value, expanded = float(value), float(expanded)
    if not (math.isfinite(value) and math.isfinite(expanded)) or expanded <= 0:
        return f"{value!r} {sign} {expanded!r}"
    place = int(f"{expanded:.1e}".partition("e")[2]) - 1
    power = power_out(max(abs(value), expanded), place)
    low, high = (_at_place(x, place, power) for x in (value, expanded))
    return f"({low} {sign} {high})e{power}" if power else f"{low} {sign} {high}"
