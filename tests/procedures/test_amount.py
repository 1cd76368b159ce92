"""Lengths of short vectors: intervals against the truth, with scipy's Rice distribution as the oracle of what is measured."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import rice

from bench.uncertainty import Estimate, Influence, interval
from procedures.balance.vector_length import amount


def measured(x: float, y: float, u: float = 1.0) -> Estimate:
    return amount(*(Estimate.of(v, Influence(f"noise/{n}", n, u, "m", "B", "normal")) for v, n in ((x, "x"), (y, "y"))))


@pytest.mark.parametrize("true", [1.0, *(pytest.param(x, marks=pytest.mark.long) for x in (0.0, 0.5, 2.0, 6.0))])
def test_the_interval_holds_the_length_however_short(true: float) -> None:
    """100 measurements; by quantiles, so that chance has little part in it. Draws about the measured length hold 0 never."""
    shares = (np.arange(100) + 0.5) / 100
    lengths = rice.ppf(shares, true) if true else np.sqrt(-2 * np.log(1 - shares))
    held = [i.low <= true <= i.high for i in (interval(measured(r, 0.0)) for r in lengths)]
    assert 0.93 <= np.mean(held) <= 0.99


def test_far_from_zero_it_is_the_normal_one_along_the_vector() -> None:
    found = interval(measured(30.0, 40.0))
    assert (found.low, found.high) == pytest.approx((50 - 1.96, 50 + 1.96), abs=0.05)


def test_it_does_not_depend_on_the_direction_or_the_unit() -> None:
    one, other = interval(measured(0.0, 2.0)), interval(measured(-2e-6 * math.sqrt(0.5), 2e-6 * math.sqrt(0.5), 1e-6))
    assert one.low == pytest.approx(other.low * 1e6, abs=0.02)
    assert one.high == pytest.approx(other.high * 1e6, abs=0.02)


def test_nothing_measured_and_nothing_known() -> None:
    none = interval(measured(0.0, 0.0))
    assert none.low == 0
    assert 2.0 < none.high < 3.5
    exact = amount(Estimate.exact(3.0, "m"), Estimate.exact(4.0, "m"))
    assert (exact.value, exact.u) == (5.0, 0.0)
