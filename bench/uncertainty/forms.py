"""One form for an influence that is a stated number: a budget may have it in the number's unit, or as a share of it.

What an influence does to a result is c u, and the unit of u is a convention: (c, u) in the number's unit and (c x, u/|x|) as a
share of its value x are one influence (GUM 5.1.2, 5.1.6). Results that have it in two forms share it all the same, so that
where they meet both are brought to the number's own unit and standard uncertainty. A share is of the deviation over the value
itself, (true - x)/x: of a negative number it counts the other way.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Protocol

from bench.uncertainty.estimate import Array, Deviations, Estimate, Influence

SAME = 1e-9  # of a standard uncertainty: rounding of a quotient
PLAIN = ("1", "")


class Number(Protocol):
    """A number with its standard uncertainty, both in `unit`."""

    @property
    def value(self) -> float: ...
    @property
    def standard_uncertainty(self) -> float: ...
    @property
    def unit(self) -> str: ...
    @property
    def distribution(self) -> str: ...


def form(i: Influence, number: Number) -> float | None:
    """Whether an influence is the whole of a number's error: what its sensitivity is multiplied by to be that to the number,
    in its unit, sign included. None where it is another influence: a part of the error, a bound where the number is exact,
    another distribution, what goes with its square, or an estimate with degrees of freedom of its own."""
    u, x = number.standard_uncertainty, number.value
    if (i.kind, i.distribution) != ("B", number.distribution) or math.isfinite(i.dof) or not (u > 0 and i.u > 0):
        return None
    as_it_is = i.unit in (number.unit, *PLAIN) and math.isclose(i.u, u, rel_tol=SAME)
    share = i.unit in PLAIN and x != 0 and math.isclose(i.u, u / abs(x), rel_tol=SAME)
    if as_it_is and not (share and i.unit == "1" != number.unit):  # of a number of size 1 the unit tells
        return i.u / u
    return math.copysign(i.u / u, x) if share else None


def in_its_unit(i: Influence, number: Number) -> Influence:
    """The influence by the number's own unit and standard uncertainty."""
    return replace(i, u=number.standard_uncertainty, unit=number.unit)


def by_numbers(estimate: Estimate, numbers: Mapping[str, Number]) -> Estimate:
    """An estimate whose influences that are one of the `numbers`, by identity, are all in that number's unit; the others, the
    value and every contribution stay."""
    known = ((i, numbers[i.id]) for i in estimate.sensitivities if i.id in numbers)
    factors = {i: f for i, number in known if (f := form(i, number)) is not None}
    if not factors:
        return estimate
    forms = {i: in_its_unit(i, numbers[i.id]) for i in factors}
    sensitivities = {forms.get(i, i): c * factors.get(i, 1.0) for i, c in estimate.sensitivities.items()}
    model, by_id = estimate.sampler, {i.id: f for i, f in factors.items()}
    if model is None:
        return Estimate(estimate.value, estimate.unit, sensitivities)

    def sampled(deviations: Deviations) -> Array:
        return model({key: drawn * by_id.get(key, 1.0) for key, drawn in deviations.items()})

    return Estimate(estimate.value, estimate.unit, sensitivities, sampled)
