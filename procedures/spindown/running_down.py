"""One run-down: run up, hold, let go and wait."""

from __future__ import annotations

import math
from collections.abc import Mapping

from bench.procedure.rig import Rig
from bench.recording.recorder import Recorder
from bench.rigfile.roles import ANGLE
from procedures.spindown import checks
from procedures.spindown.plan import Plan
from procedures.spindown.running_up import let_go, run_up

LEAD_S = 0.1  # of a run-up by the motor's torque current, before it is let go
RAMP_S = 0.25  # what is left of the run-up's ramp when the speed is nearly there
SLOW = (0.1, 0.15, 0.2, 0.25, 0.3)  # shares of the speed that the drive also holds: they tell its constant torque


def run_down(rig: Rig, plan: Plan, record: Recorder, labels: Mapping[str, object], top: float) -> float:
    """Run up to `top`, hold it, let go and wait for the end speed. The speed it was let go from; 0 if that was not reached."""
    direction, by = 1 if labels["direction"] == 1 else -1, str(labels["by"])
    wanted = direction * top
    if by == "drive" and labels["group"] == "low" and labels["repeat"] == 0:
        _hold_slowly(rig, plan, record, labels, wanted)
    reached = run_up(rig, wanted, by)
    if not reached:
        record.event("not-reached", wanted=wanted, reached=rig.rotation.speed_rad_s, by=by)
        let_go(rig, by)
        rig.rotation.stop()
        return 0.0
    if reached != wanted:
        record.event(checks.LOWERED, wanted=wanted, held=reached, bias_A=labels["bias_A"])
    rig.clock.sleep(RAMP_S)
    with record.step("spin", speed_rad_s=reached, **labels):
        rig.clock.sleep(plan.steady_s)
    if plan.motor_carries:
        _wait_for(rig, direction, 2 * math.pi * int(str(labels["repeat"])) / plan.repeats)
    if by == "drive":
        let_go(rig, by)
    with record.step("coast", ring=labels["group"] == "ring", **labels):
        if by == "motor":  # a link's answers take as long as a short run-down: its currents say when it was let go
            rig.clock.sleep(LEAD_S)
            let_go(rig, by)
        begun = rig.clock.now_ns()
        rig.clock.sleep(plan.start_delay_s + 0.5)
        while direction * rig.rotation.speed_rad_s > plan.end_speed_rad_s:
            if rig.clock.now_ns() - begun > plan.coast_s * 1e9:
                break
            rig.clock.sleep(0.05)
    rig.rotation.stop()  # the speed reference that SPIN set is gone before the gains come back
    return abs(reached)


def _wait_for(rig: Rig, direction: int, place: float) -> None:
    """Until the turning rotor comes to a place, rad within a turn, as exactly as a link's answers allow: what goes round with
    it acts the other way where a run-down begins half a turn later, so that repeats spread over a turn are free of it."""
    ahead = direction * (place - rig.levitation.reading(ANGLE)) % (2 * math.pi)
    rig.clock.sleep(ahead / max(abs(rig.rotation.speed_rad_s), 1.0))


def _hold_slowly(rig: Rig, plan: Plan, record: Recorder, labels: Mapping[str, object], wanted: float) -> None:
    for share in SLOW:
        if reached := run_up(rig, share * wanted, "drive"):
            rig.clock.sleep(RAMP_S)
            with record.step("spin", speed_rad_s=reached, **labels):
                rig.clock.sleep(plan.steady_s)
