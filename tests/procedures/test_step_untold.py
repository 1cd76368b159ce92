"""What fits of steps cannot tell is told by a finding that puts it in doubt by name, and costs nothing else."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bench.errors import AnalysisError
from bench.findings import Effect
from bench.rigfile import load_rig
from bench.uncertainty import Estimate
from procedures.step import checks, coupled, estimates, oscillation, response, settling, untold
from procedures.step.plan import Plan
from procedures.step.steps import Case

RIG = load_rig("amb5dof")
UP = Case("A", 0.0, "z", 10e-6, 1)


def made(count: int = 4, level: float = 1.0) -> list[oscillation.One]:
    """Steps of one oscillation beside what a fast integrator leaves, at 1 kHz; a tilt of which there is nothing but noise."""
    rng, t, period = np.random.default_rng(3), np.arange(-20, 800) * 1e-3, 1e-3
    pole, part = np.array([-82 + 328j]), np.array([-1.0 + 0.2j])
    swung = (np.exp(np.outer(np.maximum(t, 0), pole)) @ (part * oscillation.shrinks(pole, period))).real
    y = np.where(t > 0, level + 0.1 * np.exp(-np.maximum(t, 0) / 0.05) + swung, 0.0)
    return [oscillation.One(t, np.array([y, 0 * y]) + 1e-3 * rng.normal(size=(2, t.size))) for _ in range(count)]


def of(case: Case, ones: list[oscillation.One], told: dict[str, Estimate]) -> estimates.Result:
    return estimates.Result(case, tuple(ones), None, settling.Settling(0.1, 0.02, np.zeros(0)), 0.0, told)


def test_a_doubt_that_runs_away_is_none(capfd: pytest.CaptureFixture[str]) -> None:
    """Neither what is searched nor what is known of it counts: off by its uncertainty a rate is beyond numbers, or what a tilt
    weighs is."""
    data = replace(coupled._data(made(), 0.05, coupled.ANY), noise=1.0)
    found = np.array([0.82, 3.28, 0.1, 0.1, 0.3, 0.1, 0.0, 0.2])
    for rows in ((2, 3, 5), (2, 3, 6)):
        slopes = np.zeros((12, len(found)))
        slopes[np.arange(-coupled.KNOWN, 0), rows] = 1e-6
        assert coupled._doubts(data, found, slopes) is None
        assert len(coupled._doubts(data, found, 1e6 * slopes) or ()) == coupled.KNOWN
    assert capfd.readouterr() == ("", "")


def test_what_is_no_number_does_not_come_to_lapack(capfd: pytest.CaptureFixture[str]) -> None:
    with np.errstate(over="ignore"), pytest.raises(FloatingPointError, match="astray"):
        coupled._solved(np.full((4, 2), 1e200), np.ones(4))
    assert capfd.readouterr() == ("", "")


def test_a_case_that_is_not_told_is_in_doubt_by_name() -> None:
    one = Estimate.exact(0.4, "1")
    other = Case("A", 0.0, "z", 20e-6, 1)
    results = {UP: of(UP, [], {}), other: of(other, [], {"overshoot": one, "bandwidth": one})}
    told = {UP.group: {"damping": one, "natural_frequency": one}}
    (finding,) = untold.find_untold(results, told, {}, RIG)
    assert (finding.code, finding.where, finding.effect) == ("fit-unsteady", UP.where, Effect.INDETERMINATE)
    lacking = {f"{q}@{UP.where}" for q in ("overshoot", "bandwidth")}
    assert {*finding.concerns} == lacking | {f"{q}@{UP.group}" for q in ("size_effect", "way_effect")}
    (finding,) = untold.find_untold({UP: of(UP, [], {"overshoot": one})}, told, {}, RIG)
    assert finding.concerns == (f"bandwidth@{UP.where}",)


def test_a_group_whose_doubts_run_away_tells_no_damping(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is in doubt; a group without an oscillation has its note alone."""
    ones = made()
    results = {UP: of(UP, ones, {"overshoot": Estimate.exact(0.4, "1"), "bandwidth": Estimate.exact(76.0, "Hz")})}
    monkeypatch.setattr(coupled, "_doubts", lambda *_: None)
    assert estimates._oscillation(UP.group, [*results.values()], RIG, 4e-5) == {}
    told: dict[str, dict[str, Estimate]] = {UP.group: {}}
    why = untold.groups(results, told, RIG)
    assert why == {UP.group: untold.Why.ASTRAY}
    assert not [*checks.of_results(results, told, Plan(), untold=why)]
    (finding,) = untold.find_untold(results, told, why, RIG)
    assert {*finding.concerns} == {f"{q}@{UP.group}" for q in ("damping", "natural_frequency")}

    def unfitted(*_: object, **__: object) -> None:
        raise AnalysisError("no oscillation that dies away fits the response")

    monkeypatch.setattr(untold, "swing", unfitted)
    assert untold.groups(results, told, RIG) == {}
    assert [f.code for f in checks.of_results(results, told, Plan(), untold={})] == ["no-oscillation"]


def test_a_gain_that_does_not_fall_is_no_missing_oscillation() -> None:
    swing = oscillation.Swing(np.array([-82 + 328j]), np.array([-1 + 0j]), 1.0, 0.0, 0.0)
    told = {"overshoot": Estimate.exact(0.4, "1")}
    result = estimates.Result(UP, (), swing, settling.Settling(0.1, 0.02, np.zeros(0)), math.nan, told)
    (finding,) = untold.find_untold({UP: result}, {UP.group: {}}, {}, RIG)
    assert f"up to {response.SCAN_HZ[-1]:g} Hz" in finding.text
