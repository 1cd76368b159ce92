"""Coast-down: the shaft slows down from its highest speed, by its own drag or on a ramp; analysed as a run-up.

A procedure of its own, since its plan is another one: a coast has no stated deceleration, and takes the drive's torque away.
"""

from __future__ import annotations

from bench.procedure import Procedure, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording.recorder import Recorder
from procedures.amb_rotor import lift, pushes
from procedures.coast_down.plan import Plan
from procedures.coast_down.requires import requires
from procedures.run_up import procedure as run_up
from procedures.shared import assumptions
from procedures.synchronous import bearings
from procedures.synchronous.default_speeds import within_envelope


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Look at the shaft on its rings, lift it, nudge it, roll it slowly, run it up, and let it slow down."""
    if not run_up.begin(rig, plan, record):
        return
    if lift.bring_to_speed(rig, record, plan.top_rad_s, plan.settle_s):
        run_up.pass_speeds(rig, plan, record, "down", plan.bottom_rad_s)
    run_up.end(rig, plan)


procedure = Procedure(
    name="coast-down",
    places=("down",),
    title="Coast-down of the levitated shaft",
    measures=run_up.MEASURES,
    state=RigState.READY,
    plan=Plan,
    planned=lambda rig: within_envelope(rig, Plan, "top_rad_s", "running_rad_s", "speeds_rad_s"),
    acquire=acquire,
    evaluate=run_up.evaluate,
    measured=run_up.measured,
    figures=run_up.figures,
    requires=requires,
    check=run_up.check,
    settings=run_up.settings,
    step_count=run_up.step_count,
    steps_on=lambda rig, plan: run_up.step_count(plan) + pushes.count(rig),
    needs=lambda plan: bearings.needs(plan.bearings),
    optional=run_up.procedure.optional,
    untold=run_up.procedure.untold,
    assumes=assumptions.PASSAGE,
    method=f"{read_method(__file__)}\n{run_up.procedure.method}",
)
