"""Stepped currents: the bare model by hand, the machine's own numbers, the whole path, what is planted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.uncertainty import interval
from procedures.current_step import checks, fit
from procedures.current_step.estimates import TOP, _peak
from procedures.current_step.plan import Plan
from procedures.current_step.procedure import MEASURES, check, procedure
from procedures.current_step.steps import LARGE, Pushed, Taken, moved
from reports.figures import draw as draw_figure
from sim_backend.machines.lira.params import ControlParams, PlantParams
from sim_backend.machines.lira.truth_current_step import Stepped, bandwidth, rise

TICK_S = 1 / 280_000
QUICK = {"repeats": 6, "small_repeats": 6}


def stepped(folder: Path, truth: Mapping[str, float] | None = None, rig: str = "lira-200v", **plan: Any) -> Simulated:
    return simulated_run("current-step", rig, 1, {**QUICK, **plan}, folder / "recording.mcap", truth)


def wrong(run: Simulated) -> dict[str, Finding]:
    return {r.code: r for r in run.results if isinstance(r, Finding) and r.effect is not Effect.NOTE}


def first_order(tau: float, seconds: float, lead: int = 0) -> fit.Array:
    """1 - exp(-t/tau) from sample `lead` on."""
    t = (np.arange(round(seconds / TICK_S)) - lead) * TICK_S
    return np.where(t > 0, 1 - np.exp(-np.maximum(t, 0) / tau), 0.0)


def record(size: float, tau: float = 4e-5, offset: float = 0.02) -> fit.Array:
    """A step at 3 ms, the step back at 18 ms, 33 ms in all."""
    up, back = (first_order(tau, 33e-3, round(at / TICK_S)) for at in (3e-3, 18e-3))
    return offset + size * (up - back)


def taken(along: fit.Array, size: float = 3.0, kind: str = LARGE) -> Taken:
    none = np.empty((0, len(along)))
    return Taken(kind, "R1_d", size, TICK_S, along, 0 * along, none, none, np.empty(0), 0, 16)


def test_a_first_order_lag() -> None:
    """ln 9 time constants from 10 to 90 %, and 1/(2 pi tau)."""
    h = first_order(1e-4, 2e-3, 50)
    assert fit.rise(h) * TICK_S == pytest.approx(1e-4 * math.log(9), rel=1e-5)
    assert abs(fit.straight(h) - fit.rise(h)) < 0.02
    assert fit.bandwidth(h, TICK_S) == pytest.approx(1 / (2 * math.pi * 1e-4), rel=2e-3)
    with pytest.raises(AnalysisError, match="10 to 90"):
        fit.rise(0.8 * h)


def test_noise_about_the_lower_level_begins_no_rise() -> None:
    h = first_order(1e-4, 2e-3, 50)
    early = h.copy()
    early[20] = 0.11
    assert fit.rise(early) == fit.rise(h)


def test_edges_and_levels() -> None:
    up, back = fit.edges(record(3.0), 3.0, TICK_S) or pytest.fail("no edges")
    half = 4e-5 * math.log(2) / TICK_S
    assert up.at == math.ceil(3e-3 / TICK_S + half)
    assert back.at == math.ceil(18e-3 / TICK_S + half)
    assert (up.before, up.after, up.size) == pytest.approx((0.02, 3.02, 3.0))
    assert back.size == pytest.approx(-3.0)
    down, _ = fit.edges(record(-3.0), -3.0, TICK_S) or pytest.fail("no edges")
    assert (down.at, down.size) == (up.at, pytest.approx(-3.0))
    for missing in (record(3.0)[: round(17e-3 / TICK_S)], record(1.0), record(3.0)[round(4e-3 / TICK_S) :]):
        assert fit.edges(missing, 3.0, TICK_S) is None


def test_the_greatest_of_noise_is_none() -> None:
    """Plainly it is two standard deviations of the mean; by halves it is as often above as below zero."""
    rng = np.random.default_rng(1)
    found = [fit.farthest(rng.normal(0, 1, (10, 200)), 1, True) for _ in range(300)]
    values = np.array([top.value for top in found])
    assert abs(values.mean()) < 0.06
    assert values.std() == pytest.approx(np.mean([top.u for top in found]), rel=0.12)
    assert all(0 < top.above < 2 for top in found)
    bump = np.sin(np.linspace(0, np.pi, 200)) * -5
    assert fit.farthest(bump + rng.normal(0, 0.1, (10, 200)), 12, True).value == pytest.approx(5, abs=0.05)
    few = np.array([0.0, 1, 2, 1, 0]) + np.array([[0.5], [0.5], [-0.5], [-0.5]])
    assert fit.farthest(few, 12).value == pytest.approx(
        (2 * 12 * 1 + 17 * 2) / 35
    )  # the parabola of all five, and no more


@pytest.mark.parametrize(("damping", "noise"), [(0.3, 5e-3), (0.6, 1.7e-3), (0.6, 2e-2), (0.8, 5e-3)])
def test_the_top_of_a_law_in_noise(damping: float, noise: float) -> None:
    """Overshoot exp(-pi d/sqrt(1 - d^2)) of a loop of second order whose natural period is 70 samples, begun anywhere between
    two: by six repeats it is off by less than a tenth of U on the mean, and 95 % of the intervals hold it."""
    rng, count, root = np.random.default_rng(5), 300, math.sqrt(1 - damping**2)
    natural = 2 * math.pi / 70
    top = math.exp(-math.pi * damping / root)
    inner = 1 - 2 * damping**2
    longest = round(TOP / (natural * math.sqrt(inner + math.sqrt(inner**2 + 1))))
    errors, scaled = [], []
    for _ in range(count):
        t = natural * np.clip(np.arange(200) - 40 - rng.uniform(), 0, None)
        law = -np.exp(-damping * t) * (np.cos(root * t) + damping / root * np.sin(root * t))
        found = _peak("overshoot", "", law + rng.normal(0, noise, (6, 200)), longest)
        span = interval(found)
        errors.append(found.value - top)
        scaled.append((found.value - top) / ((span.high - span.low) / 2))
    assert abs(np.mean(errors)) < 0.1 * np.mean(np.array(errors) / np.array(scaled))
    share = np.mean(np.abs(scaled) <= 1)
    assert abs(share - 0.95) < 3.3 * math.sqrt(0.95 * 0.05 / count)


def test_levels_of_a_step_back_that_is_hardly_captured() -> None:
    """Its level is the one before the step: a loop that comes to rest with 2 ms, of which the capture has but 4 ms."""
    slow = 0.98 * record(3.0) + 0.02 * record(3.0, 2e-3)
    _, back = fit.edges(slow[: round(22e-3 / TICK_S)], 3.0, TICK_S) or pytest.fail("no edges")
    assert back.size == pytest.approx(-3.0, rel=2e-5)
    assert back.end - back.after == pytest.approx(3 * 0.02 * math.exp(-3.25 / 2), rel=0.05)


def test_half_bridges() -> None:
    """A space vector's length at any angle, of six and of three phases; what is given, under ripple that alternates."""
    for phases, apart in ((6, 120), (3, 120)):
        angles = np.radians(apart * np.arange(phases))[:, None] + np.linspace(0, 1, 7)
        assert fit.amplitude(20 * np.cos(angles)) == pytest.approx(np.full(7, 20.0))
    n = np.arange(60)
    current, ripple = 0.5 * n[None, :], 0.83 * (-1.0) ** n[None, :]
    assert fit.given(30 + ripple, current, 80e-6, TICK_S) == pytest.approx(np.full((1, 59), 30 + 80e-6 * 0.5 / TICK_S))


def test_a_mover_that_rocks_is_not_pushed() -> None:
    t = np.arange(4200) / 35e3
    rocking = 5e-6 * np.sin(2 * np.pi * 70 * t)
    assert moved(rocking, 18, 2100) < 0.2e-6
    assert moved(rocking + np.where(t > 0.07, 20e-6, 0), 18, 2100) == pytest.approx(20e-6, abs=0.4e-6)
    (found,) = checks.of_pushes([Pushed("R1_d", {"x1": 20e-6, "y1": 1e-6}, {"gamma": 5e-4})], Plan())
    assert (found.code, "x1 by 20 µm" in found.text, "y1" in found.text) == ("mover-pushed", True, False)
    (found,) = checks.of_pushes([Pushed("R1_d", {"x1": 1e-6}, {"gamma": 0.17})], Plan())
    assert (found.code, "gamma by 170 mrad" in found.text, "x1" in found.text) == ("mover-turned", True, False)


@pytest.mark.parametrize(
    ("along", "code"),
    [(np.zeros(9240), "stuck-channel"), (record(1.0), "current-not-stepped"), (record(2.2), "current-not-stepped"),
     (record(2.9), "current-not-settled"), (0.9 * record(3.0) + 0.1 * record(3.0, 8e-3), "current-not-settled")],
)  # fmt: skip
def test_a_step_that_is_none(along: fit.Array, code: str) -> None:
    found = list(checks.of_signals([taken(along)] * 4, Plan()))
    assert [f.code for f in found] == [code]
    assert list(checks.of_signals([taken(record(3.0))] * 4, Plan())) == []


def test_the_machine_does_what_the_paper_prints() -> None:
    """0.12 ms at 200 V with the phase at zero, q at rest, 4.06 kHz of the small signal; away from zero one phase more is at its
    limit. L VI-A and Fig. 6; U_DC, 1 A and 4 A as in docs/explanation/linear-rotary.md."""
    found = {}
    for angle in (0.0, 0.05):
        machine = Stepped(PlantParams(supply=200.0), ControlParams(supply_V=200.0), angle)
        along, across = machine.step("d_R1", 3.0)
        machine.step("d_R1", 0.0)
        found[angle] = rise(along / 3)
        assert abs(across[:200]).max() / 3 < 2e-3
        assert bandwidth(machine.step("d_R1", 0.3)[0] / 0.3) == pytest.approx(4060, rel=0.01)
    assert found[0.0] == pytest.approx(0.1203e-3, rel=0.005)
    assert found[0.05] == pytest.approx(0.1240e-3, rel=0.005)


def test_the_truth_is_recovered(tmp_path: Path) -> None:
    run = stepped(tmp_path)
    truth = truth_of_motion(run)
    assert wrong(run) == {}
    assert [r.code for r in run.results if isinstance(r, Finding)] == ["limit-touched"]
    measured = {
        f"{m.quantity.name}@{m.where}".removesuffix("@"): m.estimate for m in run.results if isinstance(m, Measured)
    }
    assert {name.partition("@")[0] for name in measured} == {q.name for q in MEASURES}
    assert measured.keys() == truth.keys()
    for name, estimate in measured.items():
        span = interval(estimate)
        assert abs(estimate.value - truth[name]) <= 1.5 * (span.high - span.low) / 2 + 1e-12, name
    assert measured["rise_time@R1_d"].u < 0.6e-6
    figures = list(procedure.drawn(run.recording))
    assert [f.key for f in figures] == ["step-R1_d", "small", "bridges-R1_d"]
    for figure in figures:
        assert draw_figure(figure)


@pytest.mark.parametrize(
    ("truth", "plan", "code"),
    [
        ({"coil_reversed": 2}, {}, "mover-pushed"),
        ({"exchange_phases": 1}, {}, "mover-turned"),
        ({"zero_off_ra": 0.4}, {}, "mover-turned"),
        ({"factor_current_max": 0.3}, {}, "limit-untouched"),
        ({}, {"size_A": 0.4}, "limit-untouched"),
        ({}, {"steps_at": ["L_d"], "hold_s": 0.03}, "small-step-limited"),
    ],
)
def test_what_is_planted_is_found(tmp_path: Path, truth: dict[str, float], plan: dict[str, Any], code: str) -> None:
    assert code in wrong(stepped(tmp_path, truth, **plan))


def test_plans_that_cannot_work_are_refused() -> None:
    rig = load_rig("rigs/lira-200v.toml")

    def said(**plan: Any) -> str:
        return "; ".join(check(rig, Plan(**plan)))

    assert said() == ""
    assert "found no R1_q; it has R1_d, B1_d, R2_d, B2_d, L_d" in said(steps_at=("R1_q",))
    assert "expected each place once" in said(steps_at=("R1_d", "R1_d"))
    assert "less than size_A" in said(small_A=3.0)
    assert "step_d_R1 is at most 5 A" in said(size_A=6.0)
    assert "half of hold_s" in said(response_s=0.01)
