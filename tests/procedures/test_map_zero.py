"""Zeros of stators: the bare estimate on made rests, through the whole path, what is planted."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawn_figures import figures_drawn

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.uncertainty import interval
from procedures.map_zero import checks, estimates
from procedures.map_zero.approaches import Approach, approaches, ramp
from procedures.map_zero.plan import Plan
from procedures.map_zero.procedure import check, procedure, steps_on
from procedures.map_zero.steps import Rest

RIG = load_rig("rlsrm")
PLAN = Plan()
COUNT = math.radians(0.144)
ZERO = {"stator1": 5e-3, "stator2": -3e-3}


def rests(band: float = 9e-3, once: float = 9e-4, steady: float = 0.0, moved: Callable[[Approach], float] | None = None,
          **changes: Any) -> list[Rest]:  # fmt: skip
    """By hand: the zero, what friction leaves at a current (as 16 A^2/i^2 of the band), an encoder that is off once a turn, and
    counts; `steady` is what a torque on the shaft moves at 4 A."""
    out = []
    for a in approaches(RIG, PLAN):
        for level in PLAN.levels_A:
            share = 16 / level**2
            at = a.aligned + ZERO[a.phase.motor] + (a.side * band + steady) * share + once * math.cos(a.aligned - 0.4)
            read = round((at + (moved(a) if moved is not None else 0.0)) / COUNT) * COUNT
            out.append(Rest(a, level, read, 0.0, 0.0, level, ("READY",), 0, 100, **changes))
    return out


def told(some: Sequence[Rest]) -> dict[str, Finding]:
    found = [*checks.of_signals(some, RIG, PLAN)]
    if not any(f.effect is Effect.ERROR for f in found):
        found += checks.of_order(some, RIG, PLAN)
    if not any(f.effect is Effect.ERROR for f in found):
        found += checks.of_results(estimates.stators(some, RIG), some, RIG, PLAN)
    return {f.code: f for f in found}


def loud(found: Mapping[str, Finding]) -> set[str]:
    return {code for code, f in found.items() if f.effect is not Effect.NOTE}


def test_the_mean_of_both_sides() -> None:
    """Friction of half a degree and an encoder that is off by 0.05 degrees cost the zero a few counts' rounding."""
    some = rests()
    assert loud(told(some)) == set()
    for s in estimates.stators(some, RIG):
        zero, band = s.estimates["zero"], s.estimates["band"]
        assert zero.value == pytest.approx(ZERO[s.motor], abs=3 * zero.u)
        assert zero.u < 3e-4
        assert band.value == pytest.approx(9e-3, abs=3 * band.u)
    one_side = np.mean(
        [estimates.off(r) for r in some if r.approach.side > 0 and r.level == 4.0 and r.approach.phase.stator == 0]
    )
    assert one_side - ZERO["stator1"] == pytest.approx(9e-3, abs=1e-3)  # what one side alone would tell


def test_what_goes_once_a_turn_is_taken_off() -> None:
    angles = np.radians(np.arange(0, 360, 30))
    value, u, dof = estimates.mean_around(0.2 + 0.05 * np.cos(angles - 1), angles)
    assert value == pytest.approx(0.2)
    assert u == pytest.approx(0, abs=1e-12)
    assert dof == 9
    assert estimates.mean_around(np.array([1.0, 2.0, 3.0]), angles[:3]) == pytest.approx((2.0, 1 / math.sqrt(3), 2.0))


def test_planted() -> None:
    def exchanged(a: Approach) -> float:
        return math.radians({"B1": 30, "C1": -30}.get(a.phase.name, 0))

    assert loud(told(rests(moved=exchanged))) == {"phase-draws-elsewhere"}
    assert {"steady-torque"} <= loud(told(rests(steady=4e-3)))
    assert loud(told(rests(band=0.034))) == {"friction-wide"}
    assert loud(told(rests(band=-9e-3))) == {"swings-past"}
    some = rests()
    stuck = [replace(r, angle=r.approach.aligned + r.approach.side * PLAN.start_rad) for r in some]
    assert loud(told(stuck)) == {"shaft-stuck"}
    assert loud(told([replace(r, current=-r.level) for r in some])) == {"current-reversed"}
    assert loud(told([replace(r, current=0.5 * r.level) for r in some])) == {"current-not-given"}
    assert loud(told([replace(some[0], went=0.02), *some[1:]])) == {"shaft-not-at-rest"}
    assert loud(told([replace(some[0], states=("HOLDING",)), *some[1:]])) == {"loops-on"}
    assert loud(told([replace(some[0], lost=50), *some[1:]])) == {"missing-samples"}
    assert loud(told([])) == {"no-approaches"}
    assert loud(told([r for r in some if r.approach.side > 0 or r.approach.phase.stator])) == {"too-few-alignments"}
    aside = rests(moved=lambda a: 0.08 if (a.phase.name, a.tooth) == ("A2", 2) else 0.0)
    assert loud(told(aside)) == {"alignment-apart"}


def test_ways_in() -> None:
    """Every phase and tooth from both sides, by currents that grow by steps; each level is read once."""
    all_of = approaches(RIG, PLAN)
    assert len(all_of) == 6 * 4 * 2
    assert len({(a.phase.name, a.tooth, a.side) for a in all_of}) == len(all_of)
    assert steps_on(RIG, PLAN) == len(all_of) * 4
    currents = [c for c, _ in ramp(PLAN)]
    assert [c for c, reads in ramp(PLAN) if reads] == list(PLAN.levels_A)
    assert max(b / a for a, b in pairwise(currents)) < PLAN.growth**2
    assert currents == sorted(currents)


def test_the_whole_path(tmp_path: Path) -> None:
    done = simulated_run("map-zero", "rlsrm", 2, {}, tmp_path / "r.mcap")
    found = [r for r in done.results if isinstance(r, Finding)]
    assert [f.code for f in found if f.effect is not Effect.NOTE] == []
    true, seen = truth_of_motion(done), 0
    for r in done.results:
        if isinstance(r, Measured):
            seen += 1
            if r.quantity.name == "zero":
                i = interval(r.estimate)
                assert abs(r.estimate.value - true[f"zero@{r.where}"]) < 1.5 * 0.5 * (i.high - i.low)
            else:  # a little less than T_c/(k q): each step of the ramp carries the shaft on
                q = 16 / (math.sqrt(1 + (4 / 8.5) ** 2) + 1)
                assert 0.75 < r.estimate.value / (done.truth["T_c"] / (q * 0.13)) < 1.1
    assert seen == 4
    assert figures_drawn(done) == ["alignments", "levels"]


def test_refused() -> None:
    assert not [*check(RIG, PLAN)]
    assert [*check(RIG, Plan(levels_A=(2.0, 3.0, 9.0)))]
    assert [*check(RIG, Plan(first_A=3.0))]
    assert [*check(RIG, Plan(teeth=(0, 0)))]
    assert procedure.lacking(load_rig("tsbs12"))
