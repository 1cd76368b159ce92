"""Zeros of encoders through the whole path: the drawn machine's, planted troubles, refusals; what findings need."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawn_figures import figures_drawn

from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import RigFile, load_rig
from bench.rigfile.check_capabilities import problems_of
from bench.uncertainty import interval
from procedures.encoder_zero import checks, estimates
from procedures.encoder_zero.groups import PLACES, TRIAL_REPEATS, Group, Setting, count, groups, settings_of, target
from procedures.encoder_zero.plan import Plan
from procedures.encoder_zero.procedure import check, procedure, settings
from procedures.encoder_zero.steps import Taken

LINEAR: dict[str, Any] = {"motors": ("LA",), "repeats": 3}
ROTARY: dict[str, Any] = {"motors": ("RA1",), "repeats": 3, "window_s": 0.1}
REDUCED = {"reduced": 1.0}


def run(folder: Path, truth: Mapping[str, float] | None = None, seed: int = 1, **plan: Any) -> Simulated:
    return simulated_run("encoder-zero", "lira", seed, plan, folder / "recording.mcap", truth)


def values(done: Simulated) -> dict[str, Measured]:
    return {f"{r.quantity.name}@{r.where}": r for r in done.results if isinstance(r, Measured)}


def codes(done: Simulated, *, notes: bool = False) -> dict[str, Finding]:
    return {r.code: r for r in done.results if isinstance(r, Finding) and (notes or r.effect is not Effect.NOTE)}


def off(done: Simulated, name: str) -> float:
    """Error in U."""
    i = interval(values(done)[name].estimate)
    return abs(values(done)[name].estimate.value - done.truth[name]) / ((i.high - i.low) / 2)


@pytest.mark.parametrize("degrees", [-10.0, 10.0])
def test_the_linear_motor(tmp_path: Path, degrees: float) -> None:
    """Off by as much as the rig file's tolerance never is: told, measured all the same."""
    done = run(tmp_path, {"zero_la": 0.0, "zero_off_la": math.radians(degrees)}, **LINEAR)
    assert codes(done) == {}
    assert set(values(done)) == {"zero@LA"}
    assert off(done, "zero@LA") < 2
    # by hand: a scale of 0.05 % over 9.56 mm of 12.5 mm a turn, rectangular; 1 - cos 10 deg of the force
    assert math.degrees(values(done)["zero@LA"].estimate.u) == pytest.approx(0.0795, abs=0.001)
    told = codes(done, notes=True)["zero-off"]
    assert told.where == "LA"
    assert float(told.text.partition("Force is ")[2].partition("%")[0]) == pytest.approx(1.52, abs=0.06)
    assert figures_drawn(done)


@pytest.mark.long
def test_the_rotary_motors(tmp_path: Path) -> None:
    """Two zeros of their own, 14 degrees apart."""
    truth = {**REDUCED, "zero_ra1": math.radians(10), "zero_ra2": math.radians(-4)}
    done = run(tmp_path, truth, **ROTARY)
    assert codes(done) == {}
    assert set(values(done)) == {"zero@RA1", "zero@RA2", "K_ratio@RA1/RA2"}
    for name in values(done):
        assert off(done, name) < 2, name
    assert math.degrees(values(done)["zero@RA1"].estimate.u) < 0.01
    assert "differ" in codes(done, notes=True)["zeros-compared"].text


@pytest.mark.long
def test_one_zero_for_both(tmp_path: Path) -> None:
    done = run(tmp_path, {**REDUCED, "one_zero": 1.0}, **ROTARY)
    told = codes(done)
    assert told["zero-shared"].where == "RA1"
    assert told["zero-not-taken"].where == "RA2"


@pytest.mark.long
def test_a_slow_integrator(tmp_path: Path) -> None:
    """A tenth of the stated gain: the mover is still on its way back."""
    done = run(tmp_path, {**REDUCED, "factor_ki_r": 0.1}, **ROTARY, trial_rad=0.0)
    assert "mover-moved" in codes(done)


RIG = load_rig("lira")
AXIAL = next(g for g in groups(RIG) if g.motors == ("LA",))
BOTH = next(g for g in groups(RIG) if len(g.motors) == 2)
TURN = {"RA1": 0.03, "RA2": -0.02, "LA": 0.05}


def recorded(plan: Plan, turn: Mapping[str, float] = TURN, places: int = PLACES, **trial_moves: float) -> list[Taken]:
    """Currents without noise, of machines that lay them `turn` too far; a changed zero takes `trial_moves` off others'."""
    out: list[Taken] = []
    for group in groups(RIG, plan):
        todo = [(k, "") for k in range(places)] + [(PLACES - 1, m) for m in group.motors if plan.trial_rad]
        for place, trial in todo:
            at = [turn[m] - (plan.trial_rad if m == trial else 0.0) - (trial_moves.get(m, 0.0) if trial and m != trial else 0.0)
                  for m in group.motors]  # fmt: skip
            out += [
                _taken(group, np.array(at), one, plan)
                for one in settings_of(group, place, trial, TRIAL_REPEATS if trial else plan.repeats)
            ]
    return out


def _taken(group: Group, at: np.ndarray, one: Setting, plan: Plan) -> Taken:
    motors = group.motors
    j, size = motors.index(one.motor), one.sign * plan.current_A
    rows = np.zeros((len(motors), 2))
    force = math.sin(at[j]) if one.way == "along" else math.cos(at[j])
    rows[:, 1] = -force * size / np.cos(at).sum()
    rows[j, 0 if one.way == "along" else 1] += size
    jitter = 1e-7 * one.repeat * one.sign
    means = np.array([target(RIG, group, one.place), *(rows.ravel() + jitter)])
    of = (one.loop, one.place, one.trial, one.motor, one.way, one.repeat, one.sign)
    return Taken(
        *of,
        size,
        means,
        np.array([means, means]),
        np.array([3e-5, *np.full(rows.size, 5e-3)]),
        0.0,
        ("LEVITATED",),
        0,
        100,
    )


def told(taken: list[Taken], plan: Plan) -> set[str]:
    found = [*checks.of_signals(taken, RIG, plan)]
    if not any(f.effect is Effect.ERROR for f in found):
        found += checks.of_results(estimates.results(taken, RIG, plan), RIG, plan)
    return {f.code for f in found if f.effect is not Effect.NOTE}


def test_a_sound_recording() -> None:
    plan = Plan(repeats=3)
    found = {m: r.turns[m] for r in estimates.results(recorded(plan), RIG, plan) for m in r.group.motors}
    assert found == pytest.approx(TURN, abs=1e-6)
    assert told(recorded(plan), plan) == set()


def test_what_findings_need() -> None:
    plan = Plan(repeats=3)
    sound = recorded(plan)

    def with_first(**changes: Any) -> list[Taken]:
        return [replace(sound[0], **changes), *sound[1:]]

    assert told([], plan) == {"no-currents"}
    assert told(with_first(means=None), plan) == {"current-not-captured"}
    assert told(with_first(states=("LEVITATED", "LANDING")), plan) == {"mover-not-held"}
    assert told(with_first(limited=0.01), plan) == {"loop-limited"}
    assert told(with_first(lost=50), plan) == {"missing-samples"}
    assert told(recorded(plan, places=1), plan) == {"currents-missing"}
    moved = [replace(t, means=t.means + np.eye(len(t.means))[0] * 4e-4 * t.sign) for t in sound if t.means is not None]
    assert told(moved, plan) == {"mover-moved"}
    drifting = [replace(t, halves=t.halves + np.array([[0.0], [3e-3]]) * t.sign) for t in sound]
    assert told(drifting, plan) == {"answer-unsettled"}
    weak = [replace(t, means=0.9 * t.means) for t in sound if t.means is not None]
    assert told(weak, plan) == {"current-wrong"}


def test_places_that_disagree() -> None:
    """A quarter of a turn on the zero is another: 1 degree is more than sensors of 0.5 % make."""
    plan = Plan(repeats=3, trial_rad=0.0)
    other = [t for t in recorded(plan, {k: v + 0.0175 for k, v in TURN.items()}) if t.place == 1]
    assert told([t for t in recorded(plan) if t.place == 0] + other, plan) == {"places-differ"}
    little = [t for t in recorded(plan, {k: v + 0.002 for k, v in TURN.items()}) if t.place == 1]
    assert told([t for t in recorded(plan) if t.place == 0] + little, plan) == set()


def test_zeros_that_are_shared_or_not_taken() -> None:
    plan = Plan(repeats=3)
    assert told(recorded(plan, RA1=plan.trial_rad), plan) == {"zero-shared"}
    nothing = [replace(t, trial=t.trial) for t in recorded(plan.model_copy(update={"trial_rad": 1e-9}))]
    assert told(nothing, plan) == {"zero-not-taken"}


def test_a_motor_the_other_way_round() -> None:
    plan = Plan(repeats=3, trial_rad=0.0)
    assert told(recorded(plan, {**TURN, "RA1": math.pi - 1.2}), plan) == {"motor-reversed"}


def test_no_advice_of_what_is_in_doubt() -> None:
    """A zero that is off is not told, and not to be set, where a loop was at its limit."""
    plan = Plan(repeats=3, trial_rad=0.0)
    found = estimates.results(recorded(plan, {**TURN, "LA": 0.1}), RIG, plan)
    said = [(f.code, f.where) for f in checks.of_results(found, RIG, plan) if f.code == "zero-off"]
    assert said == [("zero-off", "LA")]
    assert not [f for f in checks.of_results(found, RIG, plan, {"zero@LA"}) if f.code == "zero-off"]


def test_the_controllers_own_zero_is_in_it() -> None:
    """A parameter that is 0.1 rad, currents laid 0.03 too far: the zero is 0.13."""
    changed = RIG.parameters["zero.ra1"].model_copy(update={"default": 0.1})
    rig = RIG.model_copy(update={"parameters": {**RIG.parameters, "zero.ra1": changed}})
    plan = Plan(repeats=3, trial_rad=0.0)
    (found,) = (r for r in estimates.results(recorded(plan), rig, plan) if r.group == BOTH)
    assert found.estimates["zero", "RA1"].value == pytest.approx(0.13, abs=1e-6)
    assert settings(rig, plan)["zero.ra1"] == 0.1


def test_refusals() -> None:
    assert procedure.lacking(RIG) == ()
    assert list(check(RIG, Plan())) == []
    assert "found LB" in next(iter(check(RIG, Plan(motors=("LB",)))))
    assert "observer" in next(iter(check(RIG, Plan(observer="other"))))
    assert "step_d_L" in next(iter(check(RIG, Plan(current_A=6.0))))
    assert "rate_hz" in next(iter(check(RIG, Plan(rate_hz=123.456e3))))
    assert count(RIG, Plan(repeats=3)) == len(recorded(Plan(repeats=3)))
    bare = RIG.model_copy(update={"capabilities": RIG.capabilities.model_copy(update={"force_currents": {}})})
    assert "force_currents" in procedure.lacking(bare)[0]


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ('along = "L_d"', 'along = "L_x"', "force_currents.LA.along"),
        ('along = "R2_d"', 'along = "R1_d"', "force_currents.RA2.along"),
        ("[capabilities.force_currents.LA]", "[capabilities.force_currents.LB]", "force_currents.LB"),
        ('loop = "z"', 'loop = "w"', "force_currents.LA.loop"),
        ('zero = "zero.la"\nstated', 'zero = "kp.z"\nstated', "force_currents.LA.zero"),
        ('zero = "zero.ra2"\nstated', 'zero = "zero.ra9"\nstated', "force_currents.RA2.zero"),
        ('period = "machine/pair_pitch"', 'period = "machine/pairs"', "force_currents.LA.period"),
    ],
)  # fmt: skip
def test_bindings_that_lead_nowhere(old: str, new: str, key: str) -> None:
    toml, dbc = (Path("rigs") / "lira.toml").read_text(), (Path("rigs") / "lira.dbc").read_text()
    assert old in toml
    found = [p.key for p in problems_of(RigFile.parse(toml.replace(old, new), dbc))]
    assert f"capabilities.{key}" in found
