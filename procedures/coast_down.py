"""Coast-down: the shaft slows down from its highest speed, by its own drag or on a ramp; analysed as a run-up.

A procedure of its own, since its plan is another one: a coast has no stated deceleration, and takes the drive's torque away.
"""

from __future__ import annotations

from pydantic import Field

from bench.procedure import Procedure
from bench.recorder import Recorder
from bench.rig import Rig
from bench.roles import RigState
from procedures import assumed, probing, runup, turning, unbalance
from procedures.runup import Passing, ended, passed
from procedures.turning import put


class Plan(Passing):
    """Settings of the coast-down, SI."""

    deceleration_rad_s2: float = Field(0.0, ge=0)  # 0: the drive gives no torque, and the shaft coasts

    @property
    def rate_rad_s2(self) -> float:
        """Of the drive's ramp; 0 where there is none."""
        return self.deceleration_rad_s2


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Look at the shaft on its rings, lift it, nudge it, roll it slowly, run it up, and let it slow down."""
    if not turning.rolled(rig, plan, record):
        return
    put(rig, plan.parameters)
    if probing.turned(rig, record, plan.top_rad_s, plan.settle_s):
        passed(rig, plan, record, "down", plan.bottom_rad_s)
    ended(rig, plan)


METHOD = f"""\
The drive brings the shaft to its highest speed as fast as it can; then it gives no torque, or brakes at the plan's rate. What
the shaft shows on the way down is evaluated. On this way the response lags to the other side: a critical speed that the way up
shows too high, the way down shows too low, unless the lag is taken off.

{runup.METHOD}"""

procedure = Procedure(
    name="coast-down",
    title="Coast-down of the levitated shaft",
    measures=runup.MEASURES,
    state=RigState.READY,
    plan=Plan,
    acquire=acquire,
    analyse=runup.analyse,
    figures=runup.figures,
    requires=unbalance.REQUIRES,
    check=runup.check,
    settings=runup.settings,
    step_count=runup.step_count,
    needs=unbalance.needs,
    optional=runup.CRITICAL,
    assumes=assumed.PASSAGE,
    method=METHOD,
)
