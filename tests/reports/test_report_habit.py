"""What a report tells in the field's own units: the same numbers, the budget's included."""

from __future__ import annotations

import pytest

from bench import display_units
from reports import habit


def test_unbalance_is_told_in_g_mm_with_its_interval_limit_and_budget() -> None:
    record = {
        "name": "permissible", "unit": "kg m", "value": 0.7e-6, "standard_uncertainty": 5e-9, "expanded_uncertainty": 1e-8,
        "interval": [0.69e-6, 0.71e-6], "limit": {"low": None, "high": 1e-6, "unit": "kg m", "source": "s"},
        "budget": [{"name": "mass", "contribution": 4e-9, "sensitivity": 0.7e-6, "dof": None},
                   {"name": "lot", "contribution": 3e-9, "sensitivity": None}],
    }  # fmt: skip
    told = habit.told(record)
    assert told["unit"] == "g mm"
    assert told["name"] == "permissible"
    assert [told[n] for n in ("value", "standard_uncertainty", "expanded_uncertainty")] == pytest.approx(
        [0.7, 5e-3, 1e-2]
    )
    assert told["interval"] == pytest.approx([0.69, 0.71])
    assert told["limit"] == {"low": None, "high": pytest.approx(1.0), "unit": "g mm", "source": "s"}
    first, second = told["budget"]
    assert (first["contribution"], first["sensitivity"], first["dof"]) == (
        pytest.approx(4e-3),
        pytest.approx(0.7),
        None,
    )
    assert second["sensitivity"] is None
    assert record["unit"] == "kg m"  # the record itself is not touched


def test_motion_is_told_in_um_below_a_millimetre_small_lengths_in_mm_and_other_units_stay() -> None:
    assert display_units.of_result("m", 12e-6) == ("um", 1e-6)
    assert display_units.of_result("m", 8e-3) == ("mm", 1e-3)
    assert display_units.of_result("m", -0.097) == ("m", 1.0)
    assert display_units.of_result("m/(kg m)", 2.5) == ("um/(g mm)", 1.0)
    assert display_units.of_result("N/A", 23.0) == ("N/A", 1.0)
    same = {"name": "K", "unit": "N/A", "value": 23.0, "expanded_uncertainty": None}
    assert habit.told(same) is same
    missing = habit.told({"name": "d", "unit": "m", "value": None, "expanded_uncertainty": None})
    assert (missing["value"], missing["interval"]) == (None, [None, None])


def test_a_limit_has_no_digits_of_the_division_by_its_unit() -> None:
    """0.0175 rad, "one degree of commutation error", was told as 1.002 676 141 48°."""
    limit = {"low": -0.0175, "high": 0.0175, "unit": "rad"}
    assert habit.told({"name": "gamma_0", "unit": "rad", "value": 0.0026, "limit": limit})["limit"] == {
        "low": -1.0027, "high": 1.0027, "unit": "deg"}  # fmt: skip
