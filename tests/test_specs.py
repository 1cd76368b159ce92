"""Spec files: what ships, and every way to get one wrong."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Literal

import pytest

from bench import catalogue
from bench.cli.loading import load_procedure
from bench.errors import ConfigError
from bench.findings import Effect
from bench.procedure import BenchPlan, Measured, Procedure, Quantity
from bench.procedure.roles import RigState
from bench.record.limits import Limit
from bench.record.specs import INSTALLED, applied, in_unit, load_spec, misnamed, parse_spec
from bench.rigfile import load_rig

ENTRY = 'unit = "N/A", source = "house", verified = false'


class Settings(BenchPlan):
    """Of the kinds that plans have."""

    bias_A: float = 3.0
    speeds_rad_s: tuple[float, ...] = (math.pi * 2000 / 30, math.pi * 10000 / 30)
    law: Literal["PID", "CCS", "CAC"] = "CCS"
    repeat: bool = True
    observer: bool | None = None


def of_settings(unit: str) -> Procedure:
    """A procedure `p` with these settings, that measures q."""

    def acquire(*_: object) -> None: ...

    def analyse(*_: object) -> Iterator[Measured]:
        yield from ()

    return Procedure(
        "p", "A test", (Quantity("q", unit, "what is limited"),), RigState.READY, Settings, acquire, analyse
    )


P, P_IN_N = of_settings("N/A"), of_settings("N")


def spec_of(folder: Path, entries: str) -> Path:
    """The folder, with limits of procedure p for rig r."""
    (folder / "r.toml").write_text(f"schema = 1\n[limits.p]\n{entries}")
    return folder


def test_the_shipped_spec() -> None:
    limits = load_spec(
        "tsbs12", "amb-calibration", load_procedure("amb-calibration"), (INSTALLED,), rig=load_rig("tsbs12")
    )
    assert set(limits) == {"K_i", "K_o"}
    assert (limits["K_i"].low, limits["K_i"].high) == pytest.approx((65.88, 80.52))
    assert (limits["K_o"].low, limits["K_o"].high) == pytest.approx((66.96, 81.84))
    assert limits["K_i"].unit == "N/A"
    assert limits["K_i"].verified


def test_no_spec_no_limits(tmp_path: Path) -> None:
    assert load_spec("other", "amb-calibration", folders=(tmp_path,)) == {}
    assert load_spec("tsbs12", "other-procedure", folders=(INSTALLED,)) == {}


def test_one_sided() -> None:
    spec = parse_spec(f"schema = 1\n[limits.p]\nq = {{ high = 3, {ENTRY} }}")
    assert spec == {"p": {"q": Limit(None, 3.0, "N/A", "house", False)}}


def test_a_limit_of_an_undeclared_quantity_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"limits\.p\.K_o: found K_o; expected one of q"):
        load_spec("r", "p", P, (spec_of(tmp_path, f"K_o = {{ low = 3, {ENTRY} }}"),))


def test_a_limit_in_another_unit_is_refused_before_anything_is_measured(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"limits\.p\.q\.unit: found 'N/A'; expected 'N', the unit of q"):
        load_spec("r", "p", P_IN_N, (spec_of(tmp_path, f"q = {{ low = 3, {ENTRY} }}"),))


def test_a_limit_in_another_unit_in_an_old_recording_costs_no_result() -> None:
    """It came with the recording; its own quantity alone is not judged."""
    limit = parse_spec(f"schema = 1\n[limits.p]\nq = {{ low = 3, {ENTRY} }}")["p"]
    left, (found,) = in_unit({**limit, "r": replace(limit["q"], unit="N")}, P_IN_N.measures)
    assert (set(left), found.code, found.effect, found.concerns) == ({"r"}, "limit-unit", Effect.ERROR, ("q",))


def test_limits_of_a_misspelt_procedure_are_refused(tmp_path: Path) -> None:
    (tmp_path / "r.toml").write_text(f"schema = 1\n[limits.amb-calibratoin]\nK_i = {{ low = 3, {ENTRY} }}")
    (problem,) = misnamed("r", (tmp_path,))
    assert (problem.key, problem.expected) == (
        "limits.amb-calibratoin",
        "the name of a procedure, such as amb-calibration",
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("schema = 2", "newer"),
        ("", "schema"),
        ("schema = true", "schema"),
        ("schema = ", "not TOML"),
        ("schema = 1\nlimit = 3", "limit"),
        ("schema = 1\nlimits = 3", "a table"),
        ("schema = 1\n[limits]\np = 3", "limits.p"),
        ("schema = 1\n[limits.p]\nq = 3", "limits.p.q"),
        (f"schema = 1\n[limits.p]\nq = {{ hihg = 3, {ENTRY} }}", "limits.p.q.hihg"),
        (f"schema = 1\n[limits.p]\nq = {{ {ENTRY} }}", "low None, high None"),
        (f"schema = 1\n[limits.p]\nq = {{ low = nan, {ENTRY} }}", "finite"),
        (f"schema = 1\n[limits.p]\nq = {{ low = '3', {ENTRY} }}", "limits.p.q.low"),
        (f"schema = 1\n[limits.p]\nq = {{ nominal = 3, {ENTRY} }}", "nominal and relative"),
        (f"schema = 1\n[limits.p]\nq = {{ nominal = 3, relative = 0.1, low = 1, {ENTRY} }}", "nominal and relative"),
        (f"schema = 1\n[limits.p]\nq = {{ nominal = 3, relative = -0.1, {ENTRY} }}", "relative"),
        ("schema = 1\n[limits.p]\nq = { low = 3 }", "limits.p.q.source"),
        (f"schema = 1\n[limits.p]\nq = {{ low = 3, at = 3, {ENTRY} }}", "limits.p.q.at"),
        (f"schema = 1\n[limits.p]\nq = {{ low = 3, at = {{ a = [] }}, {ENTRY} }}", "empty list"),
        (f"schema = 1\n[limits.p]\nq = {{ low = 3, at = {{ a = {{ low = 2, high = 1 }} }}, {ENTRY} }}", "low <= high"),
        (f"schema = 1\n[limits.p]\nq = {{ low = 3, at = {{ a = {{ lwo = 2 }} }}, {ENTRY} }}", "limits.p.q.at"),
    ],
)
def test_refused(text: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        parse_spec(text)


def test_every_problem_is_named_at_once() -> None:
    with pytest.raises(ConfigError) as caught:
        parse_spec("schema = 1\nx = 1\n[limits.p]\nq = { low = 3 }\nr = 4")
    assert len(caught.value.problems) == 5


@pytest.mark.parametrize(
    ("at", "holds"),
    [
        ("bias_A = 3", True),
        ("bias_A = 3.0", True),
        ("bias_A = 2", False),
        ("bias_A = { low = 2, high = 3 }", True),
        ("bias_A = { high = 2.9 }", False),
        ("bias_mA = 3000", True),
        ("speeds_rpm = { low = 2000, high = 10000 }", True),
        ("speeds_rpm = { low = 2001 }", False),
        ("speeds_rpm = [2000, 10000]", True),
        ("speeds_rpm = 2000", False),
        ('law = "CCS"', True),
        ('law = ["CAC", "CCS"]', True),
        ('law = ["CAC"]', False),
        ("law = { high = 1 }", False),
        ("repeat = true", True),
        ("repeat = false", False),
        ("observer = true", False),
        ('law = "CCS", bias_A = 2', False),
    ],
)
def test_a_limit_holds_at_the_settings_that_it_was_stated_for(at: str, holds: bool) -> None:
    limits = parse_spec(f"schema = 1\n[limits.p]\nq = {{ low = 3, at = {{ {at} }}, {ENTRY} }}")["p"]
    found, notes = applied(limits, Settings())
    assert (set(found), [f.code for f in notes]) == (({"q"}, []) if holds else (set(), ["limit-not-applied"]))


def test_a_limit_for_what_a_plan_does_not_measure_judges_nothing_and_says_so() -> None:
    limits = parse_spec(f"schema = 1\n[limits.p]\nq = {{ low = 3, {ENTRY} }}\n'q@front' = {{ low = 4, {ENTRY} }}")["p"]
    assert set(applied(limits, Settings())[0]) == {"q", "q@front"}
    found, (note,) = applied(limits, Settings(), ["q"])
    assert (set(found), note.code) == (set(), "limit-not-applied")
    assert note.text == "no verdict on q, q@front: this plan does not measure it"


@pytest.mark.parametrize("bias", [2.0, 4.0])
def test_the_slopes_of_3_A_do_not_judge_another_bias(bias: float) -> None:
    """A sound machine has 49 or 98 N/A there."""
    limits = load_spec("tsbs12", "amb-calibration", folders=(INSTALLED,))
    found, (note,) = applied(limits, load_procedure("amb-calibration").plan(bias_A=bias))
    assert found == {}
    assert note.text == f"no verdict on K_i, K_o: the limit was stated for bias_A = 3, here it is {bias:g}"


def test_limits_are_kept_with_a_run_as_they_are() -> None:
    """A recording holds them as JSON; the analysis of a stored run judges by these."""
    at = 'bias_A = 3, law = ["CAC"], speeds_rpm = { low = 2000 }'
    limit = parse_spec(f"schema = 1\n[limits.p]\nq = {{ low = 3, at = {{ {at} }}, {ENTRY} }}")["p"]["q"]
    assert Limit(**json.loads(json.dumps(asdict(limit)))) == limit


def test_a_setting_that_the_plan_does_not_have_is_refused(tmp_path: Path) -> None:
    """A misspelt one would void the limit in silence."""
    (tmp_path / "r.toml").write_text(f"schema = 1\n[limits.p]\nq = {{ low = 3, at = {{ baist_A = 3 }}, {ENTRY} }}")
    with pytest.raises(ConfigError, match=r"limits\.p\.q\.at\.baist_A.*Did you mean bias_A"):
        load_spec("r", "p", P, (tmp_path,))


@pytest.mark.parametrize(
    ("at", "expected"),
    [
        ('bias_A = "3"', "a number"),
        ("bias_A = true", "a number"),
        ("repeat = 1", "true or false"),
        ('law = "CCC"', "one of CAC, CCS, PID"),
        ("law = { low = 1 }", "one of CAC, CCS, PID: it has no range"),
    ],
)
def test_a_setting_that_can_never_be_is_refused(tmp_path: Path, at: str, expected: str) -> None:
    with pytest.raises(ConfigError, match=rf"limits\.p\.q\.at\.\w+: found .*; expected {expected}"):
        load_spec("r", "p", P, (spec_of(tmp_path, f"q = {{ low = 3, at = {{ {at} }}, {ENTRY} }}"),))


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        (
            f"{{ low = 3, at = {{ bias_A = nan }}, {ENTRY} }}",
            "at.bias_A: found nan; expected finite numbers, words, true",
        ),
        (f"{{ nominal = 0, relative = 0.1, {ENTRY} }}", "expected low and high"),
    ],
)
def test_a_limit_that_cannot_be_met_is_told_of_once(entry: str, said: str) -> None:
    with pytest.raises(ConfigError) as told:
        parse_spec(f"schema = 1\n[limits.p]\nq = {entry}")
    assert said in str(told.value)
    assert len(told.value.problems) == 1


@pytest.mark.parametrize("entry", catalogue.PROCEDURES, ids=lambda e: e.name)
@pytest.mark.parametrize("rig", ["tsbs12", "amb5dof"])
def test_the_shipped_limits_suit_their_procedures(rig: str, entry: catalogue.Entry) -> None:
    procedure = load_procedure(entry.name)
    limits = load_spec(rig, entry.name, procedure, (INSTALLED,), rig=load_rig(rig))
    assert list(misnamed(rig, (INSTALLED,))) == []
    found, notes = applied(limits, procedure.plan.model_validate(load_rig(rig).plans.get(entry.name, {})))
    assert (set(found), notes) == (set(limits), ())  # by default they judge
