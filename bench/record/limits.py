"""Acceptance limits and the decision rule."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from bench.errors import ConfigError
from bench.uncertainty import Interval

Setting = float | str | list[Any] | Mapping[str, float]
"""What a setting of the plan must be for a limit to hold: a value, one of a list, or a range with `low`, `high`."""


class Verdict(StrEnum):
    """What a limit says of a measurement. NONE: there is no limit. MISSING: declared, but not measured."""

    PASS = "pass"
    FAIL = "fail"
    INDETERMINATE = "indeterminate"
    NONE = "none"
    MISSING = "missing"


@dataclass(frozen=True, slots=True)
class Limit:
    """An acceptance range, inclusive, in `unit`; None is open. `verified`: checked against `source` itself.
    `at` are the settings of the plan that it was stated for, by name; at others it says nothing.

    Raises:
        ConfigError: neither end is given, one is not a number, or they are in the wrong order.
    """

    low: float | None
    high: float | None
    unit: str
    source: str
    verified: bool
    at: Mapping[str, Setting] = field(default_factory=dict)

    def __post_init__(self) -> None:
        ends = [x for x in (self.low, self.high) if x is not None]
        finite = all(-float("inf") < x < float("inf") for x in ends)
        if not ends or not finite or ends != sorted(ends):
            raise ConfigError(f"limit: found low {self.low}, high {self.high}; expected finite numbers, low <= high")


def judge(interval: Interval, limit: Limit | None) -> Verdict:
    """Pass if the whole 95 % interval lies inside the limits, fail if wholly outside, else indeterminate.

    The rule is JCGM 106:2012 with a guard band of U on both sides (8.3.2); what is not a number never passes or fails.
    """
    if limit is None:
        return Verdict.NONE
    low = float("-inf") if limit.low is None else limit.low
    high = float("inf") if limit.high is None else limit.high
    if low <= interval.low <= interval.high <= high:
        return Verdict.PASS
    if interval.low <= interval.high < low or high < interval.low <= interval.high:
        return Verdict.FAIL
    return Verdict.INDETERMINATE
