"""To a speed and let go again, by the external drive or by the motor; a drive at its torque limit is not held there."""

from __future__ import annotations

import math

from bench.errors import NotReached
from bench.procedure.rig import Rig
from procedures.servomotor import hold

PATIENCE_S = 2.0  # at its limit without a gain of speed: a drive trips after some seconds
HELD = 0.97  # of the greatest speed: there the drag leaves a drive some torque to hold it with
ENOUGH = 0.8  # of the speed asked for: a run-down from there says as much


def run_up(rig: Rig, wanted: float, by: str) -> float:
    """The speed in rad/s that the shaft now has: `wanted`, or where the drive can do no more a little below its greatest
    one if that is near enough; 0 where it does not get there. The motor is released when the drive turns the shaft."""
    try:
        if by == "drive":
            return _by_drive(rig, wanted)
        hold.hold(rig)
        rig.rotation.spin(wanted)
    except NotReached:
        return 0.0
    return wanted


def _by_drive(rig: Rig, wanted: float) -> float:
    assert rig.drive is not None
    try:
        rig.drive.reach(wanted, PATIENCE_S)
    except NotReached:
        less = HELD * rig.drive.speed_rad_s
        if less * math.copysign(1, wanted) < ENOUGH * abs(wanted):
            raise
        rig.drive.reach(less, PATIENCE_S)
        return less
    return wanted


def let_go(rig: Rig, by: str) -> None:
    """Take away the torque of what turns the shaft."""
    if by == "drive":
        assert rig.drive is not None
        rig.drive.coast()
    else:
        hold.release(rig)
