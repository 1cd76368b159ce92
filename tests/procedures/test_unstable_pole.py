"""The unstable pole: the bare model by another way to its solution, the machine's own pole, the whole path, what is planted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.uncertainty import interval
from procedures.unstable_pole import checks, estimates, fit
from procedures.unstable_pole.hold import ability, foreseen
from procedures.unstable_pole.plan import Plan
from procedures.unstable_pole.procedure import check, order, procedure
from procedures.unstable_pole.steps import Taken
from reports.figures import draw as draw_figure
from sim_backend.machines.lira.params import PlantParams
from sim_backend.machines.lira.plant import Plant, ideal
from sim_backend.machines.lira.quantities import quantities

STEP_S = 1 / 35e3
REDUCED = {"reduced": 1.0}
MASS, TURN, PLANE, PROBE = 1.34, 2.91e-3, 0.045, 0.046


def run(folder: Path, truth: Mapping[str, float] | None = None, seed: int = 1, **plan: Any) -> Simulated:
    return simulated_run(
        "unstable-pole", "lira", seed, {"shots": 8, **plan}, folder / "recording.mcap", {**REDUCED, **(truth or {})}
    )


def codes(done: Simulated, least: Effect = Effect.INDETERMINATE) -> set[str]:
    strong = [e for e in Effect if e is not Effect.NOTE] if least is not Effect.NOTE else list(Effect)
    return {r.code for r in done.results if isinstance(r, Finding) and r.effect in strong}


def released(first: float, second: float, off: float, turn: float = TURN) -> tuple[fit.Array, float]:
    """L in u and d by the definitions, 1/s^2, and K/m."""
    s = np.array([PLANE - off, -PLANE - off])
    k = np.array([first, second])
    a = np.array([[k.sum() / MASS, k @ s / MASS], [k @ s / turn, k @ s**2 / turn]])
    t = np.array([[1, -off], [0, PROBE]])
    return t @ a @ np.linalg.inv(t), float(a[0, 0])


@pytest.mark.parametrize(("first", "second", "off"), [(375e3, 375e3, 0.0), (397e3, 353e3, 1e-3), (353e3, 397e3, -3e-3)])
def test_the_solution_is_that_of_the_equation(first: float, second: float, off: float) -> None:
    """Beside the exponential of the whole system, also where both roots are one."""
    square, _ = released(first, second, off)
    t = np.arange(140) * STEP_S
    starts, forces = fit.basis(square, t)
    z0, rate, f = np.array([1e-7, -2e-7]), np.array([1e-3, 5e-4]), np.array([1.4, 0.1])
    whole = np.zeros((6, 6))
    whole[:2, 2:4], whole[2:4, :2], whole[2:4, 4:] = np.eye(2), square, np.eye(2)
    expected = np.array([(expm(whole * at) @ np.concatenate([z0, rate, f]))[:2] for at in t])
    found = starts @ np.concatenate([z0, rate * t[-1]]) + forces @ f
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-15)


def shots(square: fit.Array, count: int, tilted: float, noise: float = 0.0) -> list[fit.Shot]:
    rng = np.random.default_rng(1)
    starts, forces = fit.basis(square, np.arange(120) * STEP_S)
    out = []
    for k in range(count):
        held = (1 - 2 * (k % 2)) * 0.25 + rng.normal(0, 0.02, 2)
        push = 2.75 * np.array([held.sum(), held[0] - held[1] + tilted * held.sum()])
        z = starts @ rng.normal(0, 3e-7, 4) * np.array([1, 1]) + forces @ push
        out.append(fit.Shot((z + rng.normal(0, noise, z.shape))[: 100 + k % 20], held))
    return out


@pytest.mark.parametrize("tilted", [0.0, 1.0])
def test_planes_that_differ_spoil_nothing(tilted: float) -> None:
    """The in-phase pole by the formula of the centre of mass off the middle, without noise; u alone would be 0.6 % off."""
    square, pole = released(353e3, 397e3, 3e-3)
    found = fit.release(shots(square, 12, tilted, 1e-12), STEP_S, 748.0)
    assert found.square[0, 0] + 3e-3 / PROBE * found.square[1, 0] == pytest.approx(pole, rel=1e-4)
    assert abs(found.square[0, 0] / pole - 1) > 3e-3


def test_the_stated_uncertainty_is_that_of_many() -> None:
    square, pole = released(385e3, 370e3, 0.0)
    errors = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        noisy = [replace(s, z=s.z + rng.normal(0, 2.2e-7, s.z.shape)) for s in shots(square, 16, 0.0)]
        found = fit.release(noisy, STEP_S, 748.0)
        errors.append((found.square[0, 0] - pole) / math.sqrt(found.covariance[0, 0]))
    assert np.std(errors) == pytest.approx(1.0, abs=0.3)
    assert abs(np.mean(errors)) < 0.5


def test_what_tells_nothing() -> None:
    square, _ = released(375e3, 375e3, 0.0)
    with pytest.raises(AnalysisError, match="found 4 shots"):
        fit.release(shots(square, 4, 0.0), STEP_S, 748.0)
    still = [fit.Shot(np.zeros((100, 2)), np.zeros(2))] * 8
    with pytest.raises(AnalysisError, match="do not move"):
        fit.release(still, STEP_S, 748.0)


def test_the_machine_leaves_its_middle_as_its_truth_says() -> None:
    """Linearised: accelerations of the machine itself beside its middle, in both directions; nominal 748.13 1/s, as printed."""
    assert quantities(PlantParams())["lambda"] == pytest.approx(748.13, abs=0.005)
    p = replace(
        ideal(PlantParams(pull=(397e3, 361e3), mass=1.337, gravity=0.0, cogging_force=0.0)), transverse_inertia=1e9
    )
    for way in "xy":
        plant = Plant(p)
        plant.put(z=p.middle, **{way: 1e-6})
        plant.run(1 / 280_000)
        rate = plant.place[6 + "xy".index(way)]
        assert math.sqrt(rate * 280_000 / 1e-6) == pytest.approx(quantities(p)["lambda"], rel=1e-4)


def test_the_truth_is_recovered(tmp_path: Path) -> None:
    done = run(tmp_path, shots=16)
    assert codes(done) == set()
    truth = truth_of_motion(done)
    measured = {f"{r.quantity.name}@{r.where}": r.estimate for r in done.results if isinstance(r, Measured)}
    assert measured.keys() == truth.keys() == {"pole@x", "pole@y", "stiffness@x", "stiffness@y"}
    for name, estimate in measured.items():
        span = interval(estimate)
        assert abs(estimate.value - truth[name]) <= 1.5 * (span.high - span.low) / 2, name
    assert measured["pole@x"].u < 0.01 * measured["pole@x"].value
    figures = list(procedure.drawn(done.recording))
    assert [f.key for f in figures] == ["shots-x", "shots-y"]
    for figure in figures:
        assert draw_figure(figure)


@pytest.mark.parametrize(
    ("truth", "plan", "code"),
    [({"hold_one_plane": 1.0}, {}, "tilt-excited"), ({"hold_deaf": 1.0}, {"patience_s": 0.1}, "hold-not-seen"),
     ({}, {"push_A": 0.02}, "grew-too-little")],
)  # fmt: skip
def test_what_is_planted_is_found(tmp_path: Path, truth: dict[str, float], plan: dict[str, Any], code: str) -> None:
    assert code in codes(run(tmp_path, truth, **plan))


def taken(**of: Any) -> Taken:
    z = np.column_stack([np.linspace(0, 15e-6, 80), np.zeros(80)])
    known: dict[str, Any] = {
        "number": 0, "axis": "x", "push": 0.25, "step_s": STEP_S, "z": {"x": z, "y": z}, "held": np.zeros(4), "moved": 0.0,
        "seen": 140, "early": False, "farthest": 15e-6, "caught": 1e-6, "states": ("LEVITATED",), "lost": 0, "expected": 100,
    }  # fmt: skip
    return Taken(**{**known, **of})


@pytest.mark.parametrize(
    ("of", "code"),
    [({"seen": 0}, "hold-not-seen"), ({"caught": 60e-6}, "not-caught"), ({"states": ("FAULT",)}, "not-caught"),
     ({"moved": 0.1}, "limited"), ({"lost": 5}, "missing-samples"), ({"early": True}, "hold-ended-early")],
)  # fmt: skip
def test_a_shot_that_is_none(of: dict[str, Any], code: str) -> None:
    rig, plan = load_rig("lira"), Plan()
    assert list(checks.of_signals([taken()] * 4, rig, plan)) == []
    assert [f.code for f in checks.of_signals([taken(**of)] * 4, rig, plan)] == [code]
    assert [f.code for f in checks.of_signals([], rig, plan)] == ["no-shots"]


@pytest.mark.parametrize("tilted", [0.0, 0.5])
def test_growth_and_tilt_by_the_side_of_the_push(tilted: float) -> None:
    """Whatever the starts are: 5.5 x 0.25 m/s^2 for 99 samples, cosh(748 t) - 1 over 748^2 of it; planes alike, no coupling."""
    square, _ = released(375e3, 375e3, 0.0)
    some = shots(square, 16, tilted, 1e-8)
    found = fit.release(some, STEP_S, 748.0)
    known = [taken(z={"x": s.z}, held=s.held, push=math.copysign(0.25, 0.5 - k % 2)) for k, s in enumerate(some)]
    (growth, u), (tilt, _) = estimates.went(known, "x", found)
    mean = np.mean([(1 - 2 * (k % 2)) * s.held.mean() for k, s in enumerate(some)])
    expected = 5.5 * mean * (math.cosh(748.13 * 99 * STEP_S) - 1) / 748.13**2
    assert growth == pytest.approx(expected, rel=0.02)
    assert tilt / growth == pytest.approx(0.96 * tilted, abs=0.05)
    assert u < 0.05 * growth


def test_order_is_against_drift() -> None:
    """Straight drift, the same in both ways, of either axis."""
    sent = list(order(load_rig("lira"), Plan(shots=8)))
    for axis in "xy":
        at = [(k, push) for k, (a, push) in enumerate(sent) if a == axis]
        assert len(at) == 8
        assert sum(push for _, push in at) == 0
        assert sum(k * push for k, push in at) == 0


def test_a_shot_that_is_not_caught_is_refused() -> None:
    """a = 2 x 3.7 N/A x 0.25 A / 750 N/mm = 2.47 um; 4 ms at 748.1 1/s make it 22.2 um, and 46.7 um with its rate. The bearings
    reach 26.2 N / 397 N/mm less 5 um, 61.0 um; a fifth is kept."""
    rig = load_rig("lira")
    f = foreseen(rig, Plan(), ability(rig).axes["x"])
    assert (f.pole, f.travel * 1e6, f.to_catch * 1e6) == pytest.approx((748.13, 22.2, 46.7), rel=5e-3)
    assert (f.reach * 1e6, f.at_bound * 1e6) == pytest.approx((61.0, 42.5), rel=5e-3)

    def said(**plan: Any) -> str:
        return "; ".join(check(rig, Plan(**plan)))

    assert said() == ""
    assert "push_A: 0.5 A for 4 ms take x 44 µm off" in said(push_A=0.5)
    assert "hold_s" not in said(push_A=0.5)
    assert "push_A: 0.25 A for 5 ms" in said(hold_s=5e-3)
    assert "bound_m: a reading of 30 µm goes on" in said(bound_m=30e-6)
    assert "found u; the controller holds along x, y" in said(axes=("u",))
    assert "observer: found 'none'" in said(observer="none")
    assert "expected skip_s and least_s" in said(hold_s=1.5e-3, push_A=0.25)
