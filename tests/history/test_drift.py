"""The line through values over time: certified data, coverage, and when its band reaches a limit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy import stats

from bench.history.drift import Drift, chi2_ratio, fitted, t_factor

# NIST StRD Norris: ozone, y over x
NORRIS_Y = [0.1, 338.8, 118.1, 888.0, 9.2, 228.1, 668.5, 998.5, 449.1, 778.9, 559.2, 0.3, 0.1, 778.1, 668.8, 339.3, 448.9, 10.8,
            557.7, 228.3, 998.0, 888.8, 119.6, 0.3, 0.6, 557.6, 339.3, 888.0, 998.5, 778.9, 10.2, 117.6, 228.9, 668.4, 449.2,
            0.2]  # fmt: skip
NORRIS_X = [0.2, 337.4, 118.2, 884.6, 10.1, 226.5, 666.3, 996.3, 448.6, 777.0, 558.2, 0.4, 0.6, 775.5, 666.9, 338.0, 447.5,
            11.6, 556.0, 228.1, 995.8, 887.6, 120.2, 0.3, 0.3, 556.8, 339.1, 887.2, 999.0, 779.0, 11.1, 118.3, 229.2, 669.1,
            448.9, 0.5]  # fmt: skip


def line(times: list[float], values: list[float]) -> Drift:
    found = fitted(np.array(times), np.array(values))
    assert found is not None
    return found


def test_line_of_norris() -> None:
    found = line(NORRIS_X, NORRIS_Y)
    assert found.slope == pytest.approx(1.00211681802045, rel=1e-12)
    assert found.at(0.0) == pytest.approx(-0.262323073774029, rel=1e-9)
    assert found.scatter == pytest.approx(0.884796396144373, rel=1e-10)
    assert found.half / t_factor(34) == pytest.approx(0.429796848199937e-3, rel=1e-10)
    assert found.band(0.0) / t_factor(34) == pytest.approx(0.232818234301152, rel=1e-10)


def test_t_and_chi_squared_are_those_of_scipy() -> None:
    for dof in [*range(1, 130), 1000]:
        assert t_factor(dof) == pytest.approx(stats.t.ppf(0.975, dof), rel=1e-10)
        assert chi2_ratio(dof) == pytest.approx(stats.chi2.ppf(0.99, dof) / dof, rel=8e-3)


@pytest.mark.parametrize("count", [4, 10, 25])
@pytest.mark.parametrize("slope", [0.0, 1.0])
def test_intervals_of_drifts_cover(count: int, slope: float) -> None:
    """2000 histories with a scatter of 1 about a drift, and an error of 5 that all runs of one history share."""
    rng = np.random.default_rng(7)
    held = 0
    for _ in range(2000):
        times = np.cumsum(rng.uniform(0.5, 2.0, count))
        found = fitted(times, slope * times + rng.standard_normal(count) + 5 * rng.standard_normal())
        assert found is not None
        held += abs(found.slope - slope) <= found.half
    assert abs(held / 2000 - 0.95) <= 3.3 * math.sqrt(0.95 * 0.05 / 2000)


def test_no_line_through_two_values_or_at_one_time() -> None:
    assert fitted(np.array([1.0, 2.0]), np.array([1.0, 2.0])) is None
    assert fitted(np.ones(4), np.arange(4.0)) is None


def test_when_an_exact_line_reaches_a_limit() -> None:
    found = line([0, 1, 2, 3], [10, 11, 12, 13])
    assert found.reaches(20.0, True, 3.0) == pytest.approx(10.0)
    assert found.reaches(20.0, True, 3.0, common=2.0) == pytest.approx(8.0)
    assert found.reaches(5.0, False, 3.0) is None
    assert found.reaches(12.0, True, 3.0) == 3.0  # it has by then


numbers = st.floats(-3, 3)


@given(st.lists(numbers, min_size=3, max_size=12), numbers, st.floats(0.1, 60), st.booleans(), st.floats(0, 3))
def test_the_band_reaches_a_limit_where_it_is_first_that_far(
    values: list[float], tilt: float, away: float, upward: bool, common: float
) -> None:
    times = np.arange(float(len(values)))
    found = fitted(times, np.array(values) + tilt * times)
    assert found is not None
    now, sign = float(times[-1]), 1.0 if upward else -1.0
    limit = found.at(now) + sign * away

    def room(time: float) -> float:
        return sign * (limit - found.at(time)) - found.band(time, common)

    reached = found.reaches(limit, upward, now, common)
    assume(found.scatter > 1e-6)
    ahead = now + 400 * np.linspace(0, 1, 301) ** 2
    if reached is None:
        assert all(room(t) > 0 for t in ahead)
    elif reached == now:
        assert room(now) <= 0
    else:
        assert room(reached) == pytest.approx(0, abs=1e-6 * (1 + abs(limit) + abs(found.slope) * reached))
        assert all(room(t) > 0 for t in ahead if t < reached - 1e-6)
