"""Loads on a stage: the bare model, what is planted in made data, the whole path on the simulated motor."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from bench.errors import AnalysisError
from bench.findings import Effect
from bench.rigfile import RigFile, load_rig
from bench.rigfile.stage import StageAxis, axes_of
from bench.uncertainty import interval
from procedures.load_response import checks, estimates, fit
from procedures.load_response.plan import Plan
from procedures.load_response.procedure import check, left_out, procedure
from procedures.load_response.sequence import Put, lead, order
from procedures.load_response.steps import Change, Rest
from procedures.shared.weight import weight
from procedures.stages.known_loads import force, load_inputs, rubbing, sources

PLAN = Plan()
KP = {"x": 5400.0, "angle": 1.35}
WAYS = {"x": "along", "angle": "around"}
FRICTION = {"x": 1.4, "angle": 0.012}


@cache
def rig() -> RigFile:
    return load_rig("rlsrm")


def axis(name: str) -> StageAxis:
    return axes_of(rig())[name]


def known(name: str) -> dict[str, float]:
    return {key: e.value for key, e in load_inputs(rig(), sources(rig(), axis(name)), ("M1", "M2", "M3")).items()}


def made(name: str, *, scale: float = 1.04, friction: float | None = None, plan: Plan = PLAN, constant: float = 0.0,
         error: Mapping[str, float] | None = None, swapped: bool = False, counts: bool = False, brake: bool = False,
         integrator: float = 1.0, rubs: float | None = None, seed: int = 1) -> list[Rest]:  # fmt: skip
    """Approaches of a made axis: s k e = P + R, with R opposite both ways; with `counts` it stops at whole ones."""
    one, p, rng, out = axis(name), known(name), np.random.default_rng(seed), []
    kp, pitch = KP[name], one.pitch.value if one.pitch is not None else 0.0
    holds = FRICTION[name] if friction is None else friction
    for phase in range(plan.phases):
        for load in order(rig(), one, plan):
            true = constant
            if load.source is not None:
                way = -1 if swapped else 1
                true += way * force(load.source, load.label, p) * (1 + (error or {}).get(load.label, 0.0))
            rub = holds + (0.0 if load.source is None else _rubs(load, p, rubs))
            at = (phase + 0.5) / plan.phases * pitch
            for side in (1, -1):
                reading = at + (true - side * rub) / (scale * kp)
                if counts:  # the first count at which friction holds
                    reading = side * math.ceil(side * reading / pitch) * pitch
                elif not brake:
                    reading += rng.normal(0, 1e-9)
                moved = 0.0 if brake else side * 0.8 * lead(one, plan)
                given = integrator * kp * (at - reading)
                out.append(Rest(
                    axis=name, source="" if load.source is None else load.source.name, load=load.label, phase=phase, at=at,
                    stiffness=kp, limited=0.0, states=("HOLDING",), lost=0, expected=300, side=side, reading=reading,
                    reference=at, given=given, asked=given, drift=0.0, moved=moved,
                ))  # fmt: skip
    return out


def _rubs(load: Put, p: Mapping[str, float], rubs: float | None) -> float:
    assert load.source is not None
    share = rubbing(load.source, load.label, p)
    return share if rubs is None or load.source.turns else abs(force(load.source, load.label, p)) * rubs


def found(name: str, rests: list[Rest], plan: Plan = PLAN) -> estimates.Result:
    only = plan.model_copy(update={"disturbed": False, "axes": WAYS[name]})
    return estimates.results(rests, [], rig(), only)


def told(r: estimates.Result, rests: list[Rest]) -> dict[str, Effect]:
    return {f.code: f.effect for f in checks.of_result(r, rests, PLAN)}


def test_forces_by_hand() -> None:
    """0.4 kg and a cord of 0.5 g in air: 3.92 N less a third of a degree's cosine; 25 mm of it around, without a cord."""
    p = known("x")
    far, near = sources(rig(), axis("x"))
    newtons = float(weight(0.4005, 9.7877, 1.18, 7950.0))
    assert newtons == pytest.approx(
        0.4005 * 9.7877 * (1 - 1.18 / 7950) * (1 - 1.2 / 8000) / (1 - 1.2 / 7950), rel=1e-12
    )
    assert force(far, "M3", p) == pytest.approx(newtons * (1 - math.radians(1) ** 2 / 6), rel=1e-12)
    assert force(near, "M3", p) == -force(far, "M3", p)
    assert rubbing(far, "M3", p) == pytest.approx(0.01 * newtons, rel=1e-3)
    p, (left, right) = known("angle"), sources(rig(), axis("angle"))
    assert (left.name, left.sign, right.sign) == ("left", 1, -1)
    assert force(left, "M3", p) == pytest.approx(0.025 * float(weight(0.4, 9.7877, 1.18, 7950.0)), rel=1e-12)
    assert rubbing(left, "M3", p) == 0.0


def test_the_cosine_of_a_small_angle() -> None:
    """Its mean and scatter over 1 degree either way."""
    a = np.radians(np.random.default_rng(1).uniform(-1, 1, 200_000))
    e = load_inputs(rig(), sources(rig(), axis("x")), ("M3",))["along_far"]
    assert 1 - e.value == pytest.approx(1 - np.cos(a).mean(), rel=0.01)
    assert e.u == pytest.approx(np.cos(a).std(), rel=0.01)


@pytest.mark.parametrize("name", ["x", "angle"])
def test_the_spring_is_turned_around(name: str) -> None:
    """Compliance 1/(s k), band F/(s k) and half a count, the scale itself; a constant force is in none of them."""
    rests = made(name, constant=0.02 * FRICTION[name])
    r, turns = found(name, rests), name == "angle"
    value = {key: e.value for (key, _), e in r.estimates.items()}
    end = "_angle" if turns else ""
    half = axis(name).pitch.value / 2  # type: ignore[union-attr]
    assert value[f"compliance{end}"] == pytest.approx(1 / (1.04 * KP[name]), rel=1e-6)
    assert value["force_scale"] == pytest.approx(1.04, rel=1e-6)
    rub = 0.0 if turns else np.mean([0.0, 2.4526, 3.92, 2.4526, 3.92, 0.0]) * 0.01
    assert value[f"friction_band{end}"] == pytest.approx((FRICTION[name] + rub) / (1.04 * KP[name]) + half, rel=1e-4)
    held = value["friction_torque" if turns else "friction"]
    assert held == pytest.approx(FRICTION[name] + half * 1.04 * KP[name], rel=1e-4)
    assert told(r, rests) == {}


def test_counts_average_out() -> None:
    """Of 0.144 degrees, 28 % of the friction band: the compliance and, by half a count, friction hold."""
    rests = made("angle", counts=True, plan=Plan(phases=8))
    r = found("angle", rests, Plan(phases=8))
    assert r.estimates["compliance_angle", "angle"].value == pytest.approx(1 / (1.04 * 1.35), rel=0.01)
    e = interval(r.estimates["friction_torque", "angle"])
    assert e.low < FRICTION["angle"] < e.high
    assert r.estimates["friction_torque", "angle"].value == pytest.approx(FRICTION["angle"], rel=0.05)


def test_stiffness_and_scale_are_one_number() -> None:
    """Their product with the set stiffness is 1, with no more doubt than that of the encoder."""
    r = found("x", made("x", counts=True))
    product = r.estimates["compliance", "x"] * r.estimates["force_scale", "x"] * KP["x"]
    assert product.value == pytest.approx(1, rel=1e-6)
    assert product.u < 3e-5


def test_a_load_on_the_wrong_side() -> None:
    rests = made("x", swapped=True)
    assert told(found("x", rests), rests) == {"load-on-wrong-side": Effect.ERROR}


def test_a_load_below_friction_tells_no_compliance() -> None:
    """One of 1.47 N under a friction of 2 N is left out; where all are, nothing is stated."""
    plan = Plan(masses=("M1", "M3"))
    rests = made("x", friction=2.0, plan=plan)
    r = found("x", rests, plan)
    assert list(r.statics[0].used) == [True, False, False, True, True, True]
    assert r.estimates["compliance", "x"].value == pytest.approx(1 / (1.04 * 5400), rel=1e-6)
    assert told(r, rests) == {"load-within-friction": Effect.NOTE}
    rests = made("x", friction=4.2)
    r = found("x", rests)
    assert r.estimates == {}
    assert told(r, rests) == {"load-stuck": Effect.INDETERMINATE}


def test_an_axis_that_does_not_move() -> None:
    rests = made("x", brake=True)
    r = found("x", rests)
    assert r.estimates == {}
    assert told(r, rests) == {"load-stuck": Effect.INDETERMINATE}


@pytest.mark.parametrize(
    ("planted", "code"),
    [
        ({"error": {"M3": 0.1}}, "load-masses-differ"),
        ({"integrator": 0.5}, "no-spring"),
        ({"rubs": 0.1}, "pulley-rubs"),
        ({"constant": 0.3}, "constant-force"),
    ],
)
def test_what_contradicts(planted: dict[str, Any], code: str) -> None:
    """And half of it is let pass where a number decides."""
    rests = made("x", **planted)
    effect = Effect.NOTE if code == "constant-force" else Effect.INDETERMINATE
    assert told(found("x", rests), rests) == {code: effect}


def test_small_contradictions_pass() -> None:
    for planted in ({"error": {"M3": 0.02}}, {"integrator": 0.97}, {"rubs": 0.03}, {"constant": 0.02}):
        rests = made("x", **planted)  # type: ignore[arg-type]
        assert told(found("x", rests), rests) == {}


def test_a_load_that_lacks_on_one_side() -> None:
    rests = [
        replace(r, reading=r.reference + 0.5 * (r.reading - r.reference)) if r.source == "far" else r for r in made("x")
    ]
    assert told(found("x", rests), rests)["load-ways-differ"] is Effect.INDETERMINATE


def test_signals() -> None:
    rests = made("x")

    def codes(some: list[Rest]) -> list[tuple[str, Effect]]:
        return [(f.code, f.effect) for f in checks.of_signals(some, [], rig(), PLAN)]

    assert codes(rests) == []
    assert codes([]) == [("no-loads", Effect.ERROR)]
    assert codes([replace(rests[0], states=("FAULT",)), *rests[1:]]) == [("axis-not-held", Effect.ERROR)]
    assert codes([replace(rests[0], limited=0.4), *rests[1:]]) == [("load-limited", Effect.INDETERMINATE)]
    assert codes([replace(rests[0], drift=4e-6), *rests[1:]]) == [("axis-restless", Effect.INDETERMINATE)]
    assert codes([replace(rests[0], lost=9), *rests[1:]]) == [("missing-samples", Effect.INDETERMINATE)]
    with pytest.raises(AnalysisError, match="47 approaches; expected 48"):
        found("x", rests[1:])


def changed(name: str = "x", way: int = 1) -> list[Change]:
    """Loads put on and taken off: 0.2 mm the load's way, 2 % of it left."""
    t = np.arange(-0.2, 5.4, 1e-3)
    out = []
    for phase in range(PLAN.phases):
        for s in sources(rig(), axis(name)):
            for on in (True, False):
                shape = np.where(t < 0, 0.0, np.exp(-t * 3) * 2e-4 + 4e-6)
                sign = way * s.sign * (1 if on else -1)
                out.append(Change(
                    axis=name, source=s.name, load="M3", phase=phase, at=0.0, stiffness=5400.0, limited=0.0,
                    states=("HOLDING",), lost=0, expected=5600, on=on, times=t, deviation=sign * (shape + 1e-7 * phase),
                    seen=True,
                ))  # fmt: skip
    return out


def test_a_peak_and_what_is_left() -> None:
    plan = PLAN.model_copy(update={"static": False, "axes": "along"})
    r = estimates.results([], changed(), rig(), plan)
    assert {where for _, where in r.estimates} == {"x, far", "x, far, off", "x, near", "x, near, off"}
    assert r.estimates["peak", "x, near"].value == pytest.approx(2.0415e-4 - 0.25e-6, rel=1e-4)
    assert r.estimates["error_after", "x, far, off"].value == pytest.approx(4.15e-6, rel=0.02)
    assert r.estimates["error_after", "x, far"].u == pytest.approx(
        math.hypot(1.29e-7 / 2, 5e-7 / 4 / math.sqrt(3)), rel=0.01
    )
    assert [f.code for f in checks.of_result(r, [], plan)] == []
    wrong = estimates.results([], changed(way=-1), rig(), plan)
    assert {f.code for f in checks.of_result(wrong, [], plan)} == {"load-on-wrong-side"}
    silent = [replace(c, seen=False) for c in changed()[:1]]
    assert [f.code for f in checks.of_signals([], silent, rig(), plan)] == ["load-unanswered"]


def test_a_record_that_ends_too_soon() -> None:
    with pytest.raises(AnalysisError, match="a step that is longer"):
        fit.answer(np.arange(0, 4, 0.1), np.zeros(40), 5.0, 0.2)
    with pytest.raises(AnalysisError, match="all alike"):
        fit.line(np.ones(3), np.ones((3, 2)))


def test_what_a_plan_may_ask() -> None:
    assert list(check(rig(), PLAN)) == []
    bare = rig().model_copy(update={"levers": {}})
    assert "known loads pull both ways at x" in next(iter(check(bare, Plan(axes="around"))))
    assert "the rig file certifies M1" in next(iter(check(rig(), Plan(masses=("M9",)))))
    assert "ascending" in next(iter(check(rig(), Plan(masses=("M3", "M2")))))
    assert any("x_target" in text for text in check(rig(), Plan(lead_m=0.02)))
    assert {q.name for q in left_out(Plan(static=False))} >= {"compliance", "friction", "force_scale"}
    left = {q.name for q in left_out(Plan(axes="along", disturbed=False))}
    assert {q.name for q in procedure.measures} - left == {"compliance", "friction_band", "friction", "force_scale"}
    assert procedure.lacking(load_rig("lira"))
