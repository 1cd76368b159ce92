"""Sines into a position loop by the plan: how large, how long, at which frequencies."""

from __future__ import annotations

import math

from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_loops import InjectedLoop
from procedures.loop_response.plan import Plan
from procedures.position_loops import injection as shared
from procedures.position_loops.injection import BELOW as BELOW
from procedures.position_loops.injection import REFERENCE as REFERENCE
from procedures.position_loops.injection import SENSOR as SENSOR
from procedures.position_loops.injection import USUAL_HZ, Sine
from procedures.position_loops.injection import ability as ability
from procedures.position_loops.injection import injected as injected
from procedures.position_loops.injection import parameters_of as parameters_of
from procedures.shared.rates import rate_of

RAISED, DAMPED = (
    6.0,
    3.0,
)  # by which a loop may raise what is added to its reading, where its stiffness and its damping count


def chosen(rig: RigFile, plan: Plan) -> tuple[str, ...]:
    """The loops of the plan, or all."""
    return plan.axes or tuple(ability(rig).loops)


def sensitive(rig: RigFile, plan: Plan) -> tuple[str, ...]:
    """The loops of which the sensitivity is looked at, among the chosen."""
    if not ability(rig).wave or SENSOR not in ability(rig).places:
        return ()
    radial = {p.channel for p in rig.probes.values() if p.direction is not None}
    wanted = plan.sensitive if plan.sensitive is not None else chosen(rig, plan)
    return tuple(a for a in wanted if plan.sensitive is not None or ability(rig).loops[a].channel in radial)


def rate(rig: RigFile, plan: Plan) -> float:
    """Of captures, Hz."""
    return rate_of(rig, plan.rate_hz, USUAL_HZ)


def told(rig: RigFile, plan: Plan, parameter: str) -> float | None:
    """A parameter of the controller under the plan; None where the rig file does not tell which."""
    return shared.told(rig, plan.parameters, parameter)


def integrator_s(rig: RigFile, plan: Plan, loop: InjectedLoop) -> float:
    """How slow the integrator of a loop is: k_P/k_I, s."""
    return shared.integrator_s(rig, plan.parameters, loop)


def settle_s(rig: RigFile, plan: Plan, axis: str) -> float:
    """How long a sine goes on before it is looked at, s."""
    return max(plan.start_s, plan.time_constants * integrator_s(rig, plan, ability(rig).loops[axis]))


def amplitude(rig: RigFile, plan: Plan, axis: str, place: str, hz: float) -> float:
    """Of a sine, m or rad: what takes `share` of the loop's limit, by its gains, and so many counts at most. With its rate a
    reference asks for |k_P + k_I/s + s k_D| of itself, less what the loop has followed of it; added to the reading, of S
    times itself, S as much as RAISED where it is slow and DAMPED where it is fast."""
    if axis in plan.amplitude:
        return plan.amplitude[axis]
    loop = ability(rig).loops[axis]
    assert rig.capture is not None
    most = plan.counts * rig.capture.channels[loop.channel].scale
    limit, kp, kd = (told(rig, plan, name) for name in (loop.limit, loop.kp, loop.kd))
    if not limit or not kp or not kd:
        return most
    omega = 2 * math.pi * hz
    raised, damped = (RAISED, DAMPED) if place == SENSOR else (1.0, 1.0)
    gain = math.hypot(raised * kp, damped * kd * omega)
    return min(most, plan.share * limit / gain)


def sine(rig: RigFile, plan: Plan, axis: str, place: str, hz: float, least_s: float) -> Sine:
    """A line near `hz` that has whole periods in whole samples."""
    exact, periods, samples = shared.whole(rate(rig, plan), hz, least_s, plan.periods)
    return Sine(exact, amplitude(rig, plan, axis, place, exact), periods, samples)
