"""What the servomotor truly does under a plan."""

from __future__ import annotations

from collections.abc import Mapping

from sim_backend.machine import Truth
from sim_backend.machines.tsbs.balancing import circle
from sim_backend.machines.tsbs.quantities import drag_of
from sim_backend.machines.tsbs.truth_angle import angle_steps
from sim_backend.machines.tsbs.truth_speed import speeds
from sim_backend.motion import DragAsked, Motions


def drag(drawn: Truth, asked: DragAsked) -> Mapping[str, float]:
    """B at both biases and T_c; the bearings' part of B is that of those that have a bias."""

    def biases(bias: float) -> tuple[float, float]:
        return bias, 0.0 if asked.motor_carries else bias

    p = drawn.plant
    low, high = (drag_of(p, *biases(bias)) for bias in (asked.bias_A, asked.bias_high_A))
    return {"B": low, "B_high": high, "T_c": p.coulomb, "J_z": p.polar_inertia}


MOTIONS = Motions(circle=circle, drag=drag, speeds=speeds, angle=angle_steps)
