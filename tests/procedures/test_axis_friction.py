"""Friction of a stage's axes: the bare model on made forces, the drawn machine's through the whole path, planted troubles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawn_figures import figures_drawn

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.rigfile.stage import axes_of
from bench.uncertainty import interval
from procedures.axis_friction import checks, estimates, fit
from procedures.axis_friction.estimates import RADIUS, Result
from procedures.axis_friction.plan import Plan
from procedures.axis_friction.procedure import check, procedure, untold
from procedures.axis_friction.sequence import chosen, ends, lead, loads, rates, start, step_count, window
from procedures.axis_friction.steps import Pass
from procedures.stages.map_bends import doubts

RIG = load_rig("rlsrm")
AXES = axes_of(RIG)
C, D, T_C, K, R_B = 1.5, 4.0, 0.012, 2e-3, 8e-3
PULL, TURN = 2.45, 0.0367
PLAN = Plan(repeats=4)
NONE = np.zeros(len(doubts(RIG, 0.05)))


def made(
    plan: Plan = PLAN, side: float = 0.0, up: float = 1.02, down: float = 0.97, path: bool = True, brake: float = 0.0,
    noise: float = 2e-4,
) -> list[Pass]:  # fmt: skip
    """Passes worked out without the fit: a newton of the map is `up` N pushing up and `down` N pushing down, and 1 % more in
    every repeat; `side` N are needed both ways alike along; `brake` N more friction along."""
    rng, out = np.random.default_rng(1), []

    def asked(push: float, k: int) -> float:
        return push / ((up if push > 0 else down) * (1 + 0.01 * k)) * (1 + noise * rng.normal())

    def one(
        axis: str, wanted: float, k: int, load: str, way: int, turned: int, x: float, a: float, v: float, w: float
    ) -> None:
        out.append(Pass(axis, wanted, k, load, way, turned, {"x": asked(x, k), "angle": asked(a, k)}, {"x": v, "angle": w},
                        1e-3, 0.0, {"x": NONE, "angle": NONE}, ("HOLDING", "MOVING"), 0, 100))  # fmt: skip

    pulls = {"far": PULL, "near": -PULL, "left": TURN, "right": -TURN}
    for k in range(plan.repeats):
        for way in (1, -1):
            for v in plan.rates_m_s:
                one("x", v, k, "", way, 0, way * (C + brake + D * v) + side, 1e-6, way * v, 0.0)
            for w in plan.rates_rad_s:
                one("angle", w, k, "", way, 0, 1e-6, way * (T_C + K * w), 0.0, way * w)
            for name in ("far", "near"):
                f = C + brake + D * plan.load_rate_m_s
                one(
                    "x", plan.load_rate_m_s, k, name, way, 0, way * 1.02 * f + side - pulls[name], 1e-6, way * 0.02, 0.0
                )
            for name in ("left", "right"):
                push = way * (T_C + K * plan.load_rate_rad_s) - pulls[name]
                one("angle", plan.load_rate_rad_s, k, name, way, 0, 1e-6, push, 0.0, way * 4.0)
            for w in plan.helix_rad_s:
                v, n = plan.helix_m_s, np.hypot(plan.helix_m_s, R_B * w)
                c, s = (v / n, R_B * w / n) if path else (1.0, 1.0)
                for turned in (1, -1):
                    x, a = way * (C * c + brake + D * v) + side, turned * (T_C * s + K * w)
                    one("x", w, k, "", way, turned, x, a, way * v, turned * w)
    return out


def solved(passes: list[Pass], plan: Plan = PLAN) -> Result:
    return estimates.results(passes, RIG, plan)


def told(passes: list[Pass], plan: Plan = PLAN) -> dict[str, Finding]:
    found = list(checks.of_passes(passes, RIG, plan))
    if not any(f.effect is Effect.ERROR for f in found):
        found += checks.of_result(solved(passes, plan), passes, plan)
    return {f.code: f for f in found}


def loud(found: Mapping[str, Finding]) -> set[str]:
    return {code for code, f in found.items() if f.effect is not Effect.NOTE}


def test_a_scale_of_its_own_each_way_is_in_nothing() -> None:
    """By hand: f = 1.6 and b = 0.05 under 2.45 N, one newton of the map 1.05 and 0.95 N; p = (1.65/1.05)/(2.5/1.05) = 0.66 and
    q = (1.55/0.95)/(2.4/0.95) = 0.64583. At f = W the ratios are 1, and say nothing of b."""
    p, q = np.array([[1.65 / 2.5, 1.0]]), np.array([[1.55 / 2.4, 1.0]])
    f, b = fit.balance(p, q, PULL, PULL)
    assert f == pytest.approx(np.array([[1.6, PULL]]))
    assert b == pytest.approx([0.05])


def test_one_friction_along_the_path() -> None:
    """5 mm/s and 5 rad/s at 8 mm: 5/sqrt(25 + 1600) = 0.124 of it along, 0.992 around."""
    along, around = fit.path(np.array([5e-3]), np.array([5.0]), R_B)
    assert (along[0], around[0]) == (pytest.approx(0.124, abs=5e-4), pytest.approx(0.9923, abs=1e-4))


def test_made_friction_is_found() -> None:
    """The map's scales are 5 % apart, and 1 % more in each repeat."""
    r = solved(made(side=0.04))
    x, a = r.friction["x"], r.friction["angle"]
    assert (x.coulomb, x.viscous) == (pytest.approx(C, rel=3e-3), pytest.approx(D, rel=0.03))
    assert (a.coulomb, a.viscous) == (pytest.approx(T_C, rel=3e-3), pytest.approx(K, rel=3e-3))
    assert x.bias == pytest.approx(0.04, abs=3e-3)
    assert r.radius == pytest.approx(R_B, rel=0.02)
    assert r.scales["x"] == pytest.approx(0.995 * 1.015, rel=3e-3)


def test_without_a_coulomb_term_it_would_be_all_viscous() -> None:
    """The trap by its size: C/v at the mean rate is some ten times D."""
    r = solved(made())
    at = r.friction["x"].at / r.data.axes["x"].rate
    assert at.mean() > 10 * r.friction["x"].viscous


def test_by_the_map_its_tolerance_is_the_uncertainty() -> None:
    plan = PLAN.model_copy(update={"scale": "map"})
    passes = [p for p in made(plan) if not p.load]
    e = solved(passes, plan).estimates["coulomb", "x"]
    assert e.u / e.value == pytest.approx(0.05 / np.sqrt(3) / np.sqrt(2), rel=0.1)  # of each way for itself
    assert abs(e.value - C) < 2 * e.u
    assert loads(RIG, AXES["x"], plan) == ()


def test_axes_that_rub_apart_are_found() -> None:
    found = told(made(path=False))
    assert loud(found) == {"axes-rub-apart"}
    assert "one axis has a friction of its own" in found["axes-rub-apart"].text


def test_a_brake_on_one_axis_is_found() -> None:
    """0.9 N more along, which no turning takes off."""
    assert loud(told(made(brake=0.6))) == {"axes-rub-apart"}


def test_what_findings_need() -> None:
    sound = made()
    assert loud(told(sound)) == set()
    assert "force-scale" in told(sound)
    assert loud(told([])) == {"passes-missing"}
    assert loud(told([replace(sound[0], states=("FAULT",)), *sound[1:]])) == {"axis-not-held"}
    assert loud(told([replace(sound[0], lost=5), *sound[1:]])) == {"missing-samples"}
    assert loud(told([replace(sound[0], uneven=0.2), *sound[1:]])) == {"rate-uneven"}
    assert loud(told([replace(sound[0], limited=0.5), *sound[1:]])) == {"not-served"}
    assert loud(told(sound, PLAN.model_copy(update={"max_u": 1e-6}))) == {"friction-not-shown"}
    light = [replace(p, force={**p.force, "x": -p.force["x"]}) if p.load == "far" and p.way > 0 else p for p in sound]
    assert "load-too-light" in loud(told(light))
    with pytest.raises(AnalysisError, match="found 0 passes; expected 1"):
        solved(sound[1:])


def test_offsets_of_currents_are_in_the_budget() -> None:
    """A phase that gives 0.3 N/A less under friction alone: 11.5 mA of it are 3.5 mN of Coulomb friction."""
    moved = [replace(p, moves={**p.moves, "x": -np.sign(p.force["x"]) * np.array([0.3, *NONE[1:]])}) if not p.load else p
             for p in made()]  # fmt: skip
    e = solved(moved).estimates["coulomb", "x"]
    assert abs(e.contributions["sensors/i_a1/offset"]) == pytest.approx(0.3 * 0.02 / np.sqrt(3), rel=0.1)


def test_where_axes_go() -> None:
    """By hand: 35 mm/s reach their rate in 0.61 mm and go 7 mm more; the window is 5 mm to each side."""
    assert lead(AXES["x"], Plan(), 0.035, 0.2) == pytest.approx(7.6125e-3)
    assert ends(AXES["x"], Plan(), 0.035, 0.2) == (pytest.approx(-0.0126125), pytest.approx(0.0126125))
    assert window(AXES["angle"], Plan(turns=2)) == (0.0, pytest.approx(4 * np.pi))
    quarters = sorted(start(AXES["angle"], Plan(), k) / (np.pi / 2) % 1 for k in range(8))
    assert np.diff(quarters) == pytest.approx(np.full(7, 1 / 8))  # neither a turn nor a quarter comes again
    assert step_count(RIG, Plan()) == 16 * (4 + 4 + 2 + 2 + 6)
    assert [rates(a, Plan())[0] for a in chosen(RIG, Plan(axes=("angle",)))] == [2.0]


def test_refusals() -> None:
    assert procedure.lacking(RIG) == ()
    assert list(check(RIG, Plan())) == []
    assert "found y" in next(iter(check(RIG, Plan(axes=("y",)))))
    assert "found mass 'M9'" in next(iter(check(RIG, Plan(mass="M9"))))
    assert "ascending" in next(iter(check(RIG, Plan(rates_m_s=(0.02, 0.01)))))
    assert "x_target" in next(iter(check(RIG, Plan(rates_m_s=(0.02, 0.06)))))
    bare = RIG.model_copy(update={"hooks": {}})
    assert "do not pull x both ways" in next(iter(check(bare, Plan())))
    assert untold(RIG) == ()
    assert any("role motion" in line for line in procedure.lacking(load_rig("lira")))


SHORT = {"repeats": 4, "rates_m_s": [0.015, 0.035], "rates_rad_s": [3.0, 12.0], "helix_rad_s": [2.25, 7.5]}


def run(folder: Path, seed: int, truth: Mapping[str, float] | None = None, **plan: Any) -> Simulated:
    return simulated_run("axis-friction", "rlsrm", seed, {**SHORT, **plan}, folder / "recording.mcap", truth)


def off(done: Simulated) -> dict[str, float]:
    """Errors in U, by name."""
    out, true = {}, truth_of_motion(done)
    for r in done.results:
        if isinstance(r, Measured):
            i = interval(r.estimate)
            name = r.quantity.name + (f"@{r.where}" if r.where else "")
            out[name] = (r.estimate.value - true[name]) / ((i.high - i.low) / 2)
    return out


def test_a_drawn_machine(tmp_path: Path) -> None:
    done = run(tmp_path, 3)
    assert {r.code for r in done.results if isinstance(r, Finding)} == {"force-scale"}
    assert len(off(done)) == 7
    assert all(abs(x) < 1.5 for x in off(done).values()), off(done)
    assert figures_drawn(done) == ["friction-x", "friction-angle", "helix"]


def test_a_single_axis(tmp_path: Path) -> None:
    done = run(tmp_path, 4, axes=["x"], helix=False)
    assert set(off(done)) == {"coulomb@x", "viscous@x", "one_sided@x"}
    assert all(abs(x) < 1.5 for x in off(done).values()), off(done)


@pytest.mark.long
@pytest.mark.parametrize(
    "planted",
    [
        {"along_path": 0.0},
        *(pytest.param(p, marks=pytest.mark.longer) for p in ({"brake_x": 0.8}, {"brake_angle": 6e-3})),
    ],
)
def test_planted_friction(tmp_path: Path, planted: Mapping[str, float]) -> None:
    done = run(tmp_path, 5, planted)
    assert "axes-rub-apart" in loud({r.code: r for r in done.results if isinstance(r, Finding)})
    assert RADIUS in {r.quantity.name for r in done.results if isinstance(r, Measured)}
