"""What a rig and a plan must have before anything starts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from bench.rigfile import RigFile
from bench.rigfile.envelope import Envelope
from procedures.actuator_constant import ring
from procedures.actuator_constant.plan import Plan
from procedures.actuator_constant.sines import loops, places, rate, sine, with_the_ring
from procedures.position_loops.injection import BELOW, REFERENCE, ability, parameters_of
from procedures.position_loops.motors import motors
from procedures.shared import planned
from procedures.shared.rates import of_rate


def adds(rig: RigFile, plan: Plan, loop: str) -> bool:
    """Whether a current is added to one of two motors."""
    driving = list(motors(rig, loop).values())
    return plan.added_A > 0 and len(driving) == 2 and bool(driving[0].added)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    can, known = ability(rig), tuple(dict.fromkeys(one.loop for one in rig.capabilities.force_currents.values()))
    if unknown := [name for name in plan.amplitude if name not in known]:
        yield f"amplitude: found {', '.join(unknown)}; motors are known along {', '.join(known)}"
        return
    if not loops(rig, plan):
        yield f"loops: found {plan.loops!r}; motors are known along {', '.join(known)}"
        return
    yield from planned.of_observer(rig, plan.observer)
    if problems := list(planned.of_parameters(rig, plan.parameters)):
        yield from problems
        return
    if plan.high_hz > BELOW * rate(rig, plan) or plan.high_hz < 2 * plan.low_hz:
        yield f"high_hz: found {plan.high_hz:g}; expected {2 * plan.low_hz:g} to {BELOW * rate(rig, plan):g}"
    yield from of_rate(rig, plan.rate_hz)
    envelope = Envelope(rig)
    for loop in loops(rig, plan):
        one = sine(rig, plan, loop, plan.high_hz)
        yield from (
            f"{loop}: {problem}"
            for problem in envelope.problems_of(plan.parameters | parameters_of(can, REFERENCE, one))
        )
        for place in places(rig, plan, loop):
            yield from (
                f"{loop}, {place.name}: {problem}" for problem in envelope.problems_of({place.parameter: place.value})
            )
        if adds(rig, plan, loop):
            parameter = next(iter(motors(rig, loop).values())).added
            yield from (f"added_A: {problem}" for problem in envelope.problems_of({parameter: plan.added_A}))
    if plan.added_inertia:
        yield from _of_ring(rig, plan)


def _of_ring(rig: RigFile, plan: Plan) -> Iterator[str]:
    if not with_the_ring(rig, plan):
        yield f"added_inertia: found true with loops = {plan.loops!r}; expected a loop around, all or around"
    if missing := [name for name in (ring.RING, ring.RING_MASS) if name not in rig.machine]:
        yield f"added_inertia: found true; machine: found no {', '.join(missing)}"
    elif rig.machine[ring.RING_MASS].value > rig.envelope.max_hung_kg:
        kg = rig.machine[ring.RING_MASS].value
        yield f"added_inertia: found a ring of {kg:g} kg; expected {rig.envelope.max_hung_kg:g} kg at most (max_hung_kg)"
    if not any("operator" in device.roles for device in rig.devices.values()):
        yield "added_inertia: found true; devices: found none in the role operator, who mounts the ring"
