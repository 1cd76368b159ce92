"""The angle step of the servomotor with six phases: force first, and printed signs found before the motor carries."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.record.outcomes import Outcome, outcome_of
from bench.record.specs import load_spec
from bench.rigfile import load_rig
from bench.run.evaluation import evaluate
from bench.uncertainty import Estimate, interval
from procedures.angle_step import bounds, checks, estimates
from procedures.angle_step.bounds import Swing
from procedures.angle_step.plan import Plan
from procedures.angle_step.procedure import _loop, planned, procedure
from procedures.angle_step.steps import Done, read_moves
from procedures.servomotor import leaning, wiring
from procedures.servomotor.conventions import conventions
from procedures.servomotor.parameters import parameter
from reports.figures import draw as draw_figure
from sim_backend.truth import nominal

RIG = "tsbs6"
QUICK: Mapping[str, Any] = {"repeats": 2, "standstill_s": 0.3, "record_s": 0.8, "settle_s": 1.5}
FIVE, TEN, FIFTEEN = (math.radians(x) for x in (5, 10, 15))


@cache
def on_the_nominal_rig(folder: Path) -> Simulated:
    plan = {**QUICK, "steps_rad": (FIFTEEN,), "steps_static_rad": (FIFTEEN,)}
    return simulated_run("angle-step", RIG, 1, plan, folder / "nominal.mcap", dict(nominal(load_rig(RIG))))


@pytest.fixture(scope="module")
def nominal_run(tmp_path_factory: pytest.TempPathFactory) -> Simulated:
    """15 degrees both ways of sharing, every drawn number at its stated value."""
    return on_the_nominal_rig(tmp_path_factory.mktemp("six"))


def values(run: Simulated) -> dict[tuple[str, str], Estimate]:
    return {(m.quantity.name, m.where): m.estimate for m in run.results if isinstance(m, Measured)}


def wrong(run: Simulated) -> list[tuple[str, str]]:
    return [(f.code, f.where) for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE]


def test_at_15_degrees_priority_leaves_a_tenth_at_most(nominal_run: Simulated) -> None:
    measured = values(nominal_run)
    static, priority = (measured["excess", f"{a}, 15°, 1000 Hz"] for a in ("static", "priority"))
    assert priority.value + 2.6 * priority.u < 3e-6
    assert (priority / static).value + 2.6 * (priority / static).u < 0.1
    assert 50e-6 < static.value < 110e-6  # a prototype: 79 um
    assert wrong(nominal_run) == []
    assert {name for name, _ in measured} == {q.name for q in procedure.on(load_rig(RIG)).measures}
    for allocation in ("static", "priority"):
        amplitude = measured["amplitude", f"{allocation}, 15°, 1000 Hz"]
        assert abs(amplitude.value - 10) < 2.6 * amplitude.u + 0.01
    assert abs(measured["bound_excess", "priority, 15°, 1000 Hz"].value) < 2e-6
    assert ("bound_excess", "static, 15°, 1000 Hz") not in measured


def late(done: Done, seconds: float) -> Done:
    """As captured if the reference had been written later by so much."""
    assert done.swing is not None
    n = len(done.swing.t) - round(seconds * 1e4)
    held = {k: np.concatenate([np.full(len(v) - n, v[0]), v[:n]]) for k, v in done.swing.asked.items()}
    first = {name: getattr(done.swing, name) for name in ("angle", "orbit", "motor", "vectors")}
    rest = {
        k: np.concatenate([np.repeat(v[..., :1], len(done.swing.t) - n, -1), v[..., :n]], -1) for k, v in first.items()
    }
    return replace(done, swing=replace(done.swing, asked=held, **rest))


@pytest.mark.parametrize(("seconds", "short"), [(0.0, 0), (0.15, 0), (0.3, 2), (0.39, 2)])
def test_a_capture_that_ends_before_its_step_is_said(nominal_run: Simulated, seconds: float, short: int) -> None:
    """A write that is delayed: from where the angle has not settled within 0.4 s, means of 1 ms are told, and no currents."""
    rig, plan = nominal_run.recording.rig, nominal_run.recording.plan
    moves = [d if k % 2 else late(d, seconds) for k, d in enumerate(read_moves(nominal_run.recording))]
    found = estimates.by_case(moves, rig, plan.band, 2 * math.pi / plan.encoder_counts, plan.kp_theta)
    assert [r.short for r in found.values()] == [short] * 2
    said = [
        f
        for f in checks.of_responses(found, plan, {c: _loop(rig, plan, c) for c in found})
        if f.code == "capture-short"
    ]
    assert [f.effect for f in said] == [Effect.INDETERMINATE] * (2 if short else 0)
    assert all(("amplitude" in r.estimates) is not bool(short) for r in found.values())


def test_its_figures_show_torque_within_its_bound(nominal_run: Simulated) -> None:
    drawn = list(procedure.drawn(nominal_run.recording))
    assert [f.key for f in drawn] == ["torque-priority", "radius", "orbit", "angle-15", "torque-static", "amplitudes-static",
                                      "amplitudes-priority"]  # fmt: skip
    for figure in drawn:
        draw_figure(figure)
    torque = next(f for f in drawn if f.key == "torque-priority")
    given, high, low = (s.y for s in torque.series)
    assert (given <= high + 1e-5).all()
    assert (given >= low - 1e-5).all()
    assert len(nominal_run.recording.all_steps()) == procedure.steps(
        nominal_run.recording.rig, nominal_run.recording.plan
    )


@pytest.mark.parametrize(
    ("literal", "code"),
    [
        ({"literal_7_6b": 1}, "motor-frame"),
        ({"literal_7_13": 1}, "segment-sign"),
        ({"literal_7_14": 1}, "angle-feedback-sign"),
        ({"literal_7_14": 2}, "motor-frame"),
        ({"literal_7_6b": 1, "literal_7_13": 1}, "segment-sign"),
    ],
)
@pytest.mark.parametrize("name", ["angle-step", pytest.param("slew", marks=pytest.mark.long)])
def test_a_printed_sign_is_found_before_the_motor_carries(
    tmp_path: Path, name: str, literal: Mapping[str, float], code: str
) -> None:
    """Each alone, (7.14) also without its minus for the torque, and the two that together hold the shaft."""
    run = simulated_run(name, RIG, 1, {}, tmp_path / "r.mcap", literal)
    assert [c for c, _ in wrong(run)] == [code]
    assert not values(run)
    share = parameter(run.recording.rig, "motor.share")
    told = [e["value"] for e in run.recording.events("parameter") if e["name"] == share]
    assert max(told, default=0.0) <= leaning.SHARE
    assert {s.kind for s in run.recording.all_steps()} <= {"probe", "nudge", "lean"}


@pytest.mark.parametrize(
    ("defect", "code"),
    [
        ({"exchange_segments": 1}, "segments-exchanged"),
        ({"encoder_sign": -1}, "encoder-direction"),
        ({"segment_sign_1": -1}, "segment-sign"),
        ({"gamma_zero": 0.05}, "segments-exchanged"),
    ],
)
def test_other_wires_are_found_too(tmp_path: Path, defect: Mapping[str, float], code: str) -> None:
    run = simulated_run("angle-step", RIG, 1, QUICK, tmp_path / "r.mcap", defect)
    assert code in [c for c, _ in wrong(run)]
    assert not values(run)


def test_a_frame_along_the_bearings_is_not_leaned_on() -> None:
    assert leaning.applies(load_rig(RIG))
    assert not leaning.applies(load_rig("tsbs12"))
    assert wiring.steps(load_rig(RIG)) == wiring.STEPS + leaning.STEPS
    assert wiring.steps(load_rig("tsbs12")) == wiring.STEPS


def test_a_vector_in_the_motor_s_frame() -> None:
    """T (7.6), (7.6b) put right: x6 = (x + y)/sqrt 2, y6 = (-x + y)/sqrt 2; of tsbs12 nothing turns."""
    six, twelve = (conventions(load_rig(name)) for name in (RIG, "tsbs12"))
    assert six.pushed(1.0, 3.0) == pytest.approx((4 / math.sqrt(2), 2 / math.sqrt(2)))
    assert twelve.pushed(1.0, 3.0) == (1.0, 3.0)
    assert (six.turning, six.vectors) == (("i_q1", "i_q2"), (("i_q1", "i_d1"), ("i_q2", "i_d2")))
    assert twelve.turning == twelve.segments


def swing(i_x: float, i_y: float, torque: float, noise: float = 0.0) -> Swing:
    """200 ticks of which the second half is asked for."""
    on = np.arange(200) >= 100
    x, y, t = (np.where(on, value, 0.0) for value in (i_x, i_y, torque))
    random = np.random.default_rng(0).normal(0, noise, (2, 2, 200))
    vectors = np.array([[t + y, -x], [t - y, x]]) + random
    still = np.zeros((2, 200))
    return Swing(
        np.arange(200) * 1e-4, {"across": x, "along": y, "torque": t}, vectors, 10.0, still[0], still, still, 1.0
    )


def test_the_bound_by_hand() -> None:
    """T (7.18): sqrt(100 - 36) - 4 = 4 A at (6, 4); at (6, 9), scaled into the circle, none."""
    assert bounds.bound(np.array([6.0, 6.0, 0.0]), np.array([4.0, -9.0, 0.0]), 10.0) == pytest.approx([4.0, 0.0, 10.0])
    assert swing(6.0, 4.0, 4.0).excess == pytest.approx(0.0)
    assert swing(6.0, 4.0, -4.5).excess == pytest.approx(0.5)
    assert swing(6.0, 4.0, 1.0).excess == pytest.approx(-3.0)


def test_how_long_amplifiers_cut_by_hand() -> None:
    """Half of 20 ms beyond 10 A: sqrt((4.1 + 4)^2 + 6^2) is, sqrt((4 + 4)^2 + 6^2) = 10 A, rounded when told, is not."""
    assert [swing(6.0, 4.0, i).cut for i in (4.1, -4.1, 4.0 + 1e-6, 1.0)] == pytest.approx([0.01, 0.01, 0.0, 0.0])


def test_how_long_amplifiers_cut_is_told_by_captures(nominal_run: Simulated) -> None:
    measured, truth = values(nominal_run), truth_of_motion(nominal_run)
    for where in ("static, 15°, 1000 Hz", "priority, 15°, 1000 Hz"):
        found = measured["saturated", where]
        assert abs(found.value - truth[f"saturated@{where}"]) < 2.6 * found.u
        assert found.u < 1e-3
    assert measured["saturated", "priority, 15°, 1000 Hz"].value == 0.0


@pytest.mark.parametrize("where", ["static, 15°, 1000 Hz", "priority, 15°, 1000 Hz"])
def test_telemetry_alone_says_the_same_within_its_interval(nominal_run: Simulated, where: str) -> None:
    """Samples that a cut fell in said 10 ms of `saturated` for 8 with an interval of 0.3; means of 1 ms a lower peak."""
    rig, plan = nominal_run.recording.rig, nominal_run.recording.plan
    bare = [replace(d, swing=None) for d in read_moves(nominal_run.recording)]
    found = estimates.by_case(bare, rig, plan.band, 2 * math.pi / plan.encoder_counts, plan.kp_theta)
    told = next(r.estimates for case, r in found.items() if case.where == where)
    truth = truth_of_motion(nominal_run)
    for name, widest in (("rise_time", 0.5e-3), ("excess", 6e-6), ("saturated", 7.2e-3)):
        at, true = interval(told[name]), truth[f"{name}@{where}"]
        assert at.low <= true <= at.high, name
        assert 0 < at.U < widest, name


def test_static_steps_may_be_others() -> None:
    plan = Plan.model_validate(load_rig(RIG).plans["angle-step"])
    assert [c.where for c in planned(plan)] == [
        "static, 5°, 1000 Hz", "priority, 5°, 1000 Hz", "static, 10°, 1000 Hz", "priority, 10°, 1000 Hz",
        "priority, 15°, 1000 Hz",
    ]  # fmt: skip
    assert [c.allocation for c in planned(Plan(allocations=("priority",), steps_static_rad=(1.0,)))] == ["priority"] * 2


@pytest.mark.long
@pytest.mark.parametrize("seed", [3, 1000003])
def test_the_truth_lies_within(tmp_path: Path, seed: int) -> None:
    run = simulated_run("angle-step", RIG, seed, {**QUICK, "repeats": 3}, tmp_path / "r.mcap")
    truth = truth_of_motion(run)
    for (name, where), estimate in values(run).items():
        assert abs(estimate.value - truth[f"{name}@{where}"]) < 5 * estimate.u, (name, where)


def test_what_the_frame_does_not_allow_is_said() -> None:
    """The chain by the force of a first segment that stands upright is refused by name."""
    from bench.cli.loading import load_procedure

    rig = load_rig(RIG)
    for name in ("force-constant", "negative-stiffness", "force-coupling", "force-map"):
        assert "motors.motor.direction" in load_procedure(name).lacking(rig)[0]
    for name in ("amb-calibration", "torque-constant", "spindown", "angle-step", "slew"):
        assert load_procedure(name).lacking(rig) == ()


def test_static_alone_has_no_bound_to_break_and_nothing_is_missing(tmp_path: Path) -> None:
    plan = {**QUICK, "allocations": ("static",), "steps_rad": (FIVE,), "steps_static_rad": ()}
    run = simulated_run("angle-step", RIG, 3, plan, tmp_path / "static.mcap")
    judged = evaluate(procedure, run.recording, load_spec(RIG, "angle-step"), stopped=False)
    assert outcome_of(judged.measurements, judged.findings, None) is Outcome.PASS
    assert [f.text for f in judged.findings if f.code == "limit-not-applied"] == [
        "no verdict on bound_excess: this plan does not measure it"
    ]
