"""Axes that share oscillations are told case by case, whatever a setting is called, and why."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from procedures.step import checks
from procedures.step.plan import Plan
from procedures.step.steps import Case

SETTLED = SimpleNamespace(open=False, time=0.1, within=0.01)


@pytest.mark.parametrize("setting", ["A", "soft, x, slow"])
@pytest.mark.parametrize(
    ("shared", "leaning", "told"),
    [(True, True, ["axes-oblique"]), (True, False, ["gyroscopic"]), (False, True, []), (False, False, [])],
)
def test_what_axes_share_is_the_case_s_own(setting: str, shared: bool, leaning: bool, told: list[str]) -> None:
    case, result = Case(setting, 0.0, "y", 1e-5, 1), SimpleNamespace(settled=SETTLED, error=0.0, shared=shared)
    group: Any = {case.group: {"damping": None}}
    found = checks.of_results({case: cast(Any, result)}, group, Plan(), leaning=leaning)
    assert [f.code for f in found] == told
