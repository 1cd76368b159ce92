"""What positioning asks of a rig and of a plan, and what its checks see in readings that were made up."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bench.cli.loading import load_procedure
from bench.rigfile import RigFile
from bench.rigfile.check_reference import problems_of
from procedures.positioning import checks, way
from procedures.positioning.plan import Plan
from procedures.positioning.procedure import check, procedure
from procedures.positioning.steps import Taken
from procedures.positioning.way import errors, rates
from tests.procedures.positioned import ALONG, AROUND, PLAN, RLSRM, UM, taken, true_deviations


def codes(t: Taken, plan: Plan = PLAN) -> set[str]:
    found = [*checks.of_signals([t], RLSRM, plan), *checks._rest(t, plan), *checks._far(t, plan), *checks._trend(t),
             *checks._coarse(t, plan), *checks._targets(t, plan)]  # fmt: skip
    return {f.code for f in found}


# What is asked of a rig, and of a plan


def test_axes_targets_and_instruments_of_the_rig() -> None:
    assert (len(ALONG.at), len(AROUND.at)) == (5, 8)
    assert errors(ALONG.by).scale == pytest.approx(0.05 * UM)
    assert errors(ALONG.by).step == 1e-8
    assert errors(AROUND.by).wander == pytest.approx(math.radians(1e-6) / math.sqrt(3))
    assert set(rates(RLSRM, PLAN)) == {"x_rate", "x_rise", "angle_rate", "angle_rise"}
    assert not list(check(RLSRM, PLAN))


def bare(rig: RigFile = RLSRM, **reference: Any) -> RigFile:
    can = rig.capabilities.model_copy(update={"reference": reference})
    return rig.model_copy(update={"capabilities": can})


def test_without_a_reference_it_is_refused_as_a_counter() -> None:
    lacking = load_procedure("positioning").lacking(bare())
    assert any("repeatability of a counter" in line for line in lacking)
    one = bare(angle=RLSRM.capabilities.reference["angle"])
    assert not load_procedure("positioning").lacking(one)
    assert "counter" in " ".join(check(one, Plan(axes=("x",))))
    assert {q.unit for q in procedure.untold(one)} == {"m"}


@pytest.mark.parametrize(("change", "key"), [
    ({"channel": "nowhere"}, "channel"), ({"channel": "x"}, "channel"), ({"channel": "supply"}, "channel"),
    ({"unit": "deg"}, "unit"), ({"gain": "error"}, "gain"), ({"drift": "error"}, "drift"),
    ({"temperature": "x"}, "temperature"),
])  # fmt: skip
def test_an_instrument_that_leads_nowhere(change: Mapping[str, Any], key: str) -> None:
    of = RLSRM.capabilities.reference["x"]
    changed = {k: getattr(of, v) if v == "error" else v for k, v in change.items()}
    found = list(problems_of(bare(x=of.model_copy(update=changed))))
    assert [line[0] for line in found] == [f"reference.x.{key}"]
    assert not list(problems_of(RLSRM))


def test_an_instrument_of_no_axis() -> None:
    assert [line[0] for line in problems_of(bare(y=RLSRM.capabilities.reference["x"]))] == ["reference.y"]


@pytest.mark.parametrize(("plan", "said"), [
    ({"axes": ("y",)}, "axes"), ({"targets_m": (0.0,)}, "two or more"), ({"targets_m": (1e-3, 0.0)}, "from below"),
    ({"targets_m": (0.0, 0.02)}, "axis x"), ({"dwell_s": 0.1}, "rest_s"), ({"beyond_m": 0.01}, "axis x"),
])  # fmt: skip
def test_plans_that_cannot_work(plan: Mapping[str, Any], said: str) -> None:
    assert said in " ".join(check(RLSRM, Plan(**plan)))


# What checks see


def sound(seed: int = 7, scatter: float = 2 * UM) -> np.ndarray:
    return true_deviations(np.random.default_rng(seed), 5, 5, scatter)


def test_sound_readings_raise_nothing() -> None:
    for seed in range(40):
        assert codes(taken(sound(seed))) == set()


def test_another_sign_unit_or_axis() -> None:
    t = taken(sound())
    for factor, word in (
        (-1.0, "other way"),
        (1000.0, "mm"),
        (25.4, "inch"),
        (0.0, "does not move"),
        (math.degrees(1), "rad"),
    ):
        found = list(checks.of_signals([replace(t, read=factor * t.read)], RLSRM, PLAN))
        assert [f.code for f in found] == ["reference-disagrees"]
        assert word in found[0].text
    assert [f.code for f in checks.of_signals([replace(t, counted=0 * t.counted)], RLSRM, PLAN)] == [
        "reference-disagrees"
    ]
    assert "?" not in next(checks.of_signals([replace(t, read=1.7 * t.read)], RLSRM, PLAN)).text


def test_not_at_rest_and_moved() -> None:
    t = taken(sound())
    moved = t.moved.copy()
    moved[0, 2, 1] = 5 * UM
    assert codes(replace(t, moved=moved)) == {"axis-not-at-rest"}
    before = t.before.copy()
    before[1, 0, 0] -= 5 * UM
    assert codes(replace(t, before=before)) == {"moved-while-read"}


def test_a_mistyped_reading_stands_far() -> None:
    t = taken(sound())
    read = t.read.copy()
    read[0, 0, 2] *= 10  # a point one place off
    assert codes(replace(t, read=read)) == {"readings-far"}
    read[0, 0, 2] = t.read[0, 0, 2] + 100 * UM
    assert codes(replace(t, read=read)) == {"readings-far"}
    assert codes(replace(t, read=read, counted=read, before=read)) == set()  # the axis itself went there


def test_readings_that_wander() -> None:
    t = taken(sound())
    wander = 3e-7 * (t.times - t.times.mean())
    assert codes(replace(t, read=t.read + wander)) == {"readings-trend"}
    own = t.read + wander  # the axis itself, as its encoder has it, to a count
    assert codes(replace(t, read=own, counted=np.round(own / UM) * UM, before=own)) == set()
    coarse = np.broadcast_to(ALONG.at[None, :, None], own.shape)  # an encoder that sees nothing of it
    assert codes(replace(t, read=own, counted=coarse, before=coarse)) == {"readings-trend"}
    allowed = ALONG.by.drift.half_width if ALONG.by.drift else 0.0  # type: ignore[union-attr]
    assert codes(replace(t, read=t.read + 0.5 * float(allowed or 0) * t.times)) == set()


def test_a_coarse_instrument() -> None:
    fine = taken(sound(scatter=0.03 * UM))
    assert codes(fine) == {"reference-coarse"}


def test_missing_and_not_held() -> None:
    t = taken(sound())
    read = t.read.copy()
    read[0, 0, 0] = np.nan
    assert codes(replace(t, read=read)) >= {"approaches-missing"}
    assert codes(replace(t, states=("HOLDING", "FAULT"))) == {"axis-not-held"}


def test_targets_on_counts_and_too_few() -> None:
    plan = Plan(targets_m=(-0.01, -0.005, 0.0, 0.005, 0.01))
    on = way.tested(RLSRM, plan)[0]
    assert codes(taken(sound(), on), plan) == {"targets-on-counts"}
    few = Plan(targets_m=(-0.0100003, 0.0000004, 0.0100003))
    t = taken(true_deviations(np.random.default_rng(8), 3, 5, 2 * UM), way.tested(RLSRM, few)[0])
    assert codes(t, few) == {"targets-fewer"}


def test_temperature() -> None:
    class Told:
        plan, rig = PLAN, RLSRM

    t = taken(sound())
    assert [f.code for f in checks._warming(t, PLAN, Told())] == ["axis-warmth"]  # type: ignore[arg-type]
    of = replace(ALONG, by=ALONG.by.model_copy(update={"temperature": "temp_1"}))
    even, warm = taken(sound(), of), taken(sound(), of, warm=np.linspace(293, 295, 50).reshape(2, 5, 5))
    assert [f.code for f in checks._warming(even, PLAN, Told())] == ["axis-warmth"]  # type: ignore[arg-type]
    assert [f.code for f in checks._warming(warm, PLAN, Told())] == ["axis-warms"]  # type: ignore[arg-type]
