"""Decoupling of axes: bare numbers by hand, the machine's own motion, what is planted, the whole path."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from decoupling_rows import GIVEN, PLAN, RIG, analysed, held, truth

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.uncertainty import interval
from procedures.decoupling import checks, fit
from procedures.decoupling.fit import Nudge
from procedures.decoupling.plan import Plan
from procedures.decoupling.procedure import check, left_out, procedure, untold
from procedures.stages.pairs import inertia_of, pairs, waits_at
from reports.figures import draw as draw_figure
from sim_backend.machines.rlsrm.params import DEG, Map, PlantParams
from sim_backend.machines.rlsrm.truth_decoupling import given
from tests.sim.rlsrm_bench import TYPICAL, drawn, wrong_map

PERIOD, N = 5.0, 5000
T = np.arange(N) * PERIOD / N
SHORT: dict[str, Any] = {"periods": 4, "nudges": 2}
BRIEF = Plan(**SHORT)
TURNED, SLID = Plan(**SHORT, moved="angle"), Plan(**SHORT, moved="stroke")
X, ANGLE = "x while angle", "angle while x"


def run(folder: Path, truth: Mapping[str, float] | None = None, seed: int = 1, **plan: Any) -> Simulated:
    return simulated_run("decoupling", "rlsrm", seed, {**SHORT, **plan}, folder / "recording.mcap", truth or {})


def strong(found: list[Any]) -> set[tuple[str, str]]:
    return {(f.code, f.where) for f in found if isinstance(f, Finding) and f.effect is not Effect.NOTE}


def test_a_sine_and_where_it_slides() -> None:
    """|cos| >= 1/2 for two thirds of a turn, wherever the sine begins."""
    found = fit.sine(T, 0.3 + 2 * np.sin(2 * math.pi * T / PERIOD + 1.1), PERIOD)
    assert (found.amplitude, found.phase, found.constant) == (pytest.approx(2), pytest.approx(1.1), pytest.approx(0.3))
    assert fit.sliding(found, T, 0.5).mean() == pytest.approx(2 / 3, abs=1e-3)


def test_a_filter_lets_half_through_and_differentiates() -> None:
    wave = np.tile(np.sin(2 * math.pi * 5 * T), (4, 1))
    assert np.ptp(fit.smoothed(wave, PERIOD, 5.0)) == pytest.approx(1, rel=1e-4)
    slow = np.tile(np.sin(2 * math.pi * 0.2 * T), (4, 1))
    twice = fit.smoothed(slow, PERIOD, 500.0, 2)
    assert twice == pytest.approx(-((2 * math.pi * 0.2) ** 2) * slow, abs=1e-4)


def test_a_cross_force_by_hand() -> None:
    """Of a place that swings by 1 mm at 1 Hz, 3 kg: the force that is asked for, 0.2 N of sine, less 3 * 39.48e-3 N for the
    mass; 10 N s/m of drag come a quarter of a turn later; a constant force is none of it."""
    w = 2 * math.pi
    force = np.tile(0.5 + 0.2 * np.sin(w * T), (6, 1))
    place = np.tile(1e-3 * np.sin(w * T), (6, 1))
    found = fit.cross(force, 2 * force, place, PERIOD, np.ones(N, bool), 500.0, 3.0, 10.0)
    sine, cosine = 3 * 1e-3 * w**2 * -1 - 0.2, 10 * 1e-3 * w
    assert found.rms == pytest.approx(math.hypot(sine, cosine) / math.sqrt(2), rel=1e-4)
    assert found.peak == pytest.approx(math.hypot(sine, cosine), rel=1e-4)
    assert found.slope == pytest.approx(sine / 0.4, rel=1e-4)
    assert found.plain == pytest.approx(abs(sine) / math.sqrt(2), rel=1e-4)
    assert found.dragged == pytest.approx(cosine / math.sqrt(2), rel=1e-4)
    assert found.other == pytest.approx(0.4 / math.sqrt(2), rel=1e-4)


def test_noise_adds_nothing_to_an_effective_value() -> None:
    """0.1 N of noise in each of 1000 slow samples, nine periods: 0.03 N of the mean, of 0.02 N that are there."""
    rng = np.random.default_rng(1)
    noise = np.repeat(rng.normal(0, 0.1, (9, 1000)), 5, axis=1)
    force = np.tile(0.02 * math.sqrt(2) * np.sin(2 * math.pi * 0.4 * T), (9, 1)) + noise
    found = fit.cross(force, force, 0 * force, PERIOD, np.ones(N, bool), 500.0, 1.0, 0.0)
    assert found.rms == pytest.approx(0.02, abs=0.004)
    assert found.by_period[0].std(ddof=1) / 3 == pytest.approx(0.1 / math.sqrt(9 * 1000), rel=0.6)


@pytest.mark.parametrize("turns", [0.5, 1.5])
def test_a_nudge_tells_friction_from_drag_and_from_what_crosses_over(turns: float) -> None:
    """0.02 N of Coulomb friction, 50 N s/m, beside 0.3 N that come again with every period."""
    a, w = 20e-6, 2 * math.pi * turns / PERIOD
    t = np.arange(4 * N) * PERIOD / N
    place, rate = a * np.sin(w * t), a * w * np.cos(w * t)
    force = 50 * rate + 0.02 * np.sign(rate) + 0.3 * np.sin(2 * math.pi * 3 * t / PERIOD) + 0.1
    sent = fit.sine(t, place, PERIOD / turns)
    cut = (x.reshape(4, N) for x in (force, place))
    found = fit.nudge(*cut, sent, T, np.ones(N, bool))
    assert found.follow == pytest.approx(1, rel=1e-6)
    assert found.speed == pytest.approx(a * w, rel=1e-6)
    assert found.drag == pytest.approx(50 * a * w + 4 / math.pi * 0.02, rel=2e-2)


def test_drag_is_what_grows_with_the_speed() -> None:
    assert fit.dragging(Nudge(1, 0.021, 1e-5), Nudge(1, 0.023, 3e-5)) == pytest.approx(100)
    assert fit.dragging(Nudge(1, 0.023, 1e-5), Nudge(1, 0.021, 3e-5)) == 0


def test_pairs_of_the_rig() -> None:
    assert [p.where for p in pairs(RIG, "all")] == [ANGLE, X]
    assert [p.where for p in pairs(RIG, "angle")] == [X]
    assert [inertia_of(RIG, p.held, {"x": 4.0}) for p in pairs(RIG, "all")] == [1.5e-3, 4.0]
    assert waits_at(held("x").held) == 0


def test_one_count_passes_the_limit_and_two_do_not() -> None:
    """0.144 + 0.072 deg of 0.25; 6 um and half a one of 7."""
    results = {r.pair.where: r for r in analysed(drawn(1), BRIEF)}
    angle = interval(results[ANGLE].estimates["excursion_angle"])
    assert angle.high / DEG == pytest.approx(0.216, abs=1e-3)
    half = interval(results[X].estimates["excursion"]).U
    assert half == pytest.approx(0.5e-6, rel=1e-3)


@pytest.mark.parametrize("seed", [1, 4])
def test_a_drawn_machine_tells_what_it_truly_does(seed: int) -> None:
    """Every interval holds the truth, or 1.2 times as wide a one; nothing is stuck."""
    params = drawn(seed)
    for r in analysed(params):
        true = truth(params, r.pair)
        names = dict(zip(r.estimates, (true["excursion"], true["excursion"] / true["swing"], true["cross"], true["peak"],
                                       true["slope"]), strict=True))  # fmt: skip
        for name, value in names.items():
            told = interval(r.estimates[name])
            assert abs(r.estimates[name].value - value) < 1.2 * told.U, (name, r.estimates[name].value, value)
        assert not checks.stuck(r, PLAN)


def test_nothing_crosses_over_on_the_machine_of_the_map() -> None:
    """And that is no stuck axis: it goes with its nudges."""
    for r in analysed(PlantParams(), BRIEF):
        assert r.excursion < 1e-9
        assert not checks.stuck(r, BRIEF)


def test_excursion_and_force_grow_with_the_error_of_the_map() -> None:
    found = [analysed(wrong_map(s, a * DEG, 0.2e-3), TURNED)[0] for s, a in ((0.02, 0.3), (0.1, 1.0))]
    assert found[0].excursion < 4.5e-6
    assert 10e-6 < found[1].excursion < 20e-6
    assert found[1].cross.rms > 3 * found[0].cross.rms


@pytest.mark.parametrize(
    ("params", "where", "is_stuck"),
    [
        (replace(TYPICAL, along_path=0.0), X, True),
        (replace(TYPICAL, along_path=0.0), ANGLE, True),
        (replace(wrong_map(0.1, 1.0 * DEG, 0.2e-3), along_path=0.0), X, True),
        (replace(TYPICAL, brake=(0.1, 0.0)), X, True),
        (replace(TYPICAL, brake=(0.1, 0.0)), ANGLE, False),
        (replace(TYPICAL, brake=(0.0, 5e-3)), ANGLE, True),
        (replace(TYPICAL, brake=(0.01, 0.0)), X, True),
        (replace(TYPICAL, brake=(1e-3, 0.0)), X, False),
        (TYPICAL, X, False),
    ],
)
def test_friction_that_hides_is_told(params: PlantParams, where: str, is_stuck: bool) -> None:
    (r,) = analysed(params, TURNED if where == X else SLID)
    told = [f for f in checks.of_results([r], TURNED) if f.code == "stuck"]
    assert bool(told) == is_stuck
    if told:
        excursion = "excursion" if where == X else "excursion_angle"
        assert (told[0].where, told[0].effect) == (where, Effect.INDETERMINATE)
        assert f"{excursion}@{where}" in told[0].concerns


def test_with_friction_of_each_axis_apart_the_reading_is_nought_whatever_the_map() -> None:
    """The trap: 0.000 mm with a map that is 10 % wrong."""
    params = replace(wrong_map(0.1, 1.0 * DEG, 0.2e-3), along_path=0.0)
    (r,) = analysed(params, TURNED)
    assert r.excursion == 0
    assert "does not move by a count" in next(f.text for f in checks.of_results([r], PLAN) if f.code == "stuck")


def test_force_at_rest_of_the_true_map() -> None:
    """A machine whose map is the controller's gives what is asked; one with 5 % more inductance 5 % more."""
    assert given(PlantParams(), GIVEN, (2e-3, 0.3), (1.0, 0.02)) == (
        pytest.approx(1.0, rel=1e-9),
        pytest.approx(0.02, rel=1e-9),
    )
    more = PlantParams(map=replace(Map(), slope=0.79 * 1.05))
    assert given(more, GIVEN, (2e-3, 0.3), (1.0, 0.02))[0] == pytest.approx(1.05, rel=1e-9)


def test_on_the_rig_it_tells_the_truth_and_draws(tmp_path: Path) -> None:
    done = run(tmp_path)
    true = truth_of_motion(done)
    told = {f"{r.quantity.name}@{r.where}": r.estimate for r in done.results if isinstance(r, Measured)}
    assert set(told) == set(true)
    assert len(told) == 10
    for name, estimate in told.items():
        assert abs(estimate.value - true[name]) < 1.5 * interval(estimate).U, (name, estimate.value, true[name])
    assert not strong(done.results)
    assert {f.code for f in done.results if isinstance(f, Finding)} == {"friction-beside"}
    shown = list(done.procedure.figures(done.procedure.evaluated(done.recording).result, done.recording))
    assert [f.key for f in shown] == ["traces-angle-x", "traces-x-angle", "cross-angle-x", "cross-x-angle"]
    assert all(draw_figure(f) for f in shown)


@pytest.mark.parametrize("planted", [{"along_path": 0.0}, {"brake_x": 1.0}])
def test_on_the_rig_a_stuck_axis_is_told(tmp_path: Path, planted: dict[str, float]) -> None:
    assert ("stuck", X) in strong(run(tmp_path, planted, moved="angle").results)


@pytest.mark.parametrize(
    ("planted", "plan", "code"),
    [
        ({"factor_angle_amplitude": 0.5}, {}, "sine-not-followed"),
        ({}, {"parameters": {"limit_angle": 0.02}}, "asks-for-its-limit"),
    ],
)
def test_a_motion_that_is_not_the_plans(
    tmp_path: Path, planted: dict[str, float], plan: dict[str, Any], code: str
) -> None:
    assert (code, X) in strong(run(tmp_path, planted, moved="angle", **plan).results)


@pytest.mark.parametrize(
    ("plan", "said"),
    [
        ({"integrators": "some"}, "integrators: found 'some'; expected one of on, off"),
        ({"amplitude_m": 0.014}, "x: found a sine of 0.014 m; expected less than the travel"),
        ({"parameters": {"kp_y": 1.0}}, "parameters: found kp_y"),
        ({"nudge_m": 1e-6, "period_s": 0.2}, "x_period"),
    ],
)
def test_plans_that_cannot_work(plan: dict[str, Any], said: str) -> None:
    assert any(said in line for line in check(RIG, Plan(**plan)))


def test_what_a_plan_or_a_rig_leaves_out() -> None:
    assert not [*check(RIG, Plan())]
    assert {q.name for q in untold(RIG)} == {"peak_ratio", "cross_share"}
    assert {q.name for q in left_out(Plan(moved="angle"))} >= {"excursion_angle", "cross_torque"}
    assert procedure.steps(RIG, Plan()) == 6
    assert procedure.steps(RIG, Plan(moved="angle")) == 3
