"""Which loops, places and lines a plan asks for, and how large the sines are."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_loops import InjectedLoop
from procedures.actuator_constant.plan import Plan
from procedures.position_loops.injection import USUAL_HZ, Sine, ability, integrator_s, told, whole
from procedures.position_loops.motors import around
from procedures.shared.rates import rate_of


@dataclass(frozen=True)
class Place:
    """Where a loop is looked at: `value` m or rad of the set point `parameter`; what it is called."""

    name: str
    parameter: str
    value: float


def loops(rig: RigFile, plan: Plan) -> tuple[str, ...]:
    """Those that the plan wants, of all that are known."""
    known = dict.fromkeys(one.loop for one in rig.capabilities.force_currents.values())
    return tuple(x for x in known if plan.loops == "all" or around(rig, x) == (plan.loops == "around"))


def places(rig: RigFile, plan: Plan, loop: str) -> tuple[Place, ...]:
    """Where it is looked at: none where the controller does not move it."""
    motion, channel = rig.capabilities.motion, ability(rig).loops[loop].channel
    if motion is None or channel not in (motion.place_channel, motion.angle_channel):
        return ()
    if channel == motion.angle_channel:
        return tuple(Place(f"{math.degrees(x):.4g}°", motion.angle, x) for x in plan.angles_rad)
    return tuple(Place(f"{x * 1e3:.4g} mm", motion.place, x) for x in plan.places_m)


def with_the_ring(rig: RigFile, plan: Plan) -> tuple[str, ...]:
    """Loops that are looked at again with the ring on."""
    return tuple(loop for loop in loops(rig, plan) if around(rig, loop)) if plan.added_inertia else ()


def rate(rig: RigFile, plan: Plan) -> float:
    """Of captures, Hz."""
    return rate_of(rig, plan.rate_hz, USUAL_HZ)


def slow_s(rig: RigFile, plan: Plan, loop: str) -> float:
    """Time constant of a loop's integrator, s."""
    return integrator_s(rig, plan.parameters, ability(rig).loops[loop])


def start_s(rig: RigFile, plan: Plan, loop: str) -> float:
    """How long a sine goes on before it is captured, s."""
    return max(plan.start_s, plan.time_constants * slow_s(rig, plan, loop))


def frequencies(rig: RigFile, plan: Plan, loop: str) -> list[float]:
    """The lines of each place, Hz: up to where a share of the limit makes too few counts."""
    one, top = ability(rig).loops[loop], plan.high_hz
    assert rig.capture is not None
    limit, kp, kd = (told(rig, plan.parameters, name) for name in (one.limit, one.kp, one.kd))
    if limit and kp and kd:
        most = (
            plan.share * limit / (plan.least_counts * rig.capture.channels[one.channel].scale)
        )  # N/m that it may take
        top = min(top, math.sqrt(max(most**2 - kp**2, 0.0)) / (2 * math.pi * kd))
    return [float(f) for f in np.geomspace(plan.low_hz, max(top, 2 * plan.low_hz), plan.lines)]


def sine(rig: RigFile, plan: Plan, loop: str, hz: float) -> Sine:
    """A line near `hz` that has whole periods in whole samples."""
    exact, periods, samples = whole(rate(rig, plan), hz, plan.record_s, plan.periods)
    return Sine(exact, amplitude(rig, plan, ability(rig).loops[loop], loop, exact), periods, samples)


def amplitude(rig: RigFile, plan: Plan, one: InjectedLoop, loop: str, hz: float) -> float:
    """Of a sine into a reference and its rate, m or rad, of which the loop asks for |k_P + s k_D| of itself."""
    if loop in plan.amplitude:
        return plan.amplitude[loop]
    assert rig.capture is not None
    most = plan.counts * rig.capture.channels[one.channel].scale
    limit, kp, kd = (told(rig, plan.parameters, name) for name in (one.limit, one.kp, one.kd))
    if not limit or not kp or not kd:
        return most
    return min(most, plan.share * limit / math.hypot(kp, kd * 2 * math.pi * hz))
