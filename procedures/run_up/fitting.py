"""Whether a plan fits a rig."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from bench.analysis.peaks import WINDOW
from bench.rigfile import RigFile
from bench.units import RPM
from procedures.run_up.plan import Passing
from procedures.run_up.steps import LEAST_TURNS
from procedures.shared.limits import above_landing, landing_speed
from procedures.synchronous import fitting

RATES = (1.0, 250.0)  # rad/s^2
IN_A_TURN = 0.1  # of the speed: how far it may change within a turn, so that pulses can be told from missing ones
COASTING = 100.0  # rad/s^2: what a shaft that coasts slows down by at most
FEWEST_TURNS = (WINDOW + 1) * LEAST_TURNS  # the local models of the curve take so many blocks
UPLOAD_S = 1.2


def of_plan(rig: RigFile, plan: Passing) -> Iterable[str]:
    """What cannot work, before anything starts."""
    most = rig.envelope.max_speed_rad_s
    landing = landing_speed(rig)
    if plan.top_rad_s > most:
        yield f"top_rad_s: found {plan.top_rad_s * RPM:.0f} r/min; the envelope allows {most * RPM:.0f} r/min"
    if not 2 * landing < plan.bottom_rad_s < 0.5 * plan.top_rad_s:
        yield (f"bottom_rad_s: found {plan.bottom_rad_s * RPM:.0f} r/min; expected above "
               f"{above_landing(landing)}, and below half of {plan.top_rad_s * RPM:.0f} r/min")  # fmt: skip
    low, high = 1.05 * plan.bottom_rad_s, 0.98 * plan.top_rad_s
    if not all(low <= s <= high for s in plan.speeds_rad_s):
        yield f"speeds_rad_s: expected {low * RPM:.0f} to {high * RPM:.0f} r/min: the shaft must come through them"
    spaced = np.diff(sorted(plan.speeds_rad_s)) / (plan.rate_rad_s2 or COASTING)
    if spaced.size and spaced.min() < plan.capture_s + UPLOAD_S:
        yield (f"speeds_rad_s: two are passed within {spaced.min():.2f} s; expected {plan.capture_s + UPLOAD_S:.2f} s or more, "
               "in which a capture is recorded and uploaded")  # fmt: skip
    if plan.rate_rad_s2 and not RATES[0] <= plan.rate_rad_s2 <= RATES[1]:
        yield f"the acceleration: found {plan.rate_rad_s2:g} rad/s^2; expected {RATES[0]:g} to {RATES[1]:g}"
    steady = math.sqrt(2 * math.pi * plan.rate_rad_s2 / IN_A_TURN)
    if plan.bottom_rad_s < steady:
        yield (f"bottom_rad_s: found {plan.bottom_rad_s * RPM:.0f} r/min; at {plan.rate_rad_s2:g} rad/s^2 expected "
               f"{steady * RPM:.0f} r/min or more: below, the speed changes by over {IN_A_TURN:.0%} within a turn")  # fmt: skip
    turns = max(plan.top_rad_s**2 - plan.bottom_rad_s**2, 0.0) / (4 * math.pi)  # times the rate
    if turns < FEWEST_TURNS * plan.rate_rad_s2:
        yield (f"top_rad_s, bottom_rad_s: between them the shaft makes {turns / plan.rate_rad_s2:.0f} turns; expected "
               f"{FEWEST_TURNS} or more, {WINDOW} blocks of {LEAST_TURNS} and the ends: ramp more slowly")  # fmt: skip
    drives = [d for d in rig.devices.values() if "drive" in d.roles]
    if plan.rate_rad_s2 and not any("acceleration" in d.registers for d in drives):
        yield "devices: found a drive without a register acceleration; a ramp needs one"
    yield from fitting.of_speeds(rig, plan.speeds_rad_s)
    yield from fitting.of_bearings(rig, plan.slow_rad_s, len(plan.speeds_rad_s))
    yield from fitting.of_slow_roll(rig, plan.slow_rad_s, plan.slow_s, plan.speeds_rad_s)
    yield from fitting.of_captures(rig, plan.capture_s, plan.rate_hz, plan.orders, plan.speeds_rad_s)
