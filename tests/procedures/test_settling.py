"""Settling times: every time that is possible is within the interval, and no other; against made responses and machines."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from amb_stand import AMB_ROTOR
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import simulated_run
from bench.errors import AnalysisError
from bench.procedure import Measured
from bench.uncertainty import interval
from procedures.step import settling
from procedures.step.influences import settling_estimate
from procedures.step.oscillation import shrinks
from procedures.step.settling import Settling
from procedures.step.steps import Case, Done

POLE = -85 + 425j
WINDOW = 6.0  # samples of 1 ms
SIZES = (10e-6, 20e-6)
Array = np.ndarray


def off(t: Array, swing: float, level: float, tail: float, constant: float, window: float) -> Array:
    """How far means over a window are off the set point, without noise."""
    poles = np.array([POLE, -1 / constant + 0j])
    e = np.exp(np.outer(t, poles)) * shrinks(poles, window)
    return np.asarray(level + swing * e[:, 0].real + tail * e[:, 1].real)


def made(
    swing: float, level: float = 0.0, tail: float = 0.0, constant: float = 1.5, noise: float = 1e-7, seed: int = 1,
    record: float = 0.5,
) -> list[Done]:  # fmt: skip
    """Steps of two sizes, both ways, twice, with white noise in m."""
    rng, out = np.random.default_rng(seed), []
    t = np.arange(-20, round(record * 1e3)) * 1e-3 + 0.9e-3
    for size in SIZES:
        for _ in range(2):
            for begin, way in ((0.0, 1), (size, -1), (0.0, -1), (-size, 1)):
                case = Case("A", 0.0, "y", size, way)
                y = np.where(t > 0, 1 + off(t, swing, level, tail, constant, 1e-3), 0.0) * size + noise * rng.normal(
                    size=len(t)
                )
                zero = np.zeros(len(t))
                out.append(Done(case, begin, t, y, y, zero, zero, zero, zero[:100], noise / math.sqrt(WINDOW), WINDOW, 0.0, 0.0,
                                True, (1.0,), (0.0, 0.0), 0, (), 0, 500, AMB_ROTOR))  # fmt: skip
    return out


def settled(steps: list[Done], size: float = 10e-6, other: complex = POLE * 0.997) -> Settling:
    curve = settling.fit(steps, np.array([POLE * 1.003, other]), POLE)
    of = [d for d in steps if d.case == Case("A", 0.0, "y", size, 1)]
    return settling.settling(curve, of[0].case, of, 0.02)


def true_time(swing: float, level: float = 0.0, tail: float = 0.0, constant: float = 1.5) -> float:
    t = np.arange(8e-3, 5.0, 1e-5)
    return float(settling.crossings(t, off(t, swing, level, tail, constant, 6e-3)[None, :], 0.02)[0])


def touching(height: float) -> float:
    """The swing of which an extreme about 40 ms after the step is `height` from zero."""
    t = np.arange(0.036, 0.043, 1e-5)
    return height / float(np.abs(off(t, 1.0, 0.0, 0.0, 1.5, 6e-3)).max())


@pytest.mark.parametrize("near", [-3e-4, -1e-4, 1e-4, 3e-4])
def test_an_extreme_that_may_touch_the_band_gives_both_times(near: float) -> None:
    """Half a swing lies between them; which one it is cannot be told, and the interval says so."""
    swing = touching(0.02 + near)
    early, late = (true_time(touching(0.02 + by)) for by in (-2e-3, 2e-3))
    assert late - early > 4e-3
    for seed in range(2):
        found = settled(made(swing, seed=seed))
        bounds = interval(settling_estimate(Case("A", 0.0, "y", 10e-6, 1), found))
        assert bounds.low < true_time(swing) < bounds.high
        assert 0.4 * (late - early) < bounds.U
        assert bounds.low < found.time < bounds.high


def test_an_extreme_far_from_the_band_gives_one_time_and_a_narrow_interval() -> None:
    swing = touching(0.026)
    bounds = interval(settling_estimate(Case("A", 0.0, "y", 10e-6, 1), settled(made(swing))))
    assert bounds.low < true_time(swing) < bounds.high
    assert bounds.U < 0.5e-3


@settings(deadline=None, max_examples=8)
@given(st.floats(0.2, 1.0), st.floats(-0.019, 0.019), st.floats(-0.03, 0.03), st.integers(0, 99))
def test_no_time_is_impossible(swing: float, level: float, tail: float, seed: int) -> None:
    found = settled(made(swing, level, tail, 0.3, seed=seed))
    assert found.time > 0
    assert found.open or math.isinf(found.time) or 0 <= found.times.min() <= found.time <= found.times.max() <= 0.5


def test_a_tail_along_the_bands_edge_is_told_where_it_crosses_and_left_open_where_the_record_ends() -> None:
    """Samples alone leave the band again and again until the end."""
    found = settled(made(0.6, tail=0.028, constant=0.6, record=1.5))
    bounds = interval(settling_estimate(Case("A", 0.0, "y", 10e-6, 1), found))
    assert bounds.low < true_time(0.6, tail=0.028, constant=0.6) < bounds.high
    assert bounds.U < 0.1
    along = settled(made(0.6, level=0.02))
    assert math.isinf(along.time)
    assert settled(made(0.6, level=0.0198)).open
    never = settled(made(0.6, level=0.03))
    assert math.isinf(never.time)
    assert not never.open


def told(steps: list[Done], size: float, constant: float = 0.06) -> Settling:
    """Of steps up, of that size, whose slow part has one constant."""
    case = Case("A", 0.0, "y", size, 1)
    curve = settling.fit(steps, np.array([POLE * 1.003, POLE * 0.997]), POLE, constant)
    return settling.settling(curve, case, [d for d in steps if d.case == case], 0.02)


def test_what_steps_away_have_beside_those_back_is_no_scatter() -> None:
    """1 % of what fades in the largest steps, more away and less back. It is none of a case's mean, and made its time uncertain
    by four times what noise does. The square of the size may have as much, one way or the other, which data of two sizes
    hardly tell: 0.5/√3 of twice that 1 %, at 10 um, times the distance of 0.25 from the mean square 0.85."""
    steps, fade = made(0.6, tail=0.22, constant=0.06, noise=1e-9), 0.22 * np.exp(-made(0.6)[0].t / 0.06)
    shares = [0.01 * (1 if d.begin == 0 else -1) * (d.case.size / max(SIZES)) ** 2 for d in steps]
    apart = [
        replace(d, y=np.where(d.t > 0, d.y + share * fade * d.case.size, d.y))
        for d, share in zip(steps, shares, strict=True)
    ]
    assert told(apart, 20e-6).times.std() == pytest.approx(
        math.hypot(told(steps, 20e-6).times.std(), 0.15 / 0.6 * 0.208e-3), rel=0.05
    )
    assert told(apart, 10e-6).times.std() == pytest.approx(0.5 / math.sqrt(3) * 0.02 * 0.6 * 0.06, rel=0.05)


def test_a_start_that_is_not_known_moves_what_swings() -> None:
    """Each of the largest by 0.1 ms and the others by 0.2 ms: a case's time by √0.129 and √0.218 of 0.1 ms."""
    swing = touching(0.026)
    steps = [replace(d, start_noise=1e-4 * max(SIZES) / d.case.size) for d in made(swing, noise=1e-9)]
    for size, share in zip(SIZES, (0.129, 0.218), strict=True):
        assert settled(steps, size).times.std() == pytest.approx(1e-4 * math.sqrt(share), rel=0.06)


@pytest.mark.parametrize("tail", [0.22, 0.225, 0.23, 0.235])
def test_what_fades_fast_crosses_the_bands_edge_when_it_does(tail: float) -> None:
    """Where the swing is gone the curve was looked at every 5 ms, and straight lines between: up to 50 us late, at which a fast
    integrator's interval is half as wide."""
    steps, case = made(0.6, tail=tail, constant=0.06, noise=1e-10), Case("A", 0.0, "y", 10e-6, 1)
    curve = settling.fit(steps, np.array([POLE * 1.003, POLE * 0.997]), POLE, 0.06)
    found = settling.settling(curve, case, [d for d in steps if d.case == case], 0.02)
    assert found.time == pytest.approx(true_time(0.6, tail=tail, constant=0.06), abs=4e-6)


@pytest.mark.parametrize(
    ("poles", "constant", "first"),
    [
        ((POLE, POLE), 0.0, 0.1),
        ((-567 + 985j, -414 + 0j), 0.0, 0.05),
        ((POLE, POLE), 0.06, 0.06),
        ((POLE, POLE), 0.128, 0.05),
        ((POLE, POLE), 0.3, 0.1),
    ],
)
def test_decays_begin_where_something_may_fade(poles: tuple[complex, complex], constant: float, first: float) -> None:
    """From 0.1 s, from the one that was found, from what two that look like one of 0.128 s may be, and from half of the first
    where no swing can be taken for it."""
    curve = settling.fit(made(0.6), np.array(poles), None, constant)
    assert curve.fades[0] == pytest.approx(first, rel=1e-3)
    ratios = np.divide(curve.fades[1:], curve.fades[:-1])
    assert (ratios > 1.35).all()
    assert (ratios < 2.05).all()


def test_nothing_is_told_beyond_the_shortest_record() -> None:
    """Records of a live run end when its computer comes round to it. A curve says nothing where it was not fitted to all."""
    short, long = (made(0.6, tail=0.02, constant=0.3, record=record, seed=5) for record in (1.0, 3.0))
    steps = [b if b.case == Case("A", 0.0, "y", 10e-6, 1) else a for a, b in zip(short, long, strict=True)]
    bounds = interval(settling_estimate(Case("A", 0.0, "y", 10e-6, 1), settled(steps)))
    assert bounds.low < true_time(0.6, tail=0.02, constant=0.3) < bounds.high


@pytest.mark.parametrize("other", [34 + 583j, 9 + 565j, 62 + 598j])
def test_an_oscillation_that_noise_makes_grow_hides_nothing(other: complex) -> None:
    """Position hardly has the second oscillation of some machines, so that noise makes its pole: to e^50 within the record."""
    swing = touching(0.026)
    bounds = interval(settling_estimate(Case("A", 0.0, "y", 10e-6, 1), settled(made(swing, record=1.5), other=other)))
    assert bounds.low < true_time(swing) < bounds.high
    assert bounds.U < 0.6e-3


def test_an_oscillation_that_does_not_die_away_has_not_settled() -> None:
    steps = made(0.6, record=1.5)
    for d in steps:
        d.y[d.t > 0] += 0.05 * d.case.size * np.sin(500 * d.t[d.t > 0])
    assert math.isinf(settled(steps, other=9 + 500j).time)


def test_noise_widens_the_band() -> None:
    assert settled(made(0.6, noise=4e-7)).within == pytest.approx(5 * 4e-7 / math.sqrt(6) / 10e-6 / 2)


def test_too_few_steps_are_refused() -> None:
    with pytest.raises(AnalysisError, match="steps"):
        settled(made(0.6)[:4])


@pytest.mark.parametrize("seed", [7820015, pytest.param(7820000, marks=pytest.mark.long)])
def test_jumps_of_drawn_machines_are_within_their_intervals(tmp_path: Path, seed: int) -> None:
    """Machines on which an extreme almost touches the band, 7 to 12 U off where the interval does not look for it."""
    run = simulated_run("step", "amb5dof", seed, {"axes": ("y", "z")}, tmp_path / "recording.mcap")
    true = truth_of_motion(run)
    found = [m for m in run.results if isinstance(m, Measured) and m.quantity.name == "settling_time"]
    assert len(found) == 8
    for m in found:
        bounds, time = interval(m.estimate), true[f"settling_time@{m.where}"]
        assert bounds.low > 0
        assert bounds.low - bounds.U < time < bounds.high + bounds.U, m.where
