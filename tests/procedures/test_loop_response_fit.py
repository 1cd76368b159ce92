"""Lines of position loops, where their curves fall and are greatest, and the ideal loop: on synthetic arrays."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.errors import AnalysisError
from bench.rigfile import load_rig
from procedures.loop_response import fit, grid, ideal
from procedures.loop_response.plan import Plan

RATE = 35e3


def sine(periods: int, samples: int, size: float, phase: float) -> np.ndarray:
    return size * np.sin(2 * np.pi * periods * np.arange(samples) / samples + phase)


@pytest.mark.parametrize("periods", [4, 9, 300])
def test_a_line_beside_a_trend(periods: int) -> None:
    """A trend that is taken off first takes 6/(pi p)^2 of the sine with it: 3.8 % of four periods."""
    n = 35_000
    y = sine(periods, n, 0.7e-6, 0.4) + np.linspace(2e-6, -3e-6, n)
    found = fit.line(y, periods, 1e-6)
    assert found.size == pytest.approx(0.7, rel=1e-9)
    assert found.u < 1e-9


def test_the_noise_of_a_line_is_its_scatter() -> None:
    rng, periods, n = np.random.default_rng(1), 60, 7000
    lines = [fit.line(sine(periods, n, 1e-6, 0.3) + rng.normal(0, 0.3e-6, n), periods, 1e-6) for _ in range(400)]
    sizes, u = np.array([x.size for x in lines]), np.array([x.u for x in lines])
    assert sizes.mean() == pytest.approx(1, abs=4 * sizes.std() / 20)
    assert math.sqrt(np.mean(u**2)) == pytest.approx(sizes.std(), rel=0.1)
    assert sizes.std() == pytest.approx(0.3 * math.sqrt(2 / n), rel=0.1)
    assert lines[0].rms == pytest.approx(0.3e-6, rel=0.03)


def test_sensitivity_is_what_the_loop_sees_over_what_was_added() -> None:
    """y = -T n with T = 1.5 exp(-0.7j): S = 1 - T, whatever the phase of the sine was."""
    n, closed = 14_000, 1.5 * np.exp(-0.7j)
    for phase in (0.0, 1.9, -2.4):
        wave = sine(20, n, 1.0, phase)
        y = sine(20, n, 2e-6 * abs(closed), phase + np.angle(-closed))
        found = fit.line(y, 20, 2e-6, wave, sensed=True)
        assert found.size == pytest.approx(abs(1 - closed), rel=1e-9)
        assert found.wave == pytest.approx(1)
    with pytest.raises(AnalysisError, match="phase"):
        fit.line(y, 20, 2e-6, sensed=True)


def test_too_few_periods() -> None:
    with pytest.raises(AnalysisError, match="3 periods"):
        fit.line(np.zeros(1000), 3, 1e-6)


@pytest.mark.parametrize(("loop", "hz"), [("x1", 626.7), ("gamma", 92.7), ("z", 137.5)])
def test_the_ideal_bandwidths_of_the_table(loop: str, hz: float) -> None:
    """L Table II prints 625, 137 and 93 Hz of bearing, rotary and linear: its literal order is wrong, the angle's loop is the
    slowest."""
    rig = load_rig("lira")
    found = ideal.bandwidth(rig, Plan(), loop)
    assert found is not None
    assert found.value == pytest.approx(hz, rel=1e-3)
    printed = {"x1": 625, "gamma": 137, "z": 93}[loop]
    assert (abs(found.value / printed - 1) < 0.02) == (loop == "x1")
    assert ideal.misfit(rig, Plan(), loop, np.exp(np.linspace(-0.15, 0.15, 9))) < 1e-4


def test_what_mass_and_stiffness_do_to_the_ideal_bandwidth() -> None:
    rig = load_rig("lira")
    found = ideal.bandwidth(rig, Plan(), "x1")
    assert found is not None
    heavier = ideal.of_values(rig, Plan(), "x1", {"machine.mass": 1.34 + 0.007 / math.sqrt(3), "machine.pull_1": 375e3})
    assert found.contributions["machine/mass"] == pytest.approx(heavier - found.value, rel=0.02)
    assert set(found.contributions) == {"machine/mass", "machine/pull_1"}


def test_where_a_curve_falls_and_how_well_it_is_known() -> None:
    rng, u = np.random.default_rng(2), 0.01
    hz = np.array(grid.about(600, 0.15, 9))
    curve = ideal.gain(hz, 0.67, 375e3, 680e3, 10.2e6, 2550)
    true = fit.falls_at(lambda f: ideal.gain(f, 0.67, 375e3, 680e3, 10.2e6, 2550), 50, 5000)
    assert fit.crossing(hz, curve, u * curve).hz == pytest.approx(true, rel=1e-4)
    found = [fit.crossing(hz, curve * (1 + rng.normal(0, u, hz.size)), u * curve) for _ in range(500)]
    sound = fit.crossing(hz, curve, u * curve)
    stated = sound.hz * math.sqrt(sound.of_hz @ sound.fit.covariance @ sound.of_hz)
    assert np.std([p.hz for p in found]) == pytest.approx(stated, rel=0.15)
    with pytest.raises(AnalysisError, match="-3 dB"):
        fit.crossing(hz, 2 * curve, u * curve)


def test_the_top_of_a_curve_that_is_not_even() -> None:
    rng = np.random.default_rng(3)
    f = np.geomspace(1, 100, 20001)
    size = lambda hz: np.abs(1 / (1 - (hz / 11) ** 2 + 0.9j * hz / 11)) * np.sqrt(1 + (hz / 40) ** 2)  # noqa: E731
    k = int(np.argmax(size(f)))
    hz = np.array(grid.about(8.9, 0.25, 9))
    top = fit.summit(hz, size(hz), 1e-3 * size(hz))
    assert top.size == pytest.approx(size(f)[k], rel=5e-4)
    assert top.hz == pytest.approx(f[k], rel=5e-3)
    found = [fit.summit(hz, size(hz) * (1 + rng.normal(0, 2e-3, 9)), 2e-3 * size(hz)) for _ in range(500)]
    for name, slopes in (("size", top.of_size), ("hz", top.of_hz)):
        stated = getattr(top, name) * math.sqrt(slopes @ top.fit.covariance @ slopes) * 2  # of noise twice as large
        assert np.std([getattr(p, name) for p in found]) == pytest.approx(stated, rel=0.25)
    with pytest.raises(AnalysisError, match="maximum"):
        fit.summit(np.array(grid.about(60, 0.2, 9)), 1 / np.array(grid.about(60, 0.2, 9)), np.full(9, 1e-5))


def test_which_line_is_looked_at_next() -> None:
    gain = lambda hz: float(ideal.gain(hz, 1.45e-3, 0.0, 25, 99, 0.8))  # noqa: E731
    seen = {hz: gain(hz) for hz in (5.0, 25.0, 60.0, 140.0)}
    assert grid.goes_on(seen) == (gain(140.0) > grid.FALLEN)
    assert grid.halving(seen) == pytest.approx(math.sqrt(60 * 140))
    about = grid.fall(seen | {92.0: gain(92.0), 100.0: gain(100.0)}, 0.15)
    assert about is not None
    assert about[0] == pytest.approx(92.74, rel=1e-3)
    assert grid.fall({5.0: 1.0, 10.0: 0.9}, 0.15) is None
    assert grid.beside({1.0: 1.0, 4.0: 3.0, 16.0: 2.0}) == [2.0, 8.0]
    at, reach = grid.top({8.0: math.exp(-0.2), 10.0: 1.0, 12.5: math.exp(-0.2)})
    assert at == pytest.approx(10)
    assert reach == pytest.approx(math.log(1.25) * math.sqrt(grid.DOWN / 0.2))


def two_humps(hz: float) -> float:
    """|S| with maxima of 2.5 at 160 Hz and of 2.67 at 987 Hz, of the width of a loop damped by a third, one far above them."""
    rises = [(1.5, 160.0, 0.45), (1.67, 987.0, 0.35)]
    return abs(1 / (1 + (40 / hz) ** 2)) * (1 + sum(a * math.exp(-((math.log(hz / f) / w) ** 2)) for a, f, w in rises))


@pytest.mark.parametrize("lines", [4, 6, 8, 12])
def test_the_greatest_of_two_maxima_is_found_however_few_lines_there_are(lines: int) -> None:
    plan = Plan.model_validate({"lines": lines})
    seen = {hz: two_humps(hz) for hz in grid.survey(plan)}
    asked = 0
    while middles := grid.gaps(seen):
        seen |= {hz: two_humps(hz) for hz in middles}
        asked += len(middles)
    assert asked <= grid.most_in_gaps(plan)
    for _ in range(grid.BESIDE):
        seen |= {hz: two_humps(hz) for hz in grid.beside(seen)}
    at, _ = grid.top(seen)
    assert two_humps(at) == pytest.approx(max(two_humps(hz) for hz in np.geomspace(5, 1500, 4000)), rel=0.02)


def test_no_line_is_asked_for_where_sensitivity_is_below_one_or_lines_are_close() -> None:
    assert grid.gaps({5.0: 0.1, 50.0: 0.9, 90.0: 1.4, 150.0: 2.0}) == []
    assert grid.gaps({5.0: 0.1, 50.0: 1.2, 200.0: 0.9}) == pytest.approx([math.sqrt(250), 100.0])
