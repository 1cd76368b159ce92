"""One run path: what campaigns and tests do to a simulated rig is what `bench run` does, to the last digit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench import catalogue
from bench.cli.campaign.job import run_rig
from bench.cli.campaign.tasks import RigTask, StepTask
from bench.cli.compose import Request
from bench.cli.run import execute
from bench.cli.virtual import Knobs, simulated_run
from bench.errors import InterlockError
from bench.procedure import Measured
from bench.recording import Recording
from bench.rigfile import load_rig

TINY = (catalogue.Entry("tiny-levitated", "tests.tiny_procedures", "A look at the supply"),)
PLAN = {"settle_s": 0.3, "average_s": 0.2}


@pytest.fixture
def tiny(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(catalogue, "PROCEDURES", TINY)


def test_the_numbers_are_those_of_bench_run(tmp_path: Path) -> None:
    plan = tuple(f"{key}={value}" for key, value in PLAN.items())
    run = execute(Request("amb-calibration", "tsbs12", seed=5, plan=plan, out=tmp_path / "runs", report=False))
    quick = simulated_run("amb-calibration", "tsbs12", 5, PLAN, tmp_path / "quick.mcap")
    stated = {m.name: (m.value, m.expanded_uncertainty) for m in run.record.measurements}
    found = {m.quantity.name: m.estimate.value for m in quick.results if isinstance(m, Measured)}
    assert found == {name: value for name, (value, _) in stated.items()}
    of_run = Recording[Any].open(run.directory / "recording.mcap")
    assert {"drive", "supply", "thermal"} <= set(quick.recording.streams) == set(of_run.streams)
    names = [channel.name for channel in of_run.streams["telemetry"].channels]
    for ours, theirs in zip(quick.recording.all_steps(), of_run.all_steps(), strict=True):
        of_step = ours.read(*names)
        for name, column in theirs.read(*names).items():
            np.testing.assert_array_equal(column, of_step[name])


@pytest.mark.usefixtures("tiny")
def test_a_seed_gives_the_same_file_byte_for_byte(tmp_path: Path) -> None:
    paths = [tmp_path / "a.mcap", tmp_path / "b.mcap"]
    for path in paths:
        simulated_run("tiny-levitated", "tsbs12", 3, {}, path)
    assert paths[0].read_bytes() == paths[1].read_bytes()


@pytest.mark.usefixtures("tiny")
def test_the_knobs_are_arguments(tmp_path: Path) -> None:
    """The 100 Hz view is what the plain recorder leaves out; a coarser plant is another plant."""
    whole, plain, coarse = (
        simulated_run("tiny-levitated", "tsbs12", 3, {}, tmp_path / f"{n}.mcap", knobs=knobs)
        for n, knobs in enumerate((Knobs(), Knobs(plain=True), Knobs(substeps=1, plain=True)))
    )
    assert plain.recording.path.stat().st_size < whole.recording.path.stat().st_size
    step = [next(iter(r.recording.steps("look"))).mean("i_yi_p") for r in (whole, plain, coarse)]
    assert step[0] == step[1]
    assert step[0] != step[2]


@pytest.mark.usefixtures("tiny")
def test_a_run_that_is_stopped_is_made_safe_and_raises(tmp_path: Path) -> None:
    path = tmp_path / "stopped.mcap"
    with pytest.raises(InterlockError):
        simulated_run("tiny-levitated", "tsbs12", 3, {"act": "refuse"}, path)
    recording = Recording[Any].open(path)
    assert [e["findings"][0]["code"] for e in recording.events("run-end")] == ["interlock"]


def line_of(tmp_path: Path, truth: dict[str, float], plan: dict[str, Any]) -> dict[str, Any]:
    """A rig's line in a campaign's journal."""
    step = StepTask("tiny-levitated", plan, ("supply",), adopt=False)
    return run_rig(RigTask("tsbs12", load_rig("tsbs12").digest, (step,), truth, "none", str(tmp_path)), 3)


@pytest.mark.usefixtures("tiny")
def test_a_stand_that_does_not_fly_cannot_do_the_step(tmp_path: Path) -> None:
    line = line_of(tmp_path, {"position_sign_yi": -1.0}, {})
    assert [c["step"] for c in line["cannot"]] == [1]
    assert "LIFT_TIMEOUT" in line["cannot"][0]["why"]
    assert [f["code"] for f in line["findings"]] == ["controller-fault"]
    assert line["values"] == []


@pytest.mark.usefixtures("tiny")
def test_a_stand_that_flies_and_gives_nothing_can_do_it(tmp_path: Path) -> None:
    for plan in ({"act": "refuse"}, {"then": "nothing"}, {"act": "raise"}):
        assert line_of(tmp_path, {}, plan)["cannot"] == []
