"""Coverage and width against their bands, and the efficiency, on numbers whose answer is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import norm

from bench.campaign_bands import Sample, band, coverage
from bench.campaign_speed import speed
from bench.limits import Verdict

Z = float(norm.ppf(0.975))


def samples(n: int, scale: float = 1.0, shift: float = 0.0, seed: int = 1) -> list[Sample]:
    """Errors of a standard normal distribution with intervals of `scale` times the right width."""
    errors = np.random.default_rng(seed).standard_normal(n) + shift
    return [Sample(float(e), float(e) - Z * scale, float(e) + Z * scale, Z * scale) for e in errors]


def test_the_band_of_a_thousand_rigs() -> None:
    assert band(1000) == pytest.approx((0.9273, 0.9727), abs=1e-4)
    assert band(4)[1] == 1.0


def test_honest_intervals_pass() -> None:
    found = coverage(samples(1000), 1000)
    assert found.verdict is Verdict.PASS
    assert found.coverage == pytest.approx(0.95, abs=0.02)
    assert found.width == pytest.approx(1.0, abs=0.1)
    assert found.width_range is not None
    assert found.width_range[0] < 1.0 < found.width_range[1]
    assert found.bias == pytest.approx(0, abs=0.1)


@pytest.mark.parametrize(("scale", "shift"), [(0.7, 0.0), (1.5, 0.0), (1.0, 1.0)])
def test_narrow_padded_and_biased_intervals_fail(scale: float, shift: float) -> None:
    assert coverage(samples(1000, scale, shift), 1000).verdict is Verdict.FAIL


def test_padded_intervals_fail_by_width_alone_where_coverage_cannot_tell() -> None:
    found = coverage(samples(150, 1.8), 150)
    assert found.coverage_verdict is Verdict.PASS
    assert found.width_verdict is Verdict.FAIL


def test_a_width_near_its_band_over_few_rigs_is_indeterminate() -> None:
    found = coverage(samples(80, 1.45, seed=3), 80)
    assert found.width is not None
    assert found.width > 1.25
    assert found.verdict is Verdict.INDETERMINATE


def test_fewer_than_59_rigs_decide_nothing_good() -> None:
    assert coverage(samples(58), 58).verdict is Verdict.INDETERMINATE
    assert coverage(samples(59), 59).coverage_verdict is Verdict.PASS
    assert coverage(samples(40, shift=5.0), 40).verdict is Verdict.FAIL


def test_rigs_of_very_different_size_are_judged_each_by_its_own_interval() -> None:
    """Honest intervals of machines whose truth, and with it the error, spans a decade: pooled they would look too narrow."""
    scales = np.random.default_rng(2).uniform(0.1, 1.0, 2000)
    mixed = [Sample(s.error * k, s.low * k, s.high * k, s.U * k) for s, k in zip(samples(2000), scales, strict=True)]
    found = coverage(mixed, 2000)
    assert found.width == pytest.approx(coverage(samples(2000), 2000).width)
    assert found.pooled_width is not None
    assert found.pooled_width < 0.8
    padded = [Sample(s.error, 2 * s.low, 2 * s.high, 2 * s.U) for s in mixed]
    assert coverage(padded, 2000).width_verdict is Verdict.FAIL


def test_intervals_of_no_width_are_too_narrow() -> None:
    nothing = [Sample(s.error, s.error, s.error, 0.0) for s in samples(100)]
    assert coverage(nothing, 100).width == 0
    assert coverage(nothing, 100).verdict is Verdict.FAIL


def test_a_rig_without_a_value_missed() -> None:
    found = coverage(samples(900), 1000)
    assert (found.values, found.rigs) == (900, 1000)
    assert found.coverage < 0.9
    assert found.verdict is Verdict.FAIL


def test_no_values_at_all() -> None:
    found = coverage([], 100)
    assert found.verdict is Verdict.FAIL
    assert found.width is None


def test_order_statistics_hold_the_percentile_as_often_as_they_say() -> None:
    """The range of the width holds the true width (1) in about 95 of 100 campaigns."""
    held = 0
    for seed in range(200):
        found = coverage(samples(300, seed=seed), 300)
        assert found.width_range is not None
        held += found.width_range[0] <= 1.0 <= found.width_range[1]
    assert held / 200 == pytest.approx(0.95, abs=3.3 * math.sqrt(0.95 * 0.05 / 200))


def rig(began: float, ended: float, alone: str, session: str = "a") -> dict[str, object]:
    return {"kind": "rig", "session": session, "jobs": 2, "alone": alone, "began": began, "ended": ended, "cpu_s": 1.0}


def test_efficiency_by_its_definition() -> None:
    """Two alone at 2 s; then eight on two processes in 10 s: 8 x 2 / (2 x 10) = 0.8."""
    lines = [rig(0, 5, "first"), rig(5, 7, "measured"), rig(7, 9, "measured")]
    lines += [rig(10 + 2.5 * k, 12.5 + 2.5 * k, "no") for k in range(4)] * 2
    found = speed(lines)
    assert found is not None
    assert (found.rigs, found.jobs, found.wall_s, found.alone_s) == (8, 2, 10.0, 2.0)
    assert found.efficiency == pytest.approx(0.8)
    assert found.busy == pytest.approx(1.0)
    assert found.cpu == pytest.approx(0.4)
    assert found.own == pytest.approx(1.0)


def test_time_between_two_sessions_does_not_count() -> None:
    one = [rig(0, 2, "measured"), rig(2, 4, "no"), rig(2, 4, "no")]
    other = [{**r, "session": "b", "began": r["began"] + 1e6, "ended": r["ended"] + 1e6} for r in one]  # type: ignore[operator]
    found = speed([*one, *other])
    assert found is not None
    assert found.wall_s == pytest.approx(4.0)
    assert found.efficiency == pytest.approx(1.0)


def test_without_rigs_alone_nothing_is_said() -> None:
    assert speed([rig(0, 1, "no")]) is None
    assert speed([]) is None
