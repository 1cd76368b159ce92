"""Sines into a position loop: how large, how long, at which frequencies; and the writes that make one."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from bench.errors import BenchError, Lacking
from bench.procedure.rig import Rig
from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_loops import InjectedLoop, LoopInjection
from procedures.loop_response.plan import Plan
from procedures.shared.rates import rate_of

USUAL_HZ = 35e3
SENSOR, REFERENCE = "sensor", "reference"
RAISED, DAMPED = (
    6.0,
    3.0,
)  # by which a loop may raise what is added to its reading, where its stiffness and its damping count
BELOW = 0.3  # of the rate of captures, that a line may have
UNKNOWN_S = 0.1  # of an integrator that the rig file does not tell


@dataclass(frozen=True)
class Sine:
    """So many whole `periods` in so many `samples`; `amplitude` 0-pk, m or rad."""

    hz: float
    amplitude: float
    periods: int
    samples: int


def ability(rig: RigFile) -> LoopInjection:
    """What the controller injects.

    Raises:
        Lacking: it does not.
    """
    can = rig.capabilities.loop_injection
    if can is None:
        raise Lacking("capabilities.loop_injection: found none")
    return can


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
    if parameter not in rig.parameters:
        return None
    return plan.parameters.get(parameter, rig.parameters[parameter].default)


def integrator_s(rig: RigFile, plan: Plan, loop: InjectedLoop) -> float:
    """How slow the integrator of a loop is: k_P/k_I, s."""
    kp, ki = told(rig, plan, loop.kp), told(rig, plan, loop.ki)
    return kp / ki if kp and ki else 0.0 if kp else UNKNOWN_S


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
    sampled = rate(rig, plan)
    periods = max(plan.periods, math.ceil(least_s * hz))
    samples = round(periods * sampled / hz)
    exact = periods * sampled / samples
    return Sine(exact, amplitude(rig, plan, axis, place, exact), periods, samples)


def parameters_of(can: LoopInjection, place: str, one: Sine) -> dict[str, float]:
    """The controller's parameters that make it, but the one that begins."""
    return {can.place: can.places[place], can.amplitude: one.amplitude, can.hz: one.hz}  # type: ignore[index]


@contextmanager
def injected(rig: Rig, axis: str, place: str, one: Sine, start_s: float) -> Iterator[None]:
    """With a sine in a loop, settled; off again in the end, whatever happens."""
    can, write = ability(rig.file), rig.levitation.write
    write(parameters_of(can, place, one))
    try:
        write({can.axis: can.loops[axis].value})
        rig.clock.sleep(start_s)
        yield
    except BaseException:
        with suppress(BenchError):
            write({can.axis: can.off})
        raise
    write({can.axis: can.off})
