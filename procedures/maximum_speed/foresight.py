"""What a plan is expected to come to before anything starts: reserve of the levitation, and speeds by the facts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from bench.calibration import Calibration
from bench.rigfile import RigFile
from bench.units import RPM
from procedures.maximum_speed.fit import FEWEST_TURNS, Expected, expected
from procedures.maximum_speed.plan import HALF, OP, WORDS, Plan
from procedures.maximum_speed.running import guard_of, limit_of, newtons_per_m
from procedures.servomotor import carrying
from procedures.servomotor.parameters import stated
from procedures.spindown.estimates import drive_drag

SIDEWAYS_A = 0.2  # of i_x, by runout and noise alone
RESERVE_A = 0.5  # of force current beside what carries: the law answers noise and runout by 0.3 A rms
NEAR = 0.97  # of the guard: nearer, and it takes torque away
SLOWEST_RAD_S = 5.0
UNSURE_A = 0.2  # of torque current, by noise and an i_y near enough: on drawn machines up to 0.13 A less than foreseen
UNSURE = 0.1  # of an i_y that weight and stiffness tell: on drawn machines up to 0.43 of 4 A off
SLOWER = 0.5  # of the expected speed, and no slower is provided for
STEP_S = 0.1  # of the times that are asked for


def carrying_A(rig: RigFile, plan: Plan) -> float:
    """i_y that carries the shaft at the set point, A: as asked for, or by the weight and the rig file's stiffness."""
    if plan.carried_A:
        return plan.carried_A
    load = carrying.gravity_share_N(rig) - newtons_per_m(rig) * plan.set_point_m
    return abs(load) / carrying.newtons_per_A(rig)


def reserve(rig: RigFile, plan: Plan) -> Iterator[str]:
    """What is wrong with limit and set point."""
    reach, limit, i_y = stated(rig, "motor.ref_along"), limit_of(rig, plan), carrying_A(rig, plan)
    if not reach.low <= plan.set_point_m <= reach.high:
        yield (f"set_point_m: found {plan.set_point_m * 1e6:g} µm; the controller takes {reach.low * 1e6:g} to "
               f"{reach.high * 1e6:g} µm")  # fmt: skip
    if limit - i_y < RESERVE_A:
        yield (f"limit_A: found {limit:g} A; the shaft takes {i_y:.2f} A of i_y, and levitation {RESERVE_A:g} A of reserve. "
               "Give a higher limit_A, or raise the set point (set_point_m, carried_A)")  # fmt: skip


def expected_of(rig: RigFile, plan: Plan, facts: Mapping[str, Calibration], more_A: float = 0.0) -> Expected:
    """Torque currents and speeds of both sharings, where the motor carries `more_A` more than is foreseen."""
    drag, torque = facts["spindown"], facts["torque-constant"].values
    low, high = (drag.settings[name] ** 2 for name in ("bias_A", "bias_high_A"))
    b, b_high = drag.values["B"].value, drag.values["B_high"].value
    per_A = torque["alpha_tau"].value * math.cos(rig.machine["pole_pairs"].value * torque["gamma_0t"].value)
    constant = drag.values["T_c"].value + drive_drag(rig).value
    at = b + (b_high - b) * (plan.bias_A**2 - low) / (high - low)
    return expected(limit_of(rig, plan), carrying_A(rig, plan) + more_A, per_A, at, constant, SIDEWAYS_A)


def of_facts(rig: RigFile, plan: Plan, facts: Mapping[str, Calibration]) -> Iterator[str]:
    """Speeds that cannot be, else windows that are too short for them."""
    yield from list(_speeds(rig, plan, facts)) or _windows(rig, plan, facts)


def slow_rad_s(rig: RigFile, plan: Plan, facts: Mapping[str, Calibration]) -> float:
    """The lower speed where the motor carries more than is foreseen: what windows have to be long enough for."""
    more = UNSURE_A + (0.0 if plan.carried_A else UNSURE * carrying_A(rig, plan))
    foreseen, least = (expected_of(rig, plan, facts, m).speed[HALF] for m in (0.0, more))
    return max(least, SLOWER * foreseen)


def _windows(rig: RigFile, plan: Plan, facts: Mapping[str, Calibration]) -> Iterator[str]:
    """Times in which the rotor does not turn as often as the analysis needs."""
    slow, foreseen = slow_rad_s(rig, plan, facts), expected_of(rig, plan, facts).speed[HALF]
    for key, seconds, turns in (("average_s", plan.average_s, FEWEST_TURNS), ("capture_s", plan.capture_s, 1)):
        if seconds * slow < turns * math.tau:
            least = math.ceil(turns * math.tau / slow / STEP_S) * STEP_S
            yield (
                f"{key}: {seconds:g} s are {seconds * slow / math.tau:.1f} turns at {slow:.1f} rad/s, as slow as the rotor may "
                f"turn with {WORDS[HALF]} ({foreseen:.1f} rad/s are expected); it takes {turns}. Give {key}={least:.1f} or more"
            )


def _speeds(rig: RigFile, plan: Plan, facts: Mapping[str, Calibration]) -> Iterator[str]:
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
            f"limit_A: {limit_of(rig, plan):g} A leave {found.torque[HALF]:.2f} A of torque current with {WORDS[HALF]}, by "
            f"which the rotor turns at {found.speed[HALF]:.1f} rad/s; expected {SLOWEST_RAD_S:g} rad/s or more"
        )
