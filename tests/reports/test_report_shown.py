"""Results in the unit that their field reads: value, interval, limit and budget alike; the record stays as it is."""

from __future__ import annotations

import math
from typing import Any

import pytest

from reports.shown import in_unit

FOUND: dict[str, Any] = {
    "name": "major_half_axis", "unit": "m", "value": 16e-6, "standard_uncertainty": 1e-7, "expanded_uncertainty": 2e-7,
    "interval": [15.8e-6, 16.2e-6], "limit": {"low": None, "high": 30e-6, "source": "s"},
    "budget": [{"name": "gain", "contribution": 1e-7, "sensitivity": 16e-6}],
}  # fmt: skip


def test_all_of_a_result_is_in_the_unit_of_the_page() -> None:
    shown = in_unit(FOUND, {"major_half_axis": "um"})
    assert shown["unit"] == "um"
    assert [shown["value"], *shown["interval"], shown["limit"]["high"]] == pytest.approx([16, 15.8, 16.2, 30])
    assert shown["limit"]["low"] is None
    assert [shown["budget"][0][k] for k in ("contribution", "sensitivity")] == pytest.approx([0.1, 16])
    assert FOUND["unit"] == "m"
    assert in_unit({"name": "n", "unit": "rad/s", "value": math.pi}, {"n": "r/min"})["value"] == pytest.approx(30)


@pytest.mark.parametrize("units", [{}, {"major_half_axis": "r/min"}, {"major_half_axis": "furlong"}, {"other": "um"}])
def test_what_has_no_unit_of_the_page_stays_si(units: dict[str, str]) -> None:
    assert in_unit(FOUND, units) is FOUND
    missing = {"name": "major_half_axis", "unit": "m", "value": None, "interval": None, "limit": None}
    assert in_unit(missing, {"major_half_axis": "um"})["value"] is None
