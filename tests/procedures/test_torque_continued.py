"""A torque calibration that was killed goes on: steps, results, and a scale that changed meanwhile."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stopped_runs import Stopping, ran, stopped_after, went_on
from test_torque_balance import P, made

from bench.cli.compose import Request
from bench.cli.loading import load_procedure
from bench.cli.virtual import flown
from bench.findings import Effect, Finding
from bench.progress import Silent
from bench.record.outcomes import Outcome
from bench.recording import Recording
from bench.recording.earlier import AGAIN
from bench.run import stopped
from bench.run.runner import RunResult
from bench.rundir import RunDirectory
from procedures.shared.continued import DRIFTED
from procedures.torque_constant import halves
from procedures.torque_constant.fit import Steps, balance
from procedures.torque_constant.plan import Plan
from procedures.torque_constant.procedure import sequence
from procedures.torque_constant.steps import read_torques

PLAN = ('masses=["M2", "M3"]', "settle_s=0.7", "average_s=0.3")
SHORT = {"masses": ["M2", "M3"], "settle_s": 0.7, "average_s": 0.3}
ASKED = Request("torque-constant", "tsbs12", seed=1, plan=PLAN)
PROCEDURE = load_procedure("torque-constant")


def opened(result: RunResult) -> Recording[Any]:
    return Recording.open(result.directory / "recording.mcap", PROCEDURE.plan)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    return ran(ASKED, tmp_path_factory.mktemp("whole"))


@pytest.fixture(scope="module")
def continued(whole: RunResult, tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    """The process was killed when two thirds of the file were written."""
    folder = tmp_path_factory.mktemp("killed")
    path = shutil.copytree(whole.directory, folder / whole.directory.name)
    data = (path / "recording.mcap").read_bytes()
    (path / "recording.mcap").write_bytes(data[: 2 * len(data) // 3])
    assert Recording.open(path / "recording.mcap").truncated
    return went_on(path, folder / "on")


def taken(recording: Recording[Any], end_ns: int) -> list[tuple[str, int, bytes]]:
    """What stands there to the end of a step, without views, of which a killed process has not written the last ones."""
    return [m for m in recording.everything() if m[1] <= end_ns and not m[0].endswith("/view")]


def test_it_hangs_what_is_left(whole: RunResult, continued: RunResult) -> None:
    """All loads once, one twice; encoder and wiring are looked at again, the detent is not."""
    before, after = opened(whole), opened(continued)
    labels = [dict(s.labels) for s in before.steps("lever")]
    assert [dict(s.labels) for s in after.steps("lever")] == labels
    (again,) = after.steps(f"lever{AGAIN}")
    (run,) = continued.record.continues
    done = [s for s in after.steps("lever") if s.end_ns < again.start_ns]
    assert 10 < len(done) < len(labels)
    assert dict(again.labels) == dict(done[-1].labels)
    assert run.stopped == "killed"
    kinds = [s.kind for s in after.all_steps()]
    assert [kinds.count(kind) for kind in ("probe", "wiring", "detent")] == [4, 8, 4]
    one, other = (taken(recording, done[-1].end_ns) for recording in (before, after))
    assert one == other
    assert len(one) > 1000


def test_its_results_are_those_of_the_whole_run(whole: RunResult, continued: RunResult) -> None:
    assert continued.outcome is Outcome.PASS
    assert [f.code for f in continued.record.findings] == ["continued"]
    for one, other in zip(whole.record.measurements, continued.record.measurements, strict=True):
        for a, b in ((one, other), (other, one)):
            assert a.value is not None
            assert b.interval is not None
            assert b.interval[0] < a.value < b.interval[1], a.name


def test_the_pause_is_no_time_of_the_fit(whole: RunResult, continued: RunResult) -> None:
    """Minutes between the halves would part them for a drift that is even in time."""
    one, other = (read_torques(opened(r)).steps for r in (whole, continued))
    assert np.diff(other.time).max() < np.diff(one.time).max() + 10
    assert np.diff(one.time).max() < 10
    assert set(other.half.tolist()) == {0, 1}


@pytest.mark.parametrize("steps", [10, 22, 30])
def test_wherever_it_is_stopped(tmp_path: Path, steps: int) -> None:
    """Before any load, within a phase angle, and after its last step."""
    result = went_on(stopped_after(steps + 1, tmp_path / "a", ASKED).directory, tmp_path / "b")
    assert result.outcome is Outcome.PASS
    recorded = opened(result).steps("lever")
    plan = Plan.model_validate(SHORT)
    assert [(s.labels["side"], s.labels["load"]) for s in recorded] == 5 * [(a, b.label) for a, b in sequence(plan)]


def test_stopped_again_before_anything_was_repeated(tmp_path: Path) -> None:
    """Two seams between the same two steps are one."""
    nothing = stopped_after(29, tmp_path / "a", ASKED).directory
    again = went_on(nothing, tmp_path / "b", progress=Stopping(4)).directory
    result = went_on(again, tmp_path / "c")
    assert result.outcome is Outcome.PASS
    assert len(result.record.continues) == 2
    assert sorted(set(read_torques(opened(result)).steps.half.tolist())) == [0, 1]


class Counting(Silent):
    """How many steps are said to come, and how many come."""

    said = came = 0

    def total(self, steps: int) -> None:
        self.said = max(self.said, steps)  # 0 when the machine's part ends

    def step(self, text: str) -> None:
        self.came += 1


def test_no_more_steps_come_than_are_said(tmp_path: Path) -> None:
    """All that comes before the loads is said to come again; the detent's four steps do not."""
    counting = Counting()
    went_on(stopped_after(29, tmp_path / "a", ASKED).directory, tmp_path / "b", progress=counting)
    assert counting.said == counting.came + 4


def parted(s: Steps, at: int, base: float = 0.0, scale: float = 0.0, noise: float = 0.0) -> Steps:
    """Stopped before a step: from there on another constant current, and loads take another share of theirs."""
    half = (np.arange(len(s.side)) >= at).astype(np.int64)
    more = half * (base + scale * s.segments[:, 0]) + noise * np.random.default_rng(7).normal(size=len(half))
    return replace(s, segments=s.segments + more[:, None], half=half)


@pytest.mark.parametrize("at", range(15, 31, 3))
def test_a_constant_current_that_changes_at_a_seam_drops_out(at: int) -> None:
    found = balance(parted(made(2.87, 0.004), at, base=0.05), P, 3, 8.0)
    assert found.alpha == pytest.approx(2.87, rel=1e-9)
    assert found.gamma_0 == pytest.approx(0.004, abs=1e-9)


def test_a_scale_that_changes_at_a_seam_is_found_with_what_it_moves() -> None:
    """By hand: 0.3 % more current for each load after the seam; and by the fit of the results itself, how far they move."""
    sound, drifted = (parted(made(2.87, 0.004), 22, scale=d, noise=5e-4) for d in (0.0, 3e-3))
    b, was = (balance(s, P, 3, 8.0) for s in (drifted, sound))
    c = halves.changes(b, drifted, 1)[0]
    assert c.found.value == pytest.approx(3e-3, abs=4 * c.found.u)
    assert c.found.u < 3e-4
    assert c.moved == pytest.approx([b.alpha - was.alpha, b.gamma_0 - was.gamma_0], rel=0.2)
    assert max(abs(one.found.t) for one in halves.changes(was, sound, 1)) < 3.5


def test_a_peak_that_moves_at_a_seam_is_found_with_what_it_moves() -> None:
    """Steps of two machines, whose encoders' zeros are 1 mrad apart: the second half is the other's."""
    one, other = (parted(made(2.87, g), 22, noise=5e-4) for g in (0.004, 0.005))
    after = one.half > 0
    turned = replace(one, segments=np.where(after[:, None], other.segments, one.segments))
    b, was = (balance(s, P, 3, 8.0) for s in (turned, one))
    c = halves.changes(b, turned, 1)[1]
    assert c.found.value == pytest.approx(1e-3, abs=4 * c.found.u)
    assert c.found.u < 2e-4
    assert c.moved == pytest.approx([b.alpha - was.alpha, b.gamma_0 - was.gamma_0], rel=0.3, abs=2e-5)


@pytest.mark.parametrize(("factor", "told"), [(1.0, False), (1.002, True)])
def test_segments_that_pull_otherwise_in_the_second_half(tmp_path: Path, factor: float, told: bool) -> None:
    """Torque per current is 0.2 % more there: alpha_tau is between both, and the run is INDETERMINATE."""
    run = RunDirectory(tmp_path)
    half = flown("torque-constant", "tsbs12", 3, SHORT, run.recording, progress=Stopping(30))
    gains = {f"segment_gain_{k}": half.drawn.values[f"segment_gain_{k}"] * factor for k in range(4)}
    earlier = stopped.left_of(run, stopped.opened(run), PROCEDURE)
    path = tmp_path / "whole.mcap"
    done = flown("torque-constant", "tsbs12", 3, SHORT, path, gains, earlier=earlier).analysed()
    found = {f.code: f for f in done.results if isinstance(f, Finding)}
    assert (DRIFTED in found) == told
    if told:
        assert found[DRIFTED].effect is Effect.INDETERMINATE
