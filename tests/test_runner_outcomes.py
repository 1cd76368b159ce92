"""Which outcome a run has: by what its analysis yields, by limits, by missing steps and quantities."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest
import tiny_procedures
from test_runner import Run, codes, runs_in
from tiny_procedures import Plan

from bench.errors import BenchError
from bench.record.limits import Limit, Verdict
from bench.record.outcomes import Outcome
from bench.rigfile import RigFile, load_rig


@pytest.fixture(scope="module")
def rig() -> RigFile:
    return load_rig("tsbs12")


@pytest.fixture
def run(tmp_path: Path, rig: RigFile) -> Run:
    return runs_in(tmp_path / "runs", rig)


@pytest.mark.parametrize(
    ("then", "outcome", "code"),
    [
        ("nothing", Outcome.ERROR, None),
        ("doubt", Outcome.INDETERMINATE, "doubt"),
        ("raise", Outcome.ERROR, "analysis-failed"),
    ],
)
def test_what_analyse_yields_decides(run: Run, then: Any, outcome: Outcome, code: str | None) -> None:
    result = run(Plan(then=then))
    assert result.outcome is outcome
    assert codes(result) == ([code] if code else [])
    verdict = result.record.measurements[0].verdict
    assert verdict is (Verdict.NONE if then == "doubt" else Verdict.MISSING)


def test_a_limit_at_a_place_that_was_not_measured_is_a_missing_quantity(run: Run) -> None:
    result = run(limits={"supply@hall": Limit(140, 160, "V", "test", True)})
    assert result.outcome is Outcome.ERROR
    assert [(m.where, m.verdict) for m in result.record.measurements] == [
        ("", Verdict.NONE),
        ("hall", Verdict.MISSING),
    ]


def test_what_a_note_says_is_not_told_does_not_pass_by_another_place(run: Run) -> None:
    limits = {"supply": Limit(140, 160, "V", "test", True)}
    assert run(Plan(then="note")).outcome is Outcome.DONE  # no limit asks for it
    result = run(Plan(then="note"), limits=limits)
    assert result.outcome is Outcome.ERROR
    assert [(m.where, m.verdict) for m in result.record.measurements] == [
        ("", Verdict.PASS),
        ("hall", Verdict.MISSING),
    ]
    assert run(limits=limits).outcome is Outcome.PASS


@pytest.mark.parametrize(
    ("low", "high", "outcome"),
    [(140, 160, Outcome.PASS), (160, 180, Outcome.FAIL), (148, 160, Outcome.INDETERMINATE)],
)
def test_limits_decide(run: Run, low: float, high: float, outcome: Outcome) -> None:
    assert run(limits={"supply": Limit(low, high, "V", "test", True)}).outcome is outcome


@pytest.mark.parametrize(
    ("least", "outcome"), [(10**9, Outcome.INDETERMINATE), (3, Outcome.INDETERMINATE), (2, Outcome.PASS)]
)
def test_a_recording_that_lacks_steps_of_its_plan_is_no_pass(run: Run, least: int, outcome: Outcome) -> None:
    limits = {"supply": Limit(140, 160, "V", "test", True)}
    counted = dataclasses.replace(tiny_procedures.resting, step_count=lambda _: least)
    result = run(procedure=counted, limits=limits)
    assert (result.outcome, "steps-missing" in codes(result)) == (outcome, outcome is not Outcome.PASS)
    ends_early = dataclasses.replace(counted, fewest_steps=lambda _: 2)
    assert run(procedure=ends_early, limits=limits).outcome is Outcome.PASS
    doubtful = run(Plan(then="doubt"), procedure=counted)
    assert codes(doubtful) == ["doubt"]  # whose reason is said already


def test_an_undeclared_quantity_is_an_error(run: Run) -> None:
    odd = dataclasses.replace(tiny_procedures.resting, measures=())
    result = run(procedure=odd)
    assert result.outcome is Outcome.ERROR
    assert "does not declare" in result.reason


def test_a_failing_report_is_a_finding_and_keeps_the_verdict(run: Run) -> None:
    def broken(*_: Any) -> None:
        raise BenchError("no ink")

    result = run(report=broken)
    assert result.outcome is Outcome.DONE
    assert codes(result) == ["report-failed"]
    assert "no ink" in (result.directory / "record.json").read_text()
