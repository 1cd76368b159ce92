"""How the dwells of a turning shaft are made: at each speed with each setting of the controller, the lowest once more."""

from __future__ import annotations

from bench.procedure.rig import Rig
from bench.recording.recorder import Recorder
from procedures.amb_rotor import lift
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.lift import write
from procedures.amb_rotor.machine import Variant
from procedures.shared.rates import rate_of
from procedures.synchronous.dwelling import roll_slowly, step_labels
from procedures.synchronous.dwells import DWELL, can_capture, captured_channels
from procedures.unbalance.plan import Plan

MARGIN_S = 0.1  # of a dwell beside its capture


def begin(rig: Rig, plan: Plan, record: Recorder) -> bool:
    """Lift, nudge and slow roll; False where the run ends here."""
    return roll_slowly(rig, record, plan.law, plan.slow_rad_s, plan.slow_s, plan.settle_s)


def dwell(rig: Rig, plan: Plan, record: Recorder) -> bool:
    """All dwells, the slowest first; False if a speed is not reached."""
    machine, number = conventions(rig.file), 0
    for speed in sorted(plan.speeds_rad_s):
        write(rig, machine.variants[plan.variants[0]])
        if not lift.bring_to_speed(rig, record, speed, plan.settle_s):
            return False
        for variant in plan.at(speed):
            write(rig, machine.variants[variant])
            rig.clock.sleep(plan.settle_s)
            _dwell(rig, plan, record, speed, variant, number)
            number += 1
    return True


def repeat_lowest(rig: Rig, plan: Plan, record: Recorder) -> None:
    """The lowest speed once more, with the first setting."""
    speed = min(plan.speeds_rad_s)
    machine = conventions(rig.file)
    if plan.repeat and lift.bring_to_speed(rig, record, speed, plan.settle_s):
        write(rig, machine.variants[plan.variants[0]])
        rig.clock.sleep(plan.settle_s)
        _dwell(rig, plan, record, speed, plan.variants[0], -1)


def _dwell(rig: Rig, plan: Plan, record: Recorder, speed: float, variant: Variant, number: int) -> None:
    with record.step(DWELL, **step_labels(rig, speed, variant, number)):
        captures = rig.capture is not None and can_capture(rig.file)
        if rig.capture is not None and captures:
            names = captured_channels(conventions(rig.file))
            rig.capture.arm(names, seconds=plan.capture_s, rate_hz=rate_of(rig.file, plan.rate_hz))
            rig.capture.wait(plan.capture_s + 5.0)
        rig.clock.sleep(max(plan.dwell_s - plan.capture_s, MARGIN_S) if captures else plan.dwell_s)
    if rig.capture is not None and captures:
        rig.capture.upload(dwell=number, speed_rad_s=speed, variant=variant)
