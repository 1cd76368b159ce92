"""Coast-down: the shaft slows down from its highest speed, by its own drag or on a ramp; analysed as a run-up.

A procedure of its own, since its plan is another one: a coast has no stated deceleration, and takes the drive's torque away.
"""

from __future__ import annotations

from pydantic import Field

from bench.procedure import Procedure, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording.recorder import Recorder
from procedures.amb_rotor import lift
from procedures.run_up import procedure as run_up
from procedures.run_up.procedure import Passing, ended, passed
from procedures.shared import assumptions
from procedures.synchronous import dwelling
from procedures.synchronous.dwelling import put
from procedures.unbalance import procedure as unbalance


class Plan(Passing):
    """Settings of the coast-down, SI."""

    deceleration_rad_s2: float = Field(0.0, ge=0)  # 0: the drive gives no torque, and the shaft coasts

    @property
    def rate_rad_s2(self) -> float:
        """Of the drive's ramp; 0 where there is none."""
        return self.deceleration_rad_s2


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Look at the shaft on its rings, lift it, nudge it, roll it slowly, run it up, and let it slow down."""
    if not dwelling.rolled(rig, plan, record):
        return
    put(rig, plan.parameters)
    if lift.turned(rig, record, plan.top_rad_s, plan.settle_s):
        passed(rig, plan, record, "down", plan.bottom_rad_s)
    ended(rig, plan)


procedure = Procedure(
    name="coast-down",
    title="Coast-down of the levitated shaft",
    measures=run_up.MEASURES,
    state=RigState.READY,
    plan=Plan,
    acquire=acquire,
    evaluate=run_up.evaluate,
    measured=run_up.measured,
    figures=run_up.figures,
    requires=unbalance.REQUIRES,
    check=run_up.check,
    settings=run_up.settings,
    step_count=run_up.step_count,
    needs=unbalance.needs,
    optional=run_up.CRITICAL,
    assumes=assumptions.PASSAGE,
    method=f"{read_method(__file__)}\n{run_up.procedure.method}",
)
