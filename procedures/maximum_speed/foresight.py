"""What a plan is expected to come to before anything starts: reserve of the levitation, and speeds by the facts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from bench.calibration import Calibration
from bench.rigfile import RigFile
from bench.units import RPM
from procedures.maximum_speed.fit import Expected, expected
from procedures.maximum_speed.plan import HALF, OP, Plan
from procedures.maximum_speed.running import guard_of, limit_of, newtons_per_m
from procedures.servomotor import carrying
from procedures.servomotor.parameters import stated
from procedures.spindown.estimates import drive_drag

SIDEWAYS_A = 0.2  # of i_x, by runout and noise alone
RESERVE_A = 0.5  # of force current beside what carries: the law answers noise and runout by 0.3 A rms
NEAR = 0.97  # of the guard: nearer, and it takes torque away
SLOWEST_RAD_S = 5.0


def carrying_A(rig: RigFile, plan: Plan) -> float:
    """i_y that carries the shaft at the set point, A: as asked for, or by the weight and the rig file's stiffness."""
    if plan.carried_A:
        return plan.carried_A
    load = carrying.gravity_share_N(rig) - newtons_per_m(rig) * plan.set_point_m
    return abs(load) / carrying.ALPHA_D


def reserve(rig: RigFile, plan: Plan) -> Iterator[str]:
    """What is wrong with limit and set point."""
    reach, limit, i_y = stated(rig, "motor.ref_along"), limit_of(rig, plan), carrying_A(rig, plan)
    if not reach.low <= plan.set_point_m <= reach.high:
        yield (f"set_point_m: found {plan.set_point_m * 1e6:g} µm; the controller takes {reach.low * 1e6:g} to "
               f"{reach.high * 1e6:g} µm")  # fmt: skip
    if limit - i_y < RESERVE_A:
        yield (f"limit_A: found {limit:g} A; the shaft takes {i_y:.2f} A of i_y, and levitation {RESERVE_A:g} A of reserve. "
               "Give a higher limit_A, or raise the set point (set_point_m, carried_A)")  # fmt: skip


def expected_of(rig: RigFile, plan: Plan, facts: Mapping[str, Calibration]) -> Expected:
    """Torque currents and speeds of both sharings."""
    drag, torque = facts["spindown"], facts["torque-constant"].values
    low, high = (drag.settings[name] ** 2 for name in ("bias_A", "bias_high_A"))
    b, b_high = drag.values["B"].value, drag.values["B_high"].value
    per_A = torque["alpha_tau"].value * math.cos(rig.machine["pole_pairs"].value * torque["gamma_0t"].value)
    constant = drag.values["T_c"].value + drive_drag(rig).value
    at = b + (b_high - b) * (plan.bias_A**2 - low) / (high - low)
    return expected(limit_of(rig, plan), carrying_A(rig, plan), per_A, at, constant, SIDEWAYS_A)


def speeds(rig: RigFile, plan: Plan, facts: Mapping[str, Calibration]) -> Iterator[str]:
    """Speeds that would trip, or end at the guard, and one that hardly turns."""
    found, guard = expected_of(rig, plan, facts), guard_of(rig, plan)
    drag = facts["spindown"].values["B"]
    if found.speed[OP] > NEAR * guard:
        yield (
            f"limit_A: {limit_of(rig, plan):g} A leave {found.torque[OP]:.2f} A of torque current, which by the adopted "
            f"alpha_tau, B ({drag.value:.4f} N m s/rad at {facts['spindown'].settings['bias_A']:g} A) and T_c turn the rotor "
            f"at {found.speed[OP]:.0f} rad/s ({found.speed[OP] * RPM:.0f} r/min); the guard is {guard:g} rad/s, the envelope "
            f"{rig.envelope.max_speed_rad_s:g} rad/s. Give a lower limit_A, and raise the set point where that leaves no "
            "reserve"
        )
    if found.speed[HALF] < SLOWEST_RAD_S:
        yield (
            f"limit_A: {limit_of(rig, plan):g} A leave {found.torque[HALF]:.2f} A of torque current with lambda 1/2, by which "
            f"the rotor turns at {found.speed[HALF]:.1f} rad/s; expected {SLOWEST_RAD_S:g} rad/s or more"
        )
