"""The decision rule."""

from __future__ import annotations

import math

import pytest

from bench.errors import ConfigError
from bench.record.limits import Limit, Verdict, judge
from bench.uncertainty import Interval


def between(low: float, high: float) -> Interval:
    return Interval(low, high, 2.0, (high - low) / 2, math.inf, "gum", "", (high - low) / 4, (0.0, 0.0, 0.0))


BOTH = Limit(1.0, 2.0, "N/A", "house", True)


@pytest.mark.parametrize(
    ("low", "high", "verdict"),
    [
        (1.2, 1.8, "pass"),
        (1.0, 2.0, "pass"),
        (0.9, 1.1, "indeterminate"),
        (1.9, 2.1, "indeterminate"),
        (0.5, 2.5, "indeterminate"),
        (0.5, 1.0, "indeterminate"),
        (0.5, 0.9, "fail"),
        (2.1, 2.2, "fail"),
        (math.nan, math.nan, "indeterminate"),
        (math.nan, 1.5, "indeterminate"),
    ],
)
def test_two_sided(low: float, high: float, verdict: str) -> None:
    assert judge(between(low, high), BOTH) == verdict


def test_one_sided_and_none() -> None:
    assert judge(between(5, 6), Limit(1.0, None, "", "", False)) == Verdict.PASS
    assert judge(between(5, 6), Limit(None, 1.0, "", "", False)) == Verdict.FAIL
    assert judge(between(5, 6), None) == Verdict.NONE


@pytest.mark.parametrize(("low", "high"), [(None, None), (2.0, 1.0), (math.nan, 1.0), (0.0, math.inf)])
def test_a_limit_must_make_sense(low: float | None, high: float | None) -> None:
    with pytest.raises(ConfigError):
        Limit(low, high, "", "", False)
