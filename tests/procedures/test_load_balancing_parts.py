"""Parts of the circle: peaks of their means, samples that are missing in them, and plans that have none to look at."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from balancing import facts, run

from bench.cli.loading import load_procedure
from bench.cli.virtual import Simulated
from bench.findings import Ended, Findings
from bench.recording import Recording, Step
from bench.rigfile import load_rig
from bench.uncertainty import Estimate, interval
from procedures.load_balancing import fit, foresight, steps
from procedures.load_balancing.estimates import jackknife
from procedures.load_balancing.plan import Plan
from sim_backend.truth import draw, nominal

RIG = "tsbs12-offset"


@pytest.mark.parametrize(("bin_s", "hz"), [(0.01, 0.25), (0.04, 0.25), (0.1, 0.1), (0.01, 1.0), (0.02, 0.3)])
def test_a_peak_is_that_of_the_load_and_not_of_its_means(bin_s: float, hz: float) -> None:
    """|i_y| = 4.0 - 2.8 sin(phase) A has 6.8 A. Means over 3.6 degrees at its top are 7 parts in 100 000 lower, those over 10
    degrees, through which a parabola of 20 degrees went, half a part in a thousand: a fifth of U."""
    plan = Plan(bin_s=bin_s, circle_hz=hz)
    count = steps.bins(plan)
    edges = 2 * math.pi * (np.arange(count + 1) + 0.3) / count
    means = 4.0 + 2.8 * np.diff(np.cos(edges)) / np.diff(edges)
    assert list(foresight.parts(plan, 1000.0)) == []
    assert fit.peak(means) == pytest.approx(6.8, rel=2e-6)


@pytest.mark.parametrize(
    ("plan", "said"),
    [
        ({"bin_s": 0.1}, "9.0° of the circle at 0.25 Hz; expected at most a part in 100 of a turn, 0.04 s"),
        ({"bin_s": 0.02, "circle_hz": 1.0}, "expected at most a part in 100 of a turn, 0.01 s"),
        ({"bin_s": 0.0005}, "expected 0.002 s or more"),
    ],
)
def test_parts_of_a_turn_that_show_no_peak_are_refused(plan: dict[str, float], said: str) -> None:
    (found,) = load_procedure("load-balancing").check(load_rig("tsbs12"), Plan.model_validate(plan))
    assert said in found


def turns(plan: Plan, first: int, count: int) -> tuple[Any, Any]:
    """Times and a cosine of three turns in twelve seconds at 1 kHz, without `count` samples from the `first` on."""
    t = np.arange(0, 12.002, 1e-3)
    keep = np.ones(len(t), bool)
    keep[first : first + count] = False
    return t[keep], np.cos(2 * math.pi * plan.circle_hz * t[keep])


def test_a_gap_within_a_turn_has_the_mean_of_the_others() -> None:
    """Twelve samples of 12 000 are the thousandth that is allowed, and all of a part of 10 ms."""
    plan = Plan()
    whole, gap = (steps.fold(t, np.array([x]), 0.0, 0.25, plan) for t, x in (turns(plan, 0, 0), turns(plan, 5000, 12)))
    assert whole.shape == gap.shape == (3, 400, 1)
    assert np.isfinite(gap).all()
    changed = np.unique(np.argwhere(np.abs(gap - whole) > 1e-12)[:, :2], axis=0)
    assert {tuple(at) for at in changed.tolist()} <= {(1, 100), (1, 101)}  # 5.000 to 5.012 s, in the second turn
    assert gap[1, 100, 0] == pytest.approx(whole[[0, 2], 100, 0].mean(), abs=1e-12)


def test_a_part_that_no_turn_has_is_none() -> None:
    t = np.arange(0, 12.002, 1e-3)
    keep = (t % 4 < 1.0) | (t % 4 > 1.05)
    found = steps.fold(t[keep], np.array([t[keep]]), 0.0, 0.25, Plan())
    assert np.isnan(found).any(axis=(0, 2)).sum() in (4, 5)


def test_a_gap_takes_no_scatter_away_that_counts() -> None:
    """Two of the 17 means about the peak of one turn of nine are those of two others: u is right within 3 %."""
    noise, sizes, us = np.random.default_rng(3), [], []
    phase = 2 * math.pi * np.arange(400) / 400

    class Rows(np.ndarray[Any, Any]):
        def without(self, turn: int) -> Any:
            return np.delete(self, turn, axis=0)

    for _ in range(1500):
        x = 5 + 2 * np.cos(phase) + 0.01 * noise.standard_normal((9, 400))
        x[1, :2] = (x[0, :2] + x[2, :2]) / 2
        sizes.append(fit.peak(x.mean(axis=0), 0))
        us.append(jackknife(lambda some: {"peak": fit.peak(some.mean(axis=0), 0)}, [x.view(Rows)])["peak"][0])
    assert math.sqrt(float(np.mean(np.square(us)))) / np.std(sizes) == pytest.approx(1, abs=0.05)


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Simulated:
    """The nominal rig, its motor off centre."""
    return run(RIG, 1, tmp_path_factory.mktemp("run"), truth=nominal(load_rig(RIG)))


def evaluated(
    done: Simulated, monkeypatch: pytest.MonkeyPatch, start_s: float, seconds: float, every: float = math.inf
) -> Any:
    """Codes, places and effects, and the estimates, of the first step without what lies `seconds` from `start_s` on (again and
    again after `every`)."""
    recording: Recording[Any] = Recording.open(done.recording.path, done.procedure.plan)
    first = next(iter(recording.steps(steps.STEP))).start_ns
    read, lost = Step.read, Step.lost

    def gone(step: Step, t_ns: Any) -> Any:
        t = (
            ((t_ns - step.start_ns) * 1e-9 - start_s) % every
            if math.isfinite(every)
            else (t_ns - step.start_ns) * 1e-9 - start_s
        )
        return (t >= 0) & (t < seconds) if step.start_ns == first else np.zeros(len(t_ns), bool)

    def shorter(step: Step, *channels: str) -> Any:
        data = read(step, *channels)
        keep = ~gone(step, data["t_ns"])
        return {name: x[keep] for name, x in data.items()}

    with monkeypatch.context() as patched:
        patched.setattr(Step, "read", shorter)
        patched.setattr(Step, "lost", lambda step: lost(step) + int(gone(step, read(step, "pos_xo")["t_ns"]).sum()))
        findings = Findings()
        try:
            result = done.procedure.evaluate(recording, findings)
        except Ended:
            result = None
    told = [(f.code, f.where, str(f.effect)) for f in findings.told]
    estimates: dict[str, Estimate] = {} if result is None else dict(result.by_way["forward"].estimates)
    return told, estimates, findings.told


def test_a_gap_within_the_allowance_is_analysed(done: Simulated, monkeypatch: pytest.MonkeyPatch) -> None:
    """8 ms of 8 s: nothing is said of them, and no value moves by a twentieth of its U."""
    _, whole, _ = evaluated(done, monkeypatch, 3.0, 0.0)
    told, found, _ = evaluated(done, monkeypatch, 3.0, 0.008)
    assert told == []
    for key, e in found.items():
        assert abs(e.value - whole[key].value) < 0.05 * interval(whole[key]).U, key


def test_a_gap_beyond_the_allowance_is_told_and_analysed(done: Simulated, monkeypatch: pytest.MonkeyPatch) -> None:
    told, found, _ = evaluated(done, monkeypatch, 3.0, 0.05)
    assert told == [("missing-samples", "before, forward, 1", "indeterminate")]
    assert found["peak_i_y/before"].value == pytest.approx(6.88, abs=0.03)


def test_losses_that_leave_parts_empty_in_every_turn_name_bin_s_and_the_link(
    done: Simulated, monkeypatch: pytest.MonkeyPatch
) -> None:
    told, found, findings = evaluated(done, monkeypatch, 1.0, 0.05, 4.0)
    assert found == {}
    assert told == [("missing-samples", "before, forward, 1", effect) for effect in ("indeterminate", "error")]
    assert "larger bin_s (found 0.01 s)" in findings[1].text
    assert "look at the link" in findings[1].text


def test_a_step_that_is_hardly_there_is_told_as_lost(done: Simulated, monkeypatch: pytest.MonkeyPatch) -> None:
    told, found, _ = evaluated(done, monkeypatch, 0.0, 7.999)
    assert found == {}
    assert told == [("missing-samples", "before, forward, 1", "error")]


def test_the_foresight_takes_the_plane_that_the_inboard_loop_holds(done: Simulated) -> None:
    """By hand on T's machine: 10.2 kg g 115/237 = 48.55 N and 344 N/mm times 0.1 mm over 12.1 N/A are 6.86 A; with the
    sensors' plane held it would be 6.68."""
    rig, plan = load_rig("tsbs12"), Plan()
    known = facts("tsbs12", 1, nominal(rig))
    found = foresight.bottom_A(rig, plan, known)
    assert found == pytest.approx(6.86, abs=0.03)
    assert draw(rig, 1, nominal(rig)).quantities["alpha_x_prime"] * 1e-4 / 12.1 == pytest.approx(2.66, abs=0.03)
    assert done.results  # the simulator's, with 22 N across
    peak = next(m for m in done.results if getattr(m, "where", "") == "before, forward")
    assert peak.estimate.value == pytest.approx(found, abs=0.06)


def test_a_circle_that_takes_more_than_the_motor_has_by_its_facts_is_refused() -> None:
    """Twice the stiffness: 117 N at the bottom are 9.7 A, where 8 A are 80 % of the segments' limit."""
    rig = load_rig("tsbs12")
    sound = nominal(rig)
    procedure = load_procedure("load-balancing")
    assert list(procedure.foresees(rig, Plan(), facts("tsbs12", 1, sound))) == []
    (found,) = procedure.foresees(rig, Plan(), facts("tsbs12", 1, {**sound, "geometry.motor_stiffness": 2 * 242.6e3}))
    assert "9.7 A at the bottom of the circle; expected at most 8.0 A" in found
