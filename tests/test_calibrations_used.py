"""Calibrations in a run: what simulated chains are given, what a live controller turns out to be, and what the record notes."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest
import tiny_chain
import tiny_procedures

from bench import catalogue
from bench.calibration import Calibration, Need
from bench.cli.virtual import given, simulate, simulated_run
from bench.errors import ConfigError
from bench.findings import SIMULATED_CONTROLLER, Finding
from bench.recording import Recording
from bench.rigfile import RigFile, load_rig
from bench.run.evaluation import evaluate
from bench.run.job import Job, OpenRig
from bench.run.runner import _same_kind
from bench.uncertainty import Estimate

CHAIN = (
    catalogue.Entry("tiny-levitated", "tiny_procedures", "A look at the supply"),
    catalogue.Entry("tiny-chained", "tiny_chain", "What differs from it"),
)
VALUE = {"supply": Estimate.exact(148.0, "V")}


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(catalogue, "PROCEDURES", CHAIN)


@pytest.fixture(scope="module")
def rig() -> RigFile:
    return load_rig("tsbs12")


def test_a_chain_of_simulated_runs(tmp_path: Path) -> None:
    first = simulated_run("tiny-levitated", "tsbs12", 5, {}, tmp_path / "a.mcap")
    known = {"tiny-levitated": first.calibration()}
    assert known["tiny-levitated"].run_id == "tiny-levitated-sim-5"
    assert known["tiny-levitated"].settings == {"seconds": 0.5, "bias_A": 3.0}
    second = simulated_run("tiny-chained", "tsbs12", 5, {}, tmp_path / "b.mcap", calibrations=known)
    (excess,) = second.results
    assert {i.id for i in excess.estimate.sensitivities} == {"meter", "tiny-levitated-sim-5/meter"}  # type: ignore[union-attr]
    third = second.calibration()
    assert {u.run_id for u in third.used} == {"tiny-levitated-sim-5"}
    assert set(third.influences) == {"tiny-chained-sim-5/meter", "tiny-levitated-sim-5/meter"}
    _, results = simulate("tiny-chained", "tsbs12", 5, {}, tmp_path / "c.mcap", None, known)
    assert results == second.results


def test_a_chain_out_of_order_or_at_another_bias(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="found no tiny-levitated"):
        simulate("tiny-chained", "tsbs12", 5, {}, tmp_path / "a.mcap")
    other = Calibration("tiny-levitated", VALUE, {"bias_A": 2.5})
    with pytest.raises(ConfigError, match=r"bias_A = 2\.5; 3 is needed"):
        simulate("tiny-chained", "tsbs12", 5, {}, tmp_path / "a.mcap", None, {"tiny-levitated": other})
    assert list(tmp_path.iterdir()) == []
    assert given([Need("tiny-levitated")], {"tiny-levitated": other}) == [other]


def live(rig: RigFile, served: bool) -> OpenRig:
    found = [Finding(SIMULATED_CONTROLLER, "the controller says so")] if served else []
    nothing: Any = None
    return OpenRig(nothing, (), nothing, nothing, (), None, found)


@pytest.mark.parametrize(("backend", "served", "fits"), [
    ("live", False, True), ("live", True, False), ("served", True, True), ("served", False, False),
])  # fmt: skip
def test_a_served_rig_is_not_the_real_one(rig: RigFile, backend: Any, served: bool, fits: bool) -> None:
    """Which of the two a link leads to is known only when it is open: then it is checked, before anything is made."""
    c = Calibration("tiny-levitated", VALUE, backend=backend)
    job = Job(tiny_chain.procedure, rig, tiny_procedures.Plan(), {}, "live", calibrations=(c,))
    if fits:
        _same_kind(job, live(rig, served))
        return
    with pytest.raises(ConfigError, match="nothing was started"):
        _same_kind(job, live(rig, served))


def test_two_runs_of_one_calibration_are_noted(tmp_path: Path) -> None:
    """A calibration by the second rests on the first; a run that uses both may find another first beside it."""
    first = simulated_run("tiny-levitated", "tsbs12", 5, {}, tmp_path / "a.mcap").calibration()
    known = {"tiny-levitated": first}
    second = simulated_run("tiny-chained", "tsbs12", 5, {}, tmp_path / "b.mcap", calibrations=known).calibration()
    both: Any = dataclasses.replace(
        tiny_chain.procedure, needs=lambda _: (Need("tiny-levitated"), Need("tiny-chained"))
    )

    class Stored(Recording[Any]):
        calibrations = (dataclasses.replace(first, run_id="another"), second)

    recording: Recording[Any] = Stored.open(tmp_path / "b.mcap", tiny_procedures.Plan)
    codes = [f.code for f in evaluate(both, recording, {}, stopped=False).findings]
    assert codes == ["calibrations-of-two-runs"]
