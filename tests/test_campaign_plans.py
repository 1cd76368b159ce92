"""Plans in campaign files: the shipped campaigns fit their rigs; tables arrive as tables; the truth of a place goes first."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from bench import catalogue
from bench.campaign import Campaign, file
from bench.cli.campaign.job import _values
from bench.cli.campaign.steps import planned
from bench.errors import ConfigError
from bench.procedure import Measured, Quantity
from bench.rigfile import load_rig
from bench.uncertainty import Estimate

TABLES = """
schema = 1
name = "tables"
rig = "amb5dof"
[[step]]
procedure = "step"
plan = { axes = ["y"], sizes_um = [10, 20], a = { law = 2, "k1" = 2e5 } }
"""


@pytest.mark.parametrize("name", [entry.name for entry in catalogue.campaigns()])
def test_a_shipped_campaign_fits_its_rig(name: str) -> None:
    c, path = file.load(name)
    for short in (False, True):
        assert len(planned(c, str(path), load_rig(c.rig), short)) == len(c.step)


def test_a_friction_whose_width_is_judged_has_eight_degrees_of_freedom() -> None:
    """b and c of run-downs both ways, less their means and less the cosine and the sine that all share while the motor carries.
    With two of them T_c's interval was 1.2 to 1.3 times too wide."""
    c, path = file.load("tsbs-drag")
    step = next(s for s in planned(c, str(path), load_rig(c.rig), short=True) if s.procedure.name == "spindown")
    plan: Any = step.plan
    assert plan.motor_carries
    assert 2 * 2 * (plan.repeats - 1) - 2 >= 8


def test_tables_and_lists_of_a_plan_arrive() -> None:
    (step,) = planned(Campaign.parse(TABLES), "c.toml", load_rig("amb5dof"), short=False)
    plan: Any = step.plan
    assert plan.a == {"law": 2.0, "k1": 2e5}
    assert (plan.axes, plan.sizes_m) == (("y",), pytest.approx((1e-5, 2e-5)))


def test_a_date_is_no_setting() -> None:
    text = TABLES.replace("law = 2", "law = 2026-11-21")
    with pytest.raises(ConfigError, match="a number, a string, true, false, a list or a table"):
        planned(Campaign.parse(text), "c.toml", load_rig("amb5dof"), short=False)


def test_a_place_has_its_own_truth_before_that_of_the_machine() -> None:
    quantity = Quantity("mass", "kg", "of the shaft")
    measured = [Measured(quantity, Estimate.exact(1.0, "kg"), where) for where in ("", "here", "there")]
    truth: Mapping[str, float] = {"mass": 1.5, "mass@here": 2.5}
    assert [v["truth"] for v in _values(1, measured, truth, 0)] == [1.5, 2.5, 1.5]
