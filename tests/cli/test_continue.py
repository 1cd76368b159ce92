"""`bench run --continue RUN`: what may be typed, and each refusal in one message with status 2."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from in_process import Bench, bench_in_process
from stopped_runs import CALIBRATION, ran, stopped_after

from bench import lock
from bench.cli.compose import Request
from bench.recording import Recording
from bench.run import stopped
from bench.run.runner import RunResult
from procedures.spindown.plan import Plan

ROOT = Path(__file__).parents[2]


@pytest.fixture
def bench(capsys: pytest.CaptureFixture[str]) -> Bench:
    return bench_in_process(capsys)


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    return stopped_after(5, tmp_path_factory.mktemp("first"))


def refused(bench: Bench, path: Path, *more: str) -> str:
    """What is said; nothing is started."""
    before = sorted(path.parent.iterdir())
    status, out, err = bench("run", *more, "--continue", str(path), "--out", str(path.parent))
    assert (status, out) == (2, "")
    assert sorted(path.parent.iterdir()) == before
    return err


def test_nothing_but_the_run_is_typed(bench: Bench, first: RunResult, tmp_path: Path) -> None:
    status, out, err = bench("run", "--continue", str(first.directory), "--out", str(tmp_path), "--no-report", "-v")
    assert status == 0, err
    assert Path(out.strip()).parent == tmp_path
    assert "the first 5 steps are those of" in " ".join(err.split())


def test_a_run_that_is_stopped_says_how_it_is_continued(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An operator at the terminal answers stop at the third hanging."""
    read, write = os.pipe()
    os.write(write, b"\n" * 3 + b"stop\n")
    os.close(write)
    with os.fdopen(read) as answers:
        monkeypatch.setattr("sys.stdin", answers)
        plan = (word for text in CALIBRATION.plan for word in ("--plan", text))
        status, out, err = bench("run", "amb-calibration", "--rig", "tsbs12", "--operator", "console", "--out",
                                 str(tmp_path), "--no-report", *plan)  # fmt: skip
    assert status == 4
    assert f"go on    bench run --continue {out.strip()}" in err


def test_options_that_say_the_same_are_taken(bench: Bench, first: RunResult, tmp_path: Path) -> None:
    same = ("amb-calibration", "--rig", "tsbs12", "--backend", "sim", "--seed", "1", "--plan", "angles=1", "--plan", "rounds=1",
            "--plan", "settle_s=0.3", "--plan", "average_ms=200")  # fmt: skip
    status, _, err = bench("run", *same, "--continue", str(first.directory), "--out", str(tmp_path), "--no-report")
    assert status == 0, err


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        (("force-constant",), "PROCEDURE: found force-constant; the stopped run has amb-calibration"),
        (("--seed", "2"), "--seed: found 2; the stopped run has 1"),
        (("--visit", "1"), "--visit: found 1; the stopped run has 0"),
        (("--backend", "live"), "--backend: found live; the stopped run has sim"),
        (("--truth", "tilt=0.01"), "--truth: found tilt=0.01; the stopped run has none"),
        (("--spec", "x.toml"), "--spec: expected none"),
        (("--plan", "settle_s=0.4"), "average_s: found 1.0; the stopped run has 0.2"),
        (("--rig", "amb5dof"), "cannot be continued with another rig file"),
    ],
)
def test_options_that_contradict_are_refused(bench: Bench, first: RunResult, typed: tuple[str, ...], said: str) -> None:
    assert said in refused(bench, first.directory, *typed)


def test_a_changed_rig_file_is_refused_with_what_differs(bench: Bench, tmp_path: Path) -> None:
    for name in ("tsbs12.toml", "tsbs12.dbc"):
        shutil.copy(ROOT / "rigs" / name, tmp_path / name)
    rig = tmp_path / "tsbs12.toml"
    asked = Request("amb-calibration", str(rig), seed=1, plan=CALIBRATION.plan)
    path = stopped_after(2, tmp_path / "runs", asked).directory
    text = rig.read_text()
    rig.write_text(text.replace("hanger = { value = 0.25,", "hanger = { value = 0.26,"))
    said = refused(bench, path)
    assert "hanger.value: found 0.26; the stopped run has 0.25" in said
    assert said.count("found") == 1
    rig.write_text(text + "\n# a remark changes nothing\n")
    status, _, err = bench("run", "--continue", str(path), "--out", str(tmp_path / "more"), "--no-report")
    assert status == 0, err
    rig.unlink()
    assert "Next" in refused(bench, path)


def test_a_run_that_came_to_its_end(bench: Bench, tmp_path: Path) -> None:
    path = ran(CALIBRATION, tmp_path / "my runs").directory
    said = refused(bench, path)
    assert "this run came to its end; expected one that was stopped" in said
    assert f"bench analyse '{path}'" in said


def test_a_run_that_is_still_being_written(bench: Bench, first: RunResult, tmp_path: Path) -> None:
    path = shutil.copytree(first.directory, tmp_path / "runs" / first.directory.name)
    with (path / "recording.mcap").open("rb") as file:
        lock.hold(file.fileno())
        assert "is still being written" in refused(bench, path)


def test_a_run_with_nothing_completed(bench: Bench, tmp_path: Path) -> None:
    path = stopped_after(0, tmp_path / "runs").directory
    assert "found no step 'hang' that was completed: there is nothing to continue" in refused(bench, path)


def test_a_procedure_that_cannot_go_on_in_the_middle_says_which_can(bench: Bench, tmp_path: Path) -> None:
    path = stopped_after(0, tmp_path / "runs", Request("spindown", "tsbs12", seed=1)).directory
    said = refused(bench, path)
    assert "spindown cannot be continued" in said
    assert "expected one of amb-calibration, torque-constant" in said
    assert "Next: `bench run spindown --rig tsbs12` anew" in " ".join(said.split())


def test_without_a_recording_or_a_run(bench: Bench, first: RunResult, tmp_path: Path) -> None:
    path = shutil.copytree(first.directory, tmp_path / "runs" / first.directory.name)
    (path / "recording.mcap").write_bytes(b"no recording")
    assert "cannot be continued" in refused(bench, path)
    (path / "recording.mcap").unlink()
    assert "holds no recording.mcap" in refused(bench, path)
    assert "expected a run directory" in refused(bench, tmp_path / "runs" / "none")


def test_neither_a_procedure_nor_a_run(bench: Bench) -> None:
    status, out, err = bench("run")
    assert (status, out) == (2, "")
    assert "expected PROCEDURE and --rig RIG, or --continue RUN" in err


def test_a_run_of_the_machine_is_made_anew_on_the_machine(tmp_path: Path) -> None:
    """Of a recording of the simulation, which says that it is one of the machine."""
    path = stopped_after(0, tmp_path / "runs", Request("spindown", "tsbs12", seed=1)).directory
    recording = Recording.open(path / "recording.mcap", Plan)
    assert stopped.anew(recording) == "`bench run spindown --rig tsbs12`"
    recording.run["backend"] = "live"
    assert stopped.anew(recording) == "`bench run spindown --rig tsbs12 --backend live`"
