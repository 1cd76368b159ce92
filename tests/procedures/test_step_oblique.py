"""Oblique axes are told by what a case is of, whatever a setting is called."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from procedures.step import checks
from procedures.step.plan import Plan
from procedures.step.steps import Case

SOUND = SimpleNamespace(settled=SimpleNamespace(open=False, time=0.1, within=0.01), error=0.0)


@pytest.mark.parametrize("setting", ["A", "soft, x, slow"])
@pytest.mark.parametrize(("axis", "told"), [("y", ["axes-oblique"]), ("z", ["axes-oblique"]), ("x", [])])
def test_the_axis_is_the_case_s_own(setting: str, axis: str, told: list[str]) -> None:
    case = Case(setting, 0.0, axis, 1e-5, 1)
    group: Any = {case.group: {"damping": None}}
    found = checks.of_results({case: cast(Any, SOUND)}, group, Plan(), leaning=True)
    assert [f.code for f in found] == told
