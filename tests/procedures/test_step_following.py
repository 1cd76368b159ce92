"""Steps of a positioned stage: bare numbers, what is told of bad data, the whole path against the machine run again."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.cli.motion_truth import truth_of_motion
from bench.cli.truths.following import Rows
from bench.cli.truths.settings import settings_of
from bench.cli.virtual import Simulated, simulated_run
from bench.errors import StateNotReached
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.record.limited import limit_of
from bench.record.limits import Verdict, judge
from bench.record.specs import applied, load_spec
from bench.rigfile import load_rig
from bench.rigfile.stage import axes_of
from bench.uncertainty import interval
from procedures.stages.tracks import Mode, Track, modes, requires
from procedures.step_following import checks
from procedures.step_following.estimates import grouped, results
from procedures.step_following.fit import began, settling, stepped, stood
from procedures.step_following.plan import Plan
from procedures.step_following.procedure import check, procedure
from procedures.step_following.steps import DOWN, UP, Move
from reports.figures import draw as draw_figure
from sim_backend.machines.rlsrm.device import StagePlant
from sim_backend.machines.rlsrm.truth_following import KEPT, replayed

RLSRM = load_rig("rlsrm")
COUNT = 1e-6
SHORT: dict[str, Any] = {"repeats": 2, "lead": 1, "dwell_s": 3.0}
DEG = math.pi / 180


def run(folder: Path, seed: int = 1, truth: Mapping[str, float] | None = None, **plan: Any) -> Simulated:
    folder.mkdir(exist_ok=True)
    return simulated_run("step-following", "rlsrm", seed, {**SHORT, **plan}, folder / "recording.mcap", truth or {})


def told(done: Simulated) -> dict[str, Effect]:
    return {r.code: r.effect for r in done.results if isinstance(r, Finding)}


def test_where_an_axis_stood() -> None:
    """On one count, at the edge of two, and over several."""
    assert stood(np.array([3.0, 3.0, 3.0]), 1.0) == 3
    assert stood(np.array([3.0, 3.0, 3.0, 4.0]), 1.0) == 3.5
    assert stood(np.array([3.0, 3.0, 3.0, 7.0]), 1.0) == 4


def test_a_set_point_begins_after_its_last_old_sample() -> None:
    assert began(np.array([1.0, 1.0, 1.1, 1.2])) == 1
    assert began(np.ones(4)) is None


def shaped(p: np.ndarray, target: float, step: float, pitch: float = COUNT) -> Any:
    t = np.arange(len(p)) * 1e-3
    return stepped(t, np.round(p / pitch) * pitch, target, step, 0, 200, 0.02, pitch)


@pytest.mark.parametrize("band_counts", [400.0, 400.25, 400.5])
def test_settling_is_not_early_where_the_band_is_whole_counts(band_counts: float) -> None:
    """A place that creeps to its set point by a count in 4 ms crosses 400 counts at 2.4 s less."""
    rate, step = COUNT / 4e-3, band_counts / 0.02 * COUNT
    t = np.arange(4000) * 1e-3
    place = np.minimum(-1000 * COUNT + rate * (t - 0.05), -3 * COUNT)
    found = shaped(place, 0.0, step)
    true = 0.05 + (1000 - band_counts) * 4e-3
    assert found.settled == pytest.approx(true, abs=2.1e-3 + 0.5e-3)
    assert found.settling.slope * COUNT / 2 == pytest.approx(2e-3, abs=0.51e-3)
    errors = []
    for shift in np.linspace(0, 1, 21):
        place = np.minimum(-1000 * COUNT + rate * (t - 0.05) + shift * COUNT, -3 * COUNT)
        errors.append(shaped(place, 0.0, step).settled - (true - shift * 4e-3))
    assert abs(float(np.mean(errors))) < 0.6e-3
    assert max(map(abs, errors)) <= found.settling.slope * COUNT / 2 + 0.5e-3


@pytest.mark.parametrize("rate", [0.5, 0.72, 1.6])  # counts a sample
def test_settling_of_what_goes_by_is_known_to_a_part_of_a_sample(rate: float) -> None:
    """Places that slow down evenly, anywhere in a count and between samples: off by no more than is said, mostly by much less;
    by the edges of two counts a slower one would be off by up to a sample."""
    t, errors, bounds = np.arange(400) * 1e-3, [], []
    for phase in np.random.default_rng(5).random(60):
        at = 0.2 + 1e-3 * phase
        s = np.minimum(t - at, 0.08)
        place = -(400.25 - rate * 1e3 * s + 0.5 * rate * 1e4 * s * s)  # half of its rate is left at most after 50 ms
        found = settling(t, np.round(place + 7 * phase) - 7 * phase, 400.25, 1.0)
        assert found is not None
        assert found.passed
        errors.append(found.at - at)
        bounds.append(found.within)
    assert (np.abs(errors) <= np.array(bounds) * (1 + 1e-6)).all()
    assert 0.25 < np.std(np.array(errors) / bounds) < 3**-0.5 + 0.05  # no wider than a rectangle
    assert np.mean(bounds) < 0.3e-3 / rate


def test_along_the_step_beyond_is_positive() -> None:
    """Of 2 mm down to -1 mm that goes 30 um too far and stays 10 um short."""
    t = np.arange(3000) * 1e-3
    place = 1e-3 - 2e-3 * np.minimum(t / 0.5, 1.0)
    place = np.where((t > 0.5) & (t < 0.7), -1.03e-3, np.where(t >= 0.7, -0.99e-3, place))
    found = shaped(place, -1e-3, -2e-3)
    assert found.error == pytest.approx(-10e-6, abs=1e-9)
    assert found.overshoot == pytest.approx(0.015, abs=1e-6)
    assert found.moved == 0
    assert settling(t, np.full(3000, 1.0), 0.5, COUNT) is None


def moves(offset: float = 0.0, rest: float = 0.0, lost: int = 0, states: tuple[str, ...] = ("HOLDING",),
          read: bool = True, sent: float = 1.0) -> tuple[list[Move], Plan]:  # fmt: skip
    """Of the axis along, by hand: it follows at once and stands `offset` beyond, moving by `rest` at the end."""
    plan, axis = Plan(moved="stroke", lead=0, repeats=2), axes_of(RLSRM)["x"]
    low, high = plan.places_m
    t, out = np.arange(3000) * 1e-3, []
    for repeat in range(2):
        for way, start, target in ((UP, low, high), (DOWN, high, low)):
            reference = np.where(t < 0.05, start, start + sent * (target - start))
            place = np.where(t < 0.06, start, target + offset * np.sign(target - start))
            place = place + np.where(t > 2.9, rest * (t - 2.9) / 0.1, 0.0)
            place = np.round(place / COUNT) * COUNT if read else np.zeros(3000)
            track = Track(axis, t, place, reference, np.zeros(3000), np.zeros(3000), states, lost, 3000)
            out.append(Move(Mode("x", (axis,)), way, repeat, track))
    return out, plan


def test_what_is_told_of_limits() -> None:
    """A loop that asks for 9 N of 9, gets 5, with a phase at its 6 A."""
    some, plan = moves()
    pushed = [
        replace(m, track=replace(m.track, asked=np.full(3000, 9.0), given=np.full(3000, 5.0), full=0.5)) for m in some
    ]
    assert set(of_groups((pushed, plan))) == {
        "force-at-limit",
        "force-not-given",
        "current-saturated",
        "reading-quantised",
    }


def of_moves(found: tuple[list[Move], Plan]) -> set[str]:
    return {f.code for f in checks.of_moves(found[0], RLSRM, found[1])}


def of_groups(found: tuple[list[Move], Plan]) -> dict[str, Effect]:
    some, plan = found
    return {f.code: f.effect for f in checks.of_groups(grouped(some, plan), some, RLSRM, plan)}


def test_what_is_told_of_bad_data() -> None:
    assert of_moves(moves()) == set()
    assert of_groups(moves()) == {"reading-quantised": Effect.NOTE}
    assert of_moves(moves(lost=10)) == {"missing-samples"}
    assert of_moves(moves(states=("HOLDING", "FAULT"))) == {"axis-not-held"}
    assert of_moves(moves(read=False)) == {"never-moved"}
    assert of_moves(moves(sent=0.9)) == {"set-point-elsewhere"}
    assert of_moves((moves()[0][:-1], moves()[1])) == {"axis-steps-missing"}
    assert of_groups(moves(rest=30e-6))["still-moving"] is Effect.INDETERMINATE
    assert "still-moving" not in of_groups(moves(rest=15e-6))
    assert of_groups(moves(offset=-12e-3))["not-followed"] is Effect.NOTE
    assert of_groups(moves(offset=-0.5e-3))["not-settled"] is Effect.INDETERMINATE


def test_static_error_and_its_budget_by_hand() -> None:
    """12 um beyond, with readings that rose last: half a count by the encoder; against the true place a sixth of a count nearer
    to where it came from, within 4/45 of a square count, and the encoder's edges and pitch besides."""
    some, plan = moves(offset=12e-6)
    found = results(grouped(some, plan), plan, 1e-3).estimates
    own, true = found["static_error", "x, up"], found["true_static_error", "x, up"]
    assert own.value == pytest.approx(12e-6, abs=1e-12)
    assert true.value == pytest.approx(12e-6 - COUNT / 6, abs=1e-12)
    assert pytest.approx(COUNT / 2, rel=1e-3) == interval(own).U
    scale = 10e-3 * 3e-5 / math.sqrt(3)
    assert true.u == pytest.approx(math.sqrt(4 / 45 * COUNT**2 + (0.5e-6) ** 2 / 3 + scale**2), rel=1e-3)


def test_of_rests_in_several_counts_more_is_known_than_of_one() -> None:
    """Five that came in to different counts from below: their mean is known better than to half a count; alike ones are not."""
    some, plan = moves(offset=12e-6)
    apart = [replace(m, track=replace(m.track, read=np.where(m.track.t < 0.06, m.track.read, m.track.read + k * COUNT)))
             for k in range(5) for m in some[:1]]  # fmt: skip
    own = results(grouped(apart, plan), plan, 1e-3).estimates["static_error", "x, up"]
    assert own.value == pytest.approx(14e-6 - COUNT / 6, abs=1e-12)
    assert own.u == pytest.approx(math.sqrt(4 / 45 / 5) * COUNT, rel=1e-6)


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Simulated:
    return run(tmp_path_factory.mktemp("sound"))


def verdicts(done: Simulated) -> list[tuple[str, str, Verdict]]:
    limits, _ = applied(load_spec("rlsrm", "step-following", procedure, rig=RLSRM), done.recording.plan)
    return [
        (r.quantity.name, r.where, judge(interval(r.estimate), limit_of(limits, r.quantity.name, r.where)))
        for r in done.results if isinstance(r, Measured)
    ]  # fmt: skip


def test_a_drawn_machine_is_measured_and_passes(sound: Simulated) -> None:
    truth = truth_of_motion(sound)
    measured = [r for r in sound.results if isinstance(r, Measured)]
    assert len(measured) == 8 * 4
    missed = []
    for r in measured:
        found, true = interval(r.estimate), truth[f"{r.quantity.name}@{r.where}"]
        if not found.low <= true <= found.high:
            missed.append((r.quantity.name, r.where))
            assert abs(true - r.estimate.value) < 1.5 * found.U
    assert {name for name, _ in missed} <= {
        "true_static_error",
        "true_static_error_angle",
        "overshoot",
    }  # those have 95 %
    assert len(missed) <= 2
    assert {v for name, _, v in verdicts(sound) if name.startswith(("static", "over"))} == {Verdict.PASS}
    assert set(told(sound)) <= {"reading-quantised", "repeats-apart"}
    figures = list(procedure.figures(procedure.evaluated(sound.recording).result, sound.recording))
    assert len(figures) == 8
    for figure in figures[:2]:
        assert draw_figure(figure)


def test_the_truth_goes_through_the_run_again_to_the_last_count(sound: Simulated) -> None:
    rows = Rows(sound.recording, sound.drawn.machine.tick_s)
    data = sound.recording.read(("x", "angle"), 0, 1 << 62)
    end = rows.of(list(sound.recording.steps("step"))[-1].end_ns)
    again = replayed(StagePlant(sound.drawn.plant), settings_of(sound), rows.commands, end)
    zero = -rows.of(int(data["t_ns"][0]) - round(sound.drawn.machine.tick_s * 1e9))
    for name, count in (("x", COUNT), ("angle", 0.144 * DEG)):
        read = data[name][zero : zero + end]
        assert np.abs(read - again[:, KEPT.index(name)]).max() < 0.1 * count


def test_without_integrators_friction_over_gain_is_left(tmp_path: Path) -> None:
    done = run(tmp_path, moved="angle", integrators="off")
    found = [(n, w, v) for n, w, v in verdicts(done) if n.startswith("static")]
    assert [w for _, w, _ in found] == ["angle, up, integrators off", "angle, down, integrators off"]
    assert {v for _, _, v in found} == {Verdict.PASS}
    left = [
        r.estimate.value / DEG
        for r in done.results
        if isinstance(r, Measured) and r.quantity.name == "static_error_angle"
    ]
    assert all(0.2 < x < 0.8 for x in left)


def test_a_brake_that_is_left_on_is_no_pass(tmp_path: Path) -> None:
    """5 N and 50 N mm of brakes beside 1.5 N and 12 N mm of friction; with 30 N it finds no zeros, which ends the run."""
    for axis, size in (("x", 5.0), ("angle", 0.05)):
        moved = "stroke" if axis == "x" else "angle"
        judged = verdicts(run(tmp_path / axis, truth={f"brake_{axis}": size}, moved=moved, integrators="off"))
        assert Verdict.FAIL in {v for name, _, v in judged if name.startswith("static")}
    done = run(tmp_path / "on", truth={"brake_angle": 0.05}, moved="angle")
    truth, limits = (
        truth_of_motion(done),
        applied(load_spec("rlsrm", "step-following", procedure), done.recording.plan)[0],
    )
    for name, where, verdict in verdicts(done):
        limit = limit_of(limits, name, where)
        if verdict is Verdict.PASS and limit is not None:
            assert (limit.low or -math.inf) <= truth[f"{name}@{where}"] <= (limit.high or math.inf)
    with pytest.raises(StateNotReached, match="knows no zeros"):
        run(tmp_path / "stuck", truth={"brake_x": 30.0}, moved="stroke")


def test_one_axis_is_enough() -> None:
    can = RLSRM.capabilities.positioning
    assert can is not None
    alone = can.model_copy(update={"axes": {"x": can.axes["x"]}})
    rig = RLSRM.model_copy(update={"capabilities": RLSRM.capabilities.model_copy(update={"positioning": alone})})
    assert [m.name for m in modes(rig, "all", together=True)] == ["x"]
    assert not requires(rig).lacking(rig)
    assert not list(check(rig, Plan()))
    assert {q.name for q in procedure.untold(rig)} == {"static_error_angle", "true_static_error_angle"}


def test_plans_that_cannot_work() -> None:
    assert not list(check(RLSRM, Plan()))
    for plan, key in (
        ({"places_m": (0.0, 0.02)}, "places_m"), ({"places_m": (0.0, 0.0)}, "places_m"), ({"rest_s": 3.0}, "rest_s"),
        ({"integrators": "half"}, "integrators"),
    ):  # fmt: skip
        problems = list(check(RLSRM, Plan().model_copy(update=plan)))
        assert len(problems) == 1
        assert problems[0].startswith(key)
    encoders = {n: e.model_copy(update={"pitch": None, "counts": None}) for n, e in RLSRM.encoders.items()}
    (said,) = requires(RLSRM.model_copy(update={"encoders": encoders})).lacking(RLSRM)
    assert said.startswith("encoders: found no pitch of x, angle")


def test_loops_between_two_samples_start_at_any_time() -> None:
    """Told every 2 ms of loops at 0.5 ms: a step starts up to 1.5 ms after the last sample at which the set point is where it
    was. Of 400 groups of three, each at a tick of its own, the intervals hold the true time; where their period is left out,
    it is taken to start at any time, a quarter of a millisecond late; by loops of the telemetry's own period all are long."""
    rng, tick, plan, axis = np.random.default_rng(5), 5e-4, Plan(moved="stroke", lead=0, repeats=3), axes_of(RLSRM)["x"]
    low, high = plan.places_m
    t = np.arange(1000) * 2e-3
    errors: dict[float, list[float]] = {tick: [], 0.0: [], 2e-3: []}
    for _ in range(400):
        some, lasts = [], rng.uniform(0.1, 0.104)
        for repeat in range(3):
            begins = 0.05 + tick * rng.integers(4)  # right after the sample at 0.05 s, or one of three ticks after that
            reference = low + (high - low) * np.clip((t - begins) / lasts, 0.0, 1.0)
            track = Track(axis, t, np.round(reference / COUNT) * COUNT, reference, 0 * t, 0 * t, ("HOLDING",), 0, 1000)
            some.append(Move(Mode("x", (axis,)), UP, repeat, track))
        for loop_s, found in errors.items():
            told = results(grouped(some, plan), plan, loop_s).estimates["settling_time", "x, up"]
            found.append((told.value - 0.98 * lasts) / interval(told).U)
    own, free, sampled = (np.array(found) for found in errors.values())
    assert abs(own.mean()) < 0.1
    assert 0.914 < np.mean(np.abs(own) < 1) < 0.986
    assert 0.8 < 1 / np.percentile(np.abs(own), 95) < 1.25
    assert -0.3 < free.mean() < -0.1
    assert np.mean(np.abs(free) < 1) > 0.914
    assert np.mean(np.abs(sampled) < 1) < 0.8
