"""Breakaway of a stage's axes: the bare model on made ramps, what a count delays by integration, planted troubles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import simulated_run
from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.rigfile.stage import axes_of
from bench.uncertainty import interval
from procedures.axis_breakaway import checks, estimates, fit
from procedures.axis_breakaway.estimates import Result
from procedures.axis_breakaway.plan import Plan
from procedures.axis_breakaway.procedure import check, figures, procedure, untold
from procedures.axis_breakaway.sequence import helix, pair, step_count
from procedures.axis_breakaway.steps import Ramp
from procedures.stages.map_bends import doubts

RIG = load_rig("rlsrm")
AXES = axes_of(RIG)
F_C, T_C = 1.5, 0.012
PULL, TURN = 2.4518, 0.036704  # N, N m of M2 with its hanger over a pulley, and of M1 on the disc
PLAN = Plan(repeats=4, helix=(1.0,))
NONE = np.zeros(len(doubts(RIG, 0.05)))


def made(plan: Plan = PLAN, up: float = 1.02, down: float = 0.97, path: bool = True, side: float = 0.0) -> list[Ramp]:
    """Ramps worked out without the fit: a newton of the map is `up` N pushing up and `down` N pushing down, 1 % more in every
    repeat; `side` N are needed both ways alike along."""
    out = []

    def one(axis: str, k: int, load: str, way: int, turned: int, share: float, push: Mapping[str, float]) -> None:
        force = {name: f / ((up if f > 0 else down) * (1 + 0.01 * k)) for name, f in push.items()}
        out.append(Ramp(axis, share, k, load, way, turned, axis, 3.0, force, dict.fromkeys(push, 0.0), dict.fromkeys(push,
        NONE),
                        False, ("HOLDING", "MOVING"), 0, 1000))  # fmt: skip

    for k in range(plan.repeats):
        for axis, friction, weight, names in (
            ("x", F_C, PULL, ("far", "near")),
            ("angle", T_C, TURN, ("left", "right")),
        ):
            for load, pull in (("", 0.0), (names[0], weight), (names[1], -weight)):
                for way in (1, -1):
                    one(axis, k, load, way, 0, 0.0, {axis: way * friction - pull + (side if axis == "x" else 0.0)})
        for share in plan.helix:
            f, t = (share, 1.0) if not path else (share / np.hypot(share, 1), 1 / np.hypot(share, 1))
            for way in (1, -1):
                for turned in (1, -1):
                    one("x", k, "", way, turned, share, {"x": way * f * F_C, "angle": turned * t * T_C})
    return out


def told(ramps: list[Ramp], plan: Plan = PLAN) -> tuple[dict[str, Finding], Result]:
    found = [*checks.of_ramps(ramps, RIG, plan)]
    result = estimates.results(ramps, RIG, plan)
    return {f.code: f for f in (*found, *checks.of_result(result, plan))}, result


def test_friction_and_no_map() -> None:
    """Whatever a newton of the map is, either way and from place to place; what both ways need alike is none of it."""
    for side in (0.0, 0.1):
        found, r = told(made(side=side))
        assert not found
        assert r.estimates["breakaway", "x"].value == pytest.approx(F_C, rel=1e-3)
        assert r.estimates["breakaway_angle", "angle"].value == pytest.approx(T_C, rel=1e-3)
    assert r.shares[0] == pytest.approx(1.0, abs=0.01)


def test_axes_that_rub_apart() -> None:
    """Each gives way by itself: both at their own breakaway are the square root of two of one friction along the path."""
    found, r = told(made(path=False))
    assert set(found) == {"axes-break-apart"}
    assert r.shares[0] == pytest.approx(2**0.5, rel=0.01)


def test_what_a_count_delays() -> None:
    """By integrating J a'' = R t in steps until a way is gone: the force is then as much more as is said."""
    inertia, count, per_s = 1.5e-3, 2.5e-3, 2.7e-3
    way = rate = t = 0.0
    step = 1e-5
    while way < count:
        rate += per_s * t / inertia * step
        way += rate * step
        t += step
    assert fit.beyond(inertia, count, per_s) == pytest.approx(per_s * t, rel=2e-3)
    shares = fit.beyond(inertia, count, per_s) * np.linspace(0, 1, 10001) ** (1 / 3)
    assert shares.mean() == pytest.approx(fit.MEAN * fit.beyond(inertia, count, per_s), rel=1e-3)


def test_what_a_count_leaves_is_a_force_in_the_budget() -> None:
    """By hand: of two ramps that are nearer by half of the width each, the breakaway is nearer by that; u = width/sqrt(12)."""
    rising = [replace(r, rises={"x": 2.0, "angle": 0.02}) for r in made()]
    _, r = told(rising)
    for (name, where), unit in ((("breakaway", "x"), "N"), (("breakaway_angle", "angle"), "N m")):
        e = r.estimates[name, where]
        ((count, c),) = ((i, c) for i, c in e.sensitivities.items() if i.id == f"counts/{where}")
        assert (count.unit, count.u) == (unit, pytest.approx(r.beyond[where] / 12**0.5))
        assert abs(c) == pytest.approx(1.0, abs=0.05)


def test_when_a_reading_changes() -> None:
    still = np.zeros(200)
    assert fit.broke_away(still, 1.0) is None
    gone = still.copy()
    gone[10], gone[120:] = 1.0, 1.0  # one flicker before
    gone[123:130] = 0.0  # and thrown back by the loop
    assert fit.broke_away(gone, 1.0) == 120
    assert fit.broke_away(gone, 2.0) is None
    gone[:5] = 0.5  # it goes on the other way at first
    assert fit.broke_away(gone, 1.0) == 120
    t = np.arange(200) * 1e-3
    assert fit.rise(t, 2 + 3 * t, 150) == pytest.approx(3)


def test_planted() -> None:
    some = made()
    assert "never-broke-away" in {f.code for f in checks.of_ramps([replace(some[0], moved=""), *some[1:]], RIG, PLAN)}
    assert "did-not-stick" in {f.code for f in checks.of_ramps([replace(some[0], after=0.01), *some[1:]], RIG, PLAN)}
    assert "not-served" in {f.code for f in checks.of_ramps([replace(some[0], limited=True), *some[1:]], RIG, PLAN)}
    assert "axis-not-held" in {
        f.code for f in checks.of_ramps([replace(some[0], states=("READY",)), *some[1:]], RIG, PLAN)
    }
    assert "ramps-missing" in {f.code for f in checks.of_ramps([], RIG, PLAN)}
    sides = {"far": "near", "near": "far"}
    assert "load-not-seen" in told([replace(r, load=sides.get(r.load, r.load)) for r in some])[0]
    with pytest.raises(AnalysisError):
        estimates.results(some[1:], RIG, PLAN)


def test_what_is_asked() -> None:
    assert not [*check(RIG, Plan())]
    assert "axes" in " ".join(check(RIG, Plan(axes=("y",))))
    assert "helix" in " ".join(check(RIG, Plan(helix=(1.0, 1.0))))
    assert [*check(RIG, Plan(span_m=0.1))]
    assert step_count(RIG, PLAN) == len(made())
    both = pair(RIG, PLAN)
    assert both is not None
    for share in (0.5, 2.0):
        path = helix(RIG, PLAN, both, share)
        assert path.slide["x"] / (8e-3 * path.slide["angle"]) == pytest.approx(share)  # as the surface slides
        assert 5400 * path.ramp["x"] / F_C / (1.35 * path.ramp["angle"] / T_C) == pytest.approx(
            share
        )  # of what each is held by
        assert path.slid["x"] / path.slide["x"] == pytest.approx(path.slid["angle"] / path.slide["angle"])
    assert not untold(RIG)
    assert procedure.lacking(load_rig("tsbs12"))


@pytest.mark.long
def test_the_whole_path(tmp_path: Path) -> None:
    """On a drawn rig, through loops and telemetry."""
    done = simulated_run("axis-breakaway", "rlsrm", 1, {"repeats": 4, "helix": [1.0]}, tmp_path / "r.mcap")
    assert [f.code for f in done.results if isinstance(f, Finding) and f.effect is not Effect.NOTE] == []
    true, off = truth_of_motion(done), {}
    for r in done.results:
        if isinstance(r, Measured):
            i = interval(r.estimate)
            key = f"{r.quantity.name}@{r.where}"
            off[key] = (r.estimate.value - true[key]) / (0.5 * (i.high - i.low))
    assert set(off) == {"breakaway@x", "breakaway_angle@angle", "path_share@helix 1"}
    assert max(map(abs, off.values())) < 2, off
    assert [f.key for f in figures(procedure.evaluated(done.recording).result, done.recording)] == [
        "circle", "breakaway-x", "breakaway-angle",
    ]  # fmt: skip
