"""A quantity that was not measured has no degrees of freedom, nor infinitely many."""

from __future__ import annotations

from reports import text
from reports.resultrows import row


def test_what_is_missing_has_no_degrees_of_freedom() -> None:
    measured = {
        "name": "tilt",
        "unit": "rad",
        "value": 1e-6,
        "expanded_uncertainty": 1e-7,
        "dof": None,
        "verdict": "none",
    }
    assert row(measured, {}, {}).dof == text.degrees_of_freedom(None)
    assert row({"name": "tilt", "unit": "rad", "verdict": "missing"}, {}, {}).dof == text.DASH
