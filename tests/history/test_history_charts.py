"""Charts and analysis of variance on published data, to their printed digits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from bench.history.anova import one_way
from bench.history.charts import cusum, ewma, ewma_settled, ewma_sigmas, individuals

# NIST/SEMATECH e-Handbook, 6.3.2.4: EWMA, lambda 0.3, target 50, s 2.0539
EWMA = [
    52.0,
    47.0,
    53.0,
    49.3,
    50.1,
    47.0,
    51.0,
    50.1,
    51.2,
    50.5,
    49.6,
    47.6,
    49.9,
    51.3,
    47.8,
    51.2,
    52.6,
    52.4,
    53.6,
    52.1,
]
PRINTED = [50.60, 49.52, 50.56, 50.18, 50.16, 49.21, 49.75, 49.85, 50.26, 50.33, 50.11, 49.36, 49.52, 50.05, 49.38, 49.92,
           50.73, 51.23, 51.94, 51.99]  # fmt: skip
# the same, 6.3.2.3: CUSUM about 325
SUMMED = [324.925, 324.675, 324.725, 324.350, 325.350, 325.225, 324.125, 324.525, 325.225, 324.600, 324.625, 325.150, 328.325,
          327.250, 327.825, 328.500, 326.675, 327.775, 326.875, 328.350]  # fmt: skip
# NIST StRD SiRstv: resistivity of silicon by five instruments
SIRSTV = [[196.3052, 196.1240, 196.1890, 196.2569, 196.3403], [196.3042, 196.3825, 196.1669, 196.3257, 196.0422],
          [196.1303, 196.2005, 196.2889, 196.0343, 196.1811], [196.2795, 196.1748, 196.1494, 196.1485, 195.9885],
          [196.2119, 196.1051, 196.1850, 196.0052, 196.2090]]  # fmt: skip


def test_ewma_of_the_handbook() -> None:
    assert np.round(ewma(np.array(EWMA), 0.3, 50.0), 2).tolist() == PRINTED
    half = 3 * ewma_settled(0.3) * 2.0539
    assert abs(50 + half - 52.5884) < 1e-3  # the page has the root cut to 0.4201
    assert abs(50 - half - 47.4115) < 1e-3
    assert ewma_sigmas(0.3, 1)[0] == pytest.approx(0.3)  # the first is weight x alone
    assert ewma_sigmas(0.3, 60)[-1] == pytest.approx(ewma_settled(0.3))


def test_individuals_of_the_handbook() -> None:
    found = individuals(np.array([49.6, 47.6, 49.9, 51.3, 47.8, 51.2, 52.6, 52.4, 53.6, 52.1]))
    printed = (50.81, 1.8778, 55.8041, 45.8159)
    assert tuple(round(x, 4) for x in (found.centre, found.moving_range, found.upper, found.lower)) == printed
    with pytest.raises(ValueError, match="found 1 value"):
        individuals(np.array([1.0]))


def test_cusum_of_the_handbook() -> None:
    up, down = cusum(np.array(SUMMED), 325.0, 0.3175)
    beyond = np.flatnonzero(up > 4.1959)
    assert beyond[0] + 1 == 14
    assert round(float(up[13]), 2) == 4.94
    assert up[-1] == pytest.approx(19.04, abs=0.0051)  # printed to two digits
    assert not (down > 4.1959).any()


def test_cusum_downward_is_that_of_the_mirrored_values() -> None:
    values = np.array(SUMMED)
    up, down = cusum(values, 325.0, 0.3175)
    mirrored_up, mirrored_down = cusum(650 - values, 325.0, 0.3175)
    assert np.allclose(down, mirrored_up)
    assert np.allclose(up, mirrored_down)


def test_one_way_of_sirstv() -> None:
    found = one_way([np.array(group) for group in SIRSTV])
    assert (found.dof_between, found.dof_within) == (4, 20)
    assert found.f == pytest.approx(1.18046237440255, rel=1e-11)
    assert found.r_squared == pytest.approx(0.190999039051129, rel=1e-11)
    assert found.residual == pytest.approx(0.104076068334656, rel=1e-11)


@pytest.mark.parametrize(
    ("common", "digits"), [(1.0, 13), (1e6, 8)]
)  # StRD SmLs01 and SmLs04: stiff by their common digits
def test_one_way_of_stiff_data(common: float, digits: int) -> None:
    levels = [0.4, *[0.3, 0.5] * 4]
    groups = [np.array([common + m, *[common + m - 0.1, common + m + 0.1] * 10]) for m in levels]
    found = one_way(groups)
    assert found.f == pytest.approx(21.0, rel=10.0**-digits)
    assert found.r_squared == pytest.approx(0.482758620689655, rel=10.0**-digits)
    assert found.residual == pytest.approx(0.1, rel=10.0**-digits)


def test_one_way_keeps_digits_under_many_in_common() -> None:
    """Numbers that the machine holds exactly, with 2^40 added: a mean of them has no digit left for their eighths."""
    plain = [np.array([m - 0.125, m, m + 0.125, m + 0.25, m - 0.25]) for m in (0.0, 0.375, 0.5)]
    shifted = one_way([g + 2.0**40 for g in plain])
    assert shifted.f == pytest.approx(one_way(plain).f, rel=1e-12)
    assert shifted.residual == pytest.approx(one_way(plain).residual, rel=1e-12)


@given(st.lists(st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=6), min_size=2, max_size=5))
def test_one_way_is_that_of_scipy(groups: list[list[float]]) -> None:
    arrays = [np.array(g) for g in groups]
    found = one_way(arrays)
    if found.within < 1e-9 * (1 + max(abs(x) for g in groups for x in g)) ** 2:
        return
    assert found.f == pytest.approx(float(stats.f_oneway(*arrays).statistic), rel=1e-6, abs=1e-9)


def test_one_way_refuses_what_has_no_scatter_to_compare_with() -> None:
    for groups in ([np.ones(3)], [np.ones(1), np.ones(1)], [np.ones(2), np.empty(0)]):
        with pytest.raises(ValueError, match="expected two groups or more"):
            one_way(groups)
    assert one_way([np.ones(2), np.zeros(2)]).f == math.inf
