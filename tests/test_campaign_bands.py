"""Coverage and width against their bands, and the efficiency, on numbers whose answer is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import chi2, norm, poisson
from scipy.stats import t as student

from bench.campaign.bands import LEVEL, Quantity, Sample, Unable, band, coverage, tails
from bench.campaign.speed import speed
from bench.cli.campaign.coverage import Result
from bench.record.limits import Verdict
from bench.uncertainty import Estimate, Influence, interval
from bench.uncertainty.tails import tails_of_draws, tails_of_t

Z = float(norm.ppf(0.975))
NORMAL = tails_of_t(Z, math.inf)


def samples(n: int, scale: float = 1.0, shift: float = 0.0, seed: int = 1) -> list[Sample]:
    """Errors of a standard normal distribution with intervals of `scale` times the right width."""
    errors = np.random.default_rng(seed).standard_normal(n) + shift
    return [Sample(float(e), float(e) - Z * scale, float(e) + Z * scale, Z * scale, NORMAL) for e in errors]


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
    mixed = [
        Sample(s.error * k, s.low * k, s.high * k, s.U * k, NORMAL) for s, k in zip(samples(2000), scales, strict=True)
    ]
    found = coverage(mixed, 2000)
    assert found.width == pytest.approx(coverage(samples(2000), 2000).width)
    assert found.pooled_width is not None
    assert found.pooled_width < 0.8
    padded = [Sample(s.error, 2 * s.low, 2 * s.high, 2 * s.U, NORMAL) for s in mixed]
    assert coverage(padded, 2000).width_verdict is Verdict.FAIL


def test_intervals_of_no_width_are_too_narrow() -> None:
    nothing = [Sample(s.error, s.error, s.error, 0.0, NORMAL) for s in samples(100)]
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


def student_samples(n: int, dof: float, seed: int) -> list[Sample]:
    """Errors of Student's t over u = 1, with the right k."""
    k = float(student.ppf(0.975, dof))
    errors = np.random.default_rng(seed).standard_t(dof, n)
    return [Sample(float(e), float(e) - k, float(e) + k, k, tails_of_t(k, dof)) for e in errors]


def failing(quantity: list[Sample], judged: int = 1) -> bool:
    return any(t.verdict is Verdict.FAIL for t in tails(quantity, judged))


def far(ratio: float, of: Sample) -> Sample:
    """The same interval, with an error of that many half widths."""
    error = ratio * of.U
    return Sample(error, error - of.U, error + of.U, of.U, of.tails)


@pytest.mark.parametrize("dof", [2, 8])
def test_a_sound_sample_of_few_degrees_of_freedom_is_accused_no_more_often_than_stated(dof: int) -> None:
    """At a level of 5 % in place of 0.1 %, so that 200 campaigns tell: the count beyond 2 U alone, which has a probability."""
    judged = round(LEVEL / 0.05 * 1000) / 1000  # LEVEL / judged = 0.05
    accused = 0
    for seed in range(200):
        beyond = tails(student_samples(300, dof, seed), judged)[0]  # type: ignore[arg-type]
        accused += beyond.verdict is Verdict.FAIL
    assert accused <= 200 * 0.05 + 3.3 * math.sqrt(200 * 0.05 * 0.95)


def test_the_most_errors_are_those_of_the_poisson_distribution_where_they_are_rare() -> None:
    two, three, ten = tails(student_samples(1000, 8, 1), 20)
    expected = [1000 * 2 * float(student.sf(m * student.ppf(0.975, 8), 8)) for m in (2, 3)]
    assert [two.expected, three.expected] == pytest.approx(expected)
    assert ten.most == 0
    for found, mean in zip((two, three), expected, strict=True):
        assert found.most == poisson.ppf(1 - LEVEL / 20, mean)


def test_one_jump_that_the_interval_missed_is_caught() -> None:
    """Of 300 intervals with many degrees of freedom, one that is 12 U off: coverage and width do not see it."""
    sound = samples(300, seed=4)
    planted = [*sound[:-1], far(-12.0, sound[-1])]
    assert coverage(planted, 300).verdict is Verdict.PASS
    assert not failing(sound, judged=20)
    assert failing(planted, judged=20)


def test_a_heavy_tail_is_caught_where_few_degrees_of_freedom_excuse_a_single_one() -> None:
    sound = student_samples(300, 8, 2)
    assert not failing([*sound[:-1], far(3.5, sound[-1])], judged=20)
    assert failing([*sound[:-6], *(far(3.5, s) for s in sound[-6:])], judged=20)
    assert failing([*sound[:-1], far(17.2, sound[-1])], judged=20)  # a jump, whatever the degrees of freedom


def test_the_half_width_is_the_one_towards_the_truth() -> None:
    above = Sample(
        error=3.0, low=2.0, high=9.0, U=3.5, tails=NORMAL
    )  # the truth is 1 below `low`, which is 1 below the value
    assert above.ratio == pytest.approx(3.0)
    below = Sample(error=-3.0, low=-9.0, high=3.0, U=6.0, tails=NORMAL)
    assert below.ratio == pytest.approx(-0.5)
    assert below.holds
    assert Sample(1.0, 1.0, 2.0, 0.5, NORMAL).ratio == math.inf


def test_tails_of_draws_are_those_of_their_distribution() -> None:
    """chi2 of one degree of freedom, from its mean: skewed, so that the side matters."""
    draws = np.random.default_rng(1).chisquare(1, 2_000_000)
    low, high = (float(q) for q in np.quantile(draws, [0.025, 0.975]))
    two, *_ = tails_of_draws(draws, 1.0, low, high)
    assert two == pytest.approx(float(chi2.sf(1 + 2 * (high - 1), 1)), rel=0.05)


def test_an_interval_says_how_far_out_its_errors_may_lie() -> None:
    scatter = Influence("s", "scatter", 1.0, "m", "A", "normal", dof=4)
    by_t = interval(Estimate.of(0.0, scatter))
    assert by_t.tails == pytest.approx([2 * student.sf(m * student.ppf(0.975, 4), 4) for m in (2, 3, 10)])
    box = interval(Estimate.of(0.0, Influence("b", "box", 1.0, "m", "B", "rectangular")))
    assert (box.method, box.tails) == ("monte-carlo", (0.0, 0.0, 0.0))


def test_the_verdict_of_a_quantity_has_its_tails_in_it_and_names_the_worst() -> None:
    planted = samples(300, seed=4)
    planted[7] = far(-12.0, planted[7])
    row = Quantity(1, "p", "q", "m", "", True, coverage(planted, 300), tails(planted, 1), tuple(range(900, 1200)),
                   tuple(planted), 0)  # fmt: skip
    assert row.verdict is Verdict.FAIL
    assert row.farthest[0] == (907, pytest.approx(-12.0))


def test_the_table_says_which_step_a_row_is_of() -> None:
    """The same quantity stands in it once for each step that measures it."""
    found = samples(60)
    rows = tuple(
        Quantity(step, "p", "q", "m", "", True, coverage(found, 60), tails(found, 2), tuple(range(60)), tuple(found), 0)
        for step in (2, 3)
    )
    lines = Result(60, 0, rows, (), (), {}, {}, 1.0, None, Verdict.PASS).text().splitlines()
    assert [line.split("  ")[0] or line.split()[0] for line in lines[2:6]] == ["step 2, p", "q", "step 3, p", "q"]


def test_the_share_of_machines_that_cannot_do_a_step_has_an_interval() -> None:
    """Clopper and Pearson: none of 300 leaves at most 1.2 %, 1 - 0.025^(1/300)."""
    none = Unable(1, "p", 300, ())
    assert none.interval == (0.0, pytest.approx(1 - 0.025 ** (1 / 300)))
    some = Unable(1, "p", 10, tuple((k, "") for k in range(10)))
    assert some.interval == (pytest.approx(0.025 ** (1 / 10)), 1.0)


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
