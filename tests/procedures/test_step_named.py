"""Settings of the steps by the names that a rig file gives sets of parameters."""

from __future__ import annotations

from bench.rigfile import load_rig
from procedures.step.named import list_settings
from procedures.step.plan import Plan
from procedures.step.procedure import check, step_count

AMB = load_rig("amb5dof")


def test_a_named_setting_is_its_parameters() -> None:
    """And what stands beside it in the plan; the later one counts."""
    plan = Plan(a={"law": "CCS", "k1": 1e5}, b={"law": 2, "poles": "observed", "k1": 3e5})
    assert list_settings(plan, AMB) == {
        "A": {"law": 1.0, "k1": 1e5},
        "B": {"law": 2.0, "k1": 3e5, "k2_ccs": 400.0, "k2_cac": 400.0},
    }
    assert list(check(AMB, plan)) == []
    assert step_count(plan) == 2 * step_count(Plan(a={"law": 1.0}))
    assert list_settings(Plan(), AMB) == {"A": {}}


def test_a_setting_that_the_rig_file_does_not_name_is_refused() -> None:
    found = list(check(AMB, Plan(a={"law": "soft"}, warm={"colour": "red"})))
    assert found == [
        "a: found law = 'soft'; expected one of PID, CCS, CAC",
        "warm: found colour = 'red'; expected a number: the rig file names no settings of that kind",
    ]
