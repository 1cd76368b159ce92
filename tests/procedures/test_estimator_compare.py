"""Estimators in the loop beside each other, through the whole path: their errors, a load, the ratios, and what is planted."""

from __future__ import annotations

import math
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from pydantic import ValidationError

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.errors import AnalysisError, BenchError
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.rigfile.roles import Status
from bench.uncertainty import Estimate, Influence, coverage_factor, interval
from procedures.estimator_compare import checks, estimates, fit
from procedures.estimator_compare.observers import predicted_ratio, ratio
from procedures.estimator_compare.plan import Plan
from procedures.estimator_compare.procedure import MEASURES, check, procedure, step_count
from procedures.estimator_compare.requires import HANG
from procedures.estimator_compare.steps import Taken
from procedures.one_axis.bank import bank
from procedures.one_axis.conventions import conventions
from reports.figures import draw as draw_figure
from sim_backend.controller.controls import in_force
from sim_backend.machines.amb1dof import truth_compare
from sim_backend.motion import CompareAsked
from sim_backend.truth import draw

TICK = 1e-4
RIGS = Path(__file__).resolve().parents[2] / "rigs"


def compared(folder: Path, seed: int = 1, truth: Mapping[str, float] | None = None, **plan: Any) -> Simulated:
    return simulated_run("estimator-compare", "amb1dof", seed, {"repeats": 3, **plan}, folder / "recording.mcap", truth)


def told(run: Simulated) -> dict[str, Estimate]:
    return {f"{m.quantity.name}@{m.where}": m.estimate for m in run.results if isinstance(m, Measured)}


def wrong(run: Simulated) -> set[str]:
    return {r.code for r in run.results if isinstance(r, Finding) and r.effect is not Effect.NOTE}


def test_the_thesis_findings_on_a_drawn_stand(tmp_path: Path) -> None:
    """Velocity and disturbance by more than 2.5 times, integral 1.65 to 1.85, peak 1.5 to 2.0; noise twice as much."""
    run = compared(tmp_path)
    assert wrong(run) == set()
    found = {name: e.value for name, e in told(run).items()}
    assert found["velocity_error_ratio@single / overlapping"] > 2.5
    assert found["disturbance_error_ratio@single / overlapping"] > 2.5
    assert 1.65 < found["integral_ratio@observer / overlapping"] < 1.85
    assert 1.5 < found["peak_ratio@observer / overlapping"] < 2.0
    assert found["integral_ratio@difference / overlapping"] == pytest.approx(1.0, abs=0.03)
    assert found["velocity_noise_ratio@observer / overlapping"] < 0.6
    assert {name.partition("@")[0] for name in found} == {q.name for q in MEASURES}
    assert {r.code for r in run.results if isinstance(r, Finding)} >= {"predicted-ratio", "noise-not-less"}
    figures = list(procedure.drawn(run.recording))
    assert [f.key for f in figures] == ["load", "switch", "repeats"]
    for figure in figures:
        assert draw_figure(figure)


def test_skewed_repeats_have_a_skewed_interval() -> None:
    """Logarithms 0, 1, 2: mean 1, u 1/sqrt 3, t 4.303 of two degrees of freedom: e^(1 -+ 2.484)."""
    found = estimates._typical(np.exp([0.0, 1.0, 2.0]), "m", "test")
    bounds = interval(found, 1)
    assert found.value == pytest.approx(math.e)
    assert math.log(bounds.low) == pytest.approx(1 - 2.484, abs=0.1)
    assert math.log(bounds.high) == pytest.approx(1 + 2.484, abs=0.1)


def test_what_is_told_in_metres_is_the_shafts_own(tmp_path: Path) -> None:
    """A sensor that reads 1 % too much, the end of its certificate: its reading of a load's integral is known to 0.1 %."""
    run = compared(tmp_path, 1, {"position.gain": 1.01})
    truth, found = truth_of_motion(run), told(run)
    for name in ("y_50_100@overlapping", "peak@overlapping", "integral@overlapping", "quiet@observer",
                 "velocity_noise@difference"):  # fmt: skip
        assert "sensors/position/gain" in found[name].contributions, name
        bounds = interval(found[name], 1)
        middle, half = (bounds.high + bounds.low) / 2, (bounds.high - bounds.low) / 2
        assert abs(truth[name] - middle) < 1.5 * half, name
    for name, e in found.items():
        if "ratio" in name or "error" in name:
            assert "sensors/position/gain" not in e.contributions, name
    integral = found["integral@overlapping"]
    assert integral.value / truth["integral@overlapping"] == pytest.approx(1.01, abs=0.004)
    assert 0.008 < interval(integral, 1).high / integral.value - 1 < 0.02


def test_the_truth_of_a_motion_is_that_of_the_shaft() -> None:
    """Read 1 % too great: the integral of its deviation is that of where its true velocity takes the shaft."""
    rig = load_rig("amb1dof")
    drawn = draw(rig, 3, {"position.gain": 1.01, "harmonic": 1e-9, "position_noise_peak": 1e-12})
    chosen = {"estimator": 0.0, "watched": -1.0}
    asked = CompareAsked({}, {}, {"difference": chosen}, "M1", 0.3, 2.5)
    plant = truth_compare._plant(drawn, in_force(rig, drawn.machine, chosen), 0, 1.0)
    plant.run(30000)
    plant.load(drawn.values["masses.M1"] * drawn.values["site.gravity"], drawn.values["load_rise_s"])
    moved = np.cumsum(plant.run(10000, 1)[1][:, truth_compare.AT["true_velocity"]]) * TICK
    truth = truth_compare.compare(rig, drawn, asked)
    assert truth["integral", "difference"] == pytest.approx(np.abs(moved).sum() * TICK, rel=2e-3)


@pytest.mark.long
@pytest.mark.timeout(300)
def test_the_truth_is_covered(tmp_path: Path) -> None:
    off: list[float] = []
    for seed in (2, 3, 4):
        (tmp_path / str(seed)).mkdir()
        run = compared(tmp_path / str(seed), seed, repeats=10)
        truth, found = truth_of_motion(run), told(run)
        assert truth.keys() == found.keys()
        for name, e in found.items():
            bounds = interval(e, seed)
            side = bounds.high - e.value if truth[name] > e.value else e.value - bounds.low
            off.append((truth[name] - e.value) / side)
    assert np.sqrt(np.mean(np.square(off))) < 0.8
    assert np.mean(np.abs(off) > 1) < 0.15


@pytest.mark.parametrize(
    ("truth", "code"),
    [
        ({"factor_degree": 6 / 7}, "not-this-estimator"),
        ({"estimate_late": 1}, "not-this-estimator"),
        pytest.param({"factor_estimator": 0.5}, "not-this-estimator", marks=pytest.mark.long),
        pytest.param({"factor_estimator": 1.5}, "not-this-estimator", marks=pytest.mark.long),
        pytest.param({"literal_weights": 1}, "not-this-estimator", marks=pytest.mark.long),
        pytest.param({"factor_window_s": 121 / 120}, "not-this-estimator", marks=pytest.mark.long),
    ],
)
def test_planted_defects_do_not_pass(tmp_path: Path, truth: dict[str, float], code: str) -> None:
    assert code in wrong(compared(tmp_path, 2, truth))


@pytest.mark.long
def test_filters_that_are_swapped_lose_the_body(tmp_path: Path) -> None:
    with pytest.raises(BenchError):
        compared(tmp_path, 2, {"filters_swapped": 1})


@pytest.mark.long
@pytest.mark.timeout(300)
@pytest.mark.parametrize(
    "seed", [*range(20, 24), *(pytest.param(seed, marks=pytest.mark.longer) for seed in range(24, 32))]
)
def test_the_ratios_of_the_thesis_on_drawn_stands(tmp_path: Path, seed: int) -> None:
    """B2 by 2.5 times with its interval, B3 1.65 to 1.85 and 1.5 to 2.0, on each stand."""
    run = compared(tmp_path, seed, repeats=6)
    found = {name: (e.value, coverage_factor(5) * e.u) for name, e in told(run).items()}
    for name in ("velocity_error", "disturbance_error"):
        value, wide = found[f"{name}_ratio@single / overlapping"]
        assert value - wide > 2.5
    for name, low, high in (("integral", 1.65, 1.85), ("peak", 1.5, 2.0)):
        value, wide = found[f"{name}_ratio@observer / overlapping"]
        assert low < value - wide
        assert value + wide < high


def test_the_exciter_is_found_among_what_the_resets_make() -> None:
    """40.13 Hz by captures of 0.3 s that have other lines of the same size, with a constant and noise."""
    rng, t = np.random.default_rng(3), np.arange(3000) * TICK
    some = [
        2 + np.sin(2 * math.pi * (40.13 * t + a)) + np.sin(2 * math.pi * (65.0 * t + b)) + 0.1 * rng.normal(size=3000)
        for a, b in rng.uniform(size=(20, 2))
    ]
    hz = fit.exciter_hz(some, 40.0, TICK)
    assert hz == pytest.approx(40.13, abs=0.03)
    with pytest.raises(AnalysisError, match="no exciter"):
        fit.exciter_hz(some, 43.0, TICK)
    assert fit.rms(fit.besides(some[0], hz, TICK)) == pytest.approx(math.sqrt(0.5 + 0.01), rel=0.05)


@pytest.mark.long
@pytest.mark.parametrize(
    ("truth", "said"), [({"load_lost": 1}, "expected a load"), ({"factor_compensate": 0}, "to come in")]
)
def test_what_does_not_happen_is_told(tmp_path: Path, truth: dict[str, float], said: str) -> None:
    with pytest.raises(AnalysisError, match=said):
        compared(tmp_path, 2, truth)


def test_the_derivative_delays_nothing() -> None:
    t = np.arange(4000) * TICK
    found = fit.derivative(np.sin(2 * math.pi * 40 * t), TICK)
    inside = np.isfinite(found)
    assert found[inside] == pytest.approx(80 * math.pi * np.cos(80 * math.pi * t)[inside], abs=0.01 * 80 * math.pi)
    assert fit.derivative(t * 2.0, TICK)[2000] == pytest.approx(2.0)


def test_the_switch_is_found_in_the_current() -> None:
    t, rng = np.arange(5000) * TICK, np.random.default_rng(1)
    y, v = 1e-4 * np.sin(250 * t), 0.025 * np.cos(250 * t)
    disturbance = 2 + np.sin(250 * t + 1)
    current = -1200 * y - 1.3 * v + 0.002 * rng.normal(size=5000)
    after = np.where(np.arange(5000) >= 3123, -disturbance / 31.0, 0.0)
    assert abs(fit.switched_at(current + after, y, v, disturbance, 3000, TICK) - 3123) <= 1
    with pytest.raises(AnalysisError, match="to come in"):
        fit.switched_at(current, y, v, disturbance, 3000, TICK)


def test_a_lead_that_leaves_nothing_to_judge_is_named() -> None:
    y = np.random.default_rng(1).normal(0, 1e-7, 15000)
    for found in (lambda: fit.moved_at(y, 1000, TICK), lambda: fit.switched_at(y, y, y, y, 1000, TICK)):
        with pytest.raises(AnalysisError, match=r"lead_s: found 0\.1 s"):
            found()
    with pytest.raises(ValidationError, match="lead_s"):
        Plan(lead_s=0.1)


@pytest.mark.long
def test_the_shortest_lead_can_be_analysed(tmp_path: Path) -> None:
    assert wrong(compared(tmp_path, 1, lead_s=0.2)) == set()


def capture(estimator: str, v: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> Taken:
    return Taken(HANG, estimator, 0, y, v, np.empty(0), np.empty(0), TICK, Status(0), 0, len(y))


def test_an_estimator_that_is_the_overlapping_one_is_told() -> None:
    """A controller that runs the two filters for the difference had both rooms alike: a ratio of 1.00, as the page says."""
    weights, rng = bank(7, 120, "euler", TICK), np.random.default_rng(2)
    whole = 1e-6 * np.sin(2 * math.pi * 40 * np.arange(6000) * TICK) + 1.3e-7 * rng.normal(size=6000)
    y, v = whole[239:], weights.applied(whole, 17)
    plain = np.gradient(y, TICK)
    found = [*checks.of_weights([capture("overlapping", v, y), capture("difference", v, y)], weights.rows)]
    assert [(f.code, f.where, f.effect) for f in found] == [("estimators-alike", "difference", Effect.INDETERMINATE)]
    assert [*checks.of_weights([capture("overlapping", v, y), capture("difference", plain, y)], weights.rows)] == []
    assert [f.code for f in checks.of_weights([capture("single", v, y)], weights.rows)] == ["estimators-alike"]


@pytest.mark.long
def test_a_controller_that_runs_the_overlapping_filters_for_the_difference(tmp_path: Path) -> None:
    shipped = (RIGS / "amb1dof.toml").read_text(encoding="utf-8")
    plain = "difference = { estimator = 0, watched = -1 }"
    assert plain in shipped
    shutil.copy(RIGS / "amb1dof.dbc", tmp_path)
    (tmp_path / "amb1dof.toml").write_text(
        shipped.replace(plain, "difference = { estimator = 2, watched = 2 }"), encoding="utf-8"
    )
    rig, chosen = str(tmp_path / "amb1dof.toml"), {"repeats": 3, "loaded": ("overlapping", "difference")}
    run = simulated_run("estimator-compare", rig, 1, chosen, tmp_path / "recording.mcap")
    assert wrong(run) == {"estimators-alike"}


def test_the_sensors_gain_makes_no_two_estimators_alike() -> None:
    """Noise of 1.9 and of 1.0, known to 0.1 %, by a sensor whose gain is known to 30 %."""
    gain = Estimate.of(1.0, Influence("sensors/position/gain", "gain", 0.3, "1", "B", "rectangular"))
    scatter = np.exp(0.003 * np.array([-1.0, 0.0, 1.0]))

    def of(ratio: float) -> list[Finding]:
        noise = {"observer": scatter, "difference": ratio * scatter}
        by = {e: estimates._told("velocity_noise", e, x, gain) for e, x in noise.items()}
        result = estimates.Result({}, {"velocity_error": {}, "velocity_noise": by}, {}, ())
        return [*checks._same(result, Plan(engaged=("single",), loaded=("observer", "difference")))]

    assert of(1.9) == []
    assert [f.code for f in of(1.0)] == ["estimators-alike"]


def test_what_the_poles_predict() -> None:
    assert ratio(0.4, 40.0, 100.0, -5.0, -400.0, -2500.0) == pytest.approx(1.753, abs=1e-3)
    assert ratio(0.4, 40.0, 100.0, -5.0, -400.0, -1000.0) == pytest.approx(2.991, abs=1e-3)
    assert ratio(0.4, 40.0, 100.0, -5.0, -400.0, -4000.0) == pytest.approx(1.464, abs=1e-3)
    rig = load_rig("amb1dof")
    assert predicted_ratio(rig, conventions(rig)) == pytest.approx(1.753, abs=1e-3)


@pytest.mark.parametrize(
    ("plan", "said"),
    [
        ({"engaged": ("single", "kalman")}, "found no kalman"),
        ({"loaded": ("observer", "observer")}, "each once"),
        ({"load": "M9"}, "M1"),
    ],
)
def test_a_plan_that_cannot_work_is_told(plan: dict[str, Any], said: str) -> None:
    assert any(said in line for line in check(load_rig("amb1dof"), Plan(**plan)))


def test_the_default_plan_fits() -> None:
    assert [*check(load_rig("amb1dof"), Plan())] == []
    assert step_count(Plan()) == 50
