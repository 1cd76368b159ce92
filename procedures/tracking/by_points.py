"""Following set points: what the rig does where its controller has no path of its own."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from bench.errors import DeviceFault
from bench.procedure.rig import Rig
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from procedures.amb_rotor import lift
from procedures.amb_rotor.conventions import conventions
from procedures.tracking.plan import Plan
from procedures.tracking.points import ORBIT_LOST, POINT

SHARES, UNKNOWN_M = (0.2, 0.3), 1e-4  # of the clearance; where none is told
GROW_S, GROW = 0.04, 50


def sizes(rig: RigFile, plan: Plan) -> tuple[float, float]:
    """Half axes of the ellipse, m: the plan's, or shares of the least clearance, to whole micrometres."""
    clear = conventions(rig).clearance
    usual = tuple(round(share * (clear if math.isfinite(clear) else UNKNOWN_M) * 1e6) * 1e-6 for share in SHARES)
    return plan.y_m or usual[0], plan.z_m or usual[1]


def follow(rig: Rig, plan: Plan, record: Recorder, labels: Mapping[str, Any], orbit: str) -> bool:
    """The ellipse grows from the middle, is gone through, shrinks again from where it ended; each set point is recorded with
    its time. False where the controller let the shaft go on it, which the analysis tells."""
    machine, (half_y, half_z) = conventions(rig.file), sizes(rig.file, plan)
    hold_ns = round(1e9 / plan.points_hz / plan.points)
    slew = machine.can.set_points.slew
    if slew:
        lift.write(rig, {slew: 0.0})
    for part in range(1, GROW + 1):
        lift.write(rig, machine.points({"y": 0.0, "z": half_z * part / GROW}))
        rig.clock.sleep(GROW_S)
    rig.clock.sleep(plan.settle_s)
    y, z = 0.0, half_z
    with record.step(orbit, **labels):
        begin = rig.clock.now_ns()
        try:
            for k, (y, z) in enumerate(_around(plan, half_y, half_z)):
                left = (begin + k * hold_ns - rig.clock.now_ns()) * 1e-9
                if left > 0:
                    rig.clock.sleep(left)
                record.event(POINT, y=y, z=z)
                lift.write(rig, machine.points({"y": y, "z": z}))
            rig.clock.sleep(hold_ns * 1e-9)
        except DeviceFault as fault:
            record.event(ORBIT_LOST, fault=str(fault))
            return False
    for part in range(GROW - 1, -1, -1):
        lift.write(rig, machine.points({"y": y * part / GROW, "z": z * part / GROW}))
        rig.clock.sleep(GROW_S)
    if slew:
        lift.write(rig, {slew: rig.file.parameters[slew].default})
    return True


def _around(plan: Plan, half_y: float, half_z: float) -> Iterator[tuple[float, float]]:
    """Set points, from the top of z: a revolution more than is asked for, and half of one."""
    for k in range(round((plan.revolutions + 1.5) * plan.points)):
        turn = 2 * math.pi * k / plan.points
        yield half_y * math.sin(turn), half_z * math.cos(turn)
