"""Whether a plan fits a rig."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from bench.rigfile import RigFile
from bench.units import RPM
from procedures.balance import decision, planes
from procedures.balance.plan import Plan
from procedures.synchronous import fitting

MOST_RPM = 10000.0  # influence runs
SAME_PLACE_RAD = math.radians(0.1)


def of_plan(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work, before anything starts."""
    if wrong := tuple(planes.of_plan(rig, plan.planes)):
        yield from wrong
        return
    rig = planes.chosen(rig, plan.planes)
    yield from fitting.of_speeds(rig, plan.speeds_rad_s)
    yield from fitting.of_slow_roll(rig, plan.slow_rad_s, plan.slow_s, plan.speeds_rad_s)
    yield from fitting.of_bearings(rig, plan.slow_rad_s, len(plan.speeds_rad_s))
    own_hz = 1 / rig.devices["controller"].tick_s  # of the captures; order 1 alone is read
    yield from fitting.of_captures(rig, plan.capture_s, own_hz, 1, plan.speeds_rad_s)
    if max(plan.speeds_rad_s) * RPM > MOST_RPM + 1:
        top = max(plan.speeds_rad_s) * RPM
        yield f"speeds_rad_s: found {top:.0f} r/min; influence runs are made at {MOST_RPM:.0f} r/min or below"
    if 0 < plan.positions < 3:
        yield f"positions: found {plan.positions}; expected 0 (any angle), or three or more"
    else:
        yield from _of_places(rig, plan)
    for side, kg, p in zip(planes.names_of(rig), plan.trial_kg, (0, 1), strict=True):
        allowed = decision.allowed_kg(rig, plan, p)
        if not 0 < kg <= allowed:
            yield (f"trial_kg: found {kg * 1e3:g} g {side}; allowed are up to {allowed * 1e3:.3g} g: by the envelope, "
                   f"and by the predicted response, which may reach {plan.max_share:.0%} of the least clearance")  # fmt: skip


def _of_places(rig: RigFile, plan: Plan) -> Iterator[str]:
    """Trial weights beside the planes' holes."""
    for plane, angle in zip(planes.planes_of(rig), plan.trial_angle_rad, strict=True):
        if holes := decision.holes_of(plane, plan):
            step = 2 * math.pi / holes
            if abs(math.remainder(angle, step)) > SAME_PLACE_RAD:
                yield (f"trial_angle_rad: found {math.degrees(angle):.4g}° {plane.name}; the {holes} positions are "
                       f"{math.degrees(step):.4g}° apart, the first at 0°")  # fmt: skip
