"""In which unit, at which power of ten and to which digits a trend's numbers are told: the same for all of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from bench import display_units
from bench.history.trend import Trend
from bench.uncertainty import power_out, rounded_at

SIGNIFICANT = 1e-6  # of the largest value: to where its digits are told at the most
PER = (
    ("year", 365.25, 90.0),
    ("day", 1.0, 2.0),
    ("hour", 1 / 24, 0.0),
)  # unit of time, days in it, from how many days on


@dataclass(frozen=True)
class Told:
    """`one` is what one of the unit told is in the record's; numbers end at the decade `place` of that unit."""

    symbol: str
    one: float
    place: int
    power: int
    axis: str
    per: str
    days: float

    def number(self, value: float | None, finer: int = 0) -> str:
        """A value, with `finer` digits more than usual; a dash for none."""
        if value is None or not math.isfinite(value):
            return "-"
        rounded = rounded_at(value / self.one, self.place - finer)
        return f"{rounded.scaleb(-self.power):f}"

    @property
    def unit(self) -> str:
        """The unit with its power of ten, as a heading has it."""
        unit = (
            ""
            if self.symbol == "1"
            else self.symbol.replace("u", "µ", 1)
            if self.symbol.startswith("u")
            else self.symbol
        )
        return " ".join(x for x in (f"1e{self.power}" if self.power else "", unit) if x)

    def with_unit(self, value: float, finer: int = 0) -> str:
        number, unit = self.number(value, finer), self.unit
        return f"{number} x {unit}" if self.power else f"{number} {unit}".rstrip()

    def slope(self, value: float) -> float:
        """A slope per day, or per visit, as it is told."""
        return value * self.days

    def when(self, time: float) -> str:
        """A time of the axis."""
        return f"visit {time:.0f}" if self.axis == "visit" else moment(time)

    def day(self, time: float) -> str:
        """The day, or visit, that a time lies in."""
        return f"visit {math.floor(time)}" if self.axis == "visit" else moment(time)[:10]


def moment(days: float) -> str:
    """Days since 1970 as date and time of UTC, to the minute; a year that no calendar has is told as such."""
    try:
        return datetime.fromtimestamp(days * 86400, UTC).strftime("%Y-%m-%d %H:%M")
    except (ValueError, OverflowError, OSError):
        return "after 9999"


def told(trend: Trend) -> Told:
    """How a trend's numbers are told: to two digits of the smaller of the typical U and twice the smallest scatter, so that
    what is seen moving is not rounded away where most of U is common to all runs."""
    values = np.concatenate([s.values for s in trend.segments])
    expanded = np.concatenate([s.expanded for s in trend.segments])
    largest = float(np.max(np.abs(values)))
    symbol, one = display_units.of_result(trend.unit, largest)
    fine = [float(x) for x in expanded[np.isfinite(expanded) & (expanded > 0)]]
    fine = [float(np.median(fine))] if fine else []
    scatter = [2 * s.drift.scatter for s in trend.segments if s.drift is not None and s.drift.scatter > 0]
    finest = max(min([*fine, *scatter], default=largest * 1e-4 or 1.0), SIGNIFICANT * largest) / one
    place = int(f"{finest:.1e}".partition("e")[2]) - 1
    power = power_out(max(largest / one, finest), place)
    times = trend.history.times
    if trend.history.axis == "visit":
        return Told(symbol, one, place, power, "visit", "visit", 1.0)
    per, days = next((per, days) for per, days, least in PER if times[-1] - times[0] >= least)
    return Told(symbol, one, place, power, "date", per, days)
