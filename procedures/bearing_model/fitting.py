"""What a plan of positions asks too much of the rig: said before anything moves."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from bench.rigfile import RigFile
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.laws import of_laws
from procedures.bearing_model.grid import find_room, most, places
from procedures.bearing_model.plan import Plan


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    yield from of_laws(conventions(rig), "law", [plan.law])
    machine, found = conventions(rig), places(rig, plan)
    if len(found) < 9:
        yield f"spacing_m, radius_m: found {len(found)} positions; expected nine or more"
    if plan.spacing_m and not plan.radius_m:
        yield "spacing_m: found one, and no radius_m; expected both, or none"
    room = find_room(rig)
    radius = plan.radius_m or most(rig)
    if radius > room:
        yield (
            f"radius_m: found {radius * 1e6:.1f} µm; the ring, the sensors' zeros and their runout leave {room * 1e6:.1f} µm"
        )
    for name, value in (*machine.point("y", radius).items(), *machine.point("z", radius).items()):
        if abs(value) > rig.parameters[name].high:
            yield f"radius_m: found {radius * 1e6:.1f} µm; {name} goes to {rig.parameters[name].high * 1e6:.0f} µm"
    arm = max(abs(p.arm.value) for p in machine.stations.probes.values())
    tilted = machine.point("psi", plan.tilt_rad)
    if any(abs(value) > rig.parameters[name].high for name, value in tilted.items()) or plan.tilt_rad * arm > room:
        yield f"tilt_rad: found {plan.tilt_rad * 1e6:.0f} µrad; reference and ring allow less"
    yield from _biases(rig, plan)


def _biases(rig: RigFile, plan: Plan) -> Iterator[str]:
    """Passes at biases that the controller does not take, or cannot change while the shaft floats."""
    machine = conventions(rig)
    if plan.biases_A and not machine.biases:
        yield "biases_A: the controller takes none (capabilities.bias); leave them out"
        return
    bound = machine.can.current_limit
    limit = rig.parameters[bound].default if bound else rig.envelope.max_current_A
    for name in machine.biases[:1]:
        allowed = rig.parameters[name]
        low, high = allowed.low, min(allowed.high, limit / 2)
        for bias in plan.biases_A:
            if not low <= bias <= high:
                yield (
                    f"biases_A: found {bias:g} A; parameter and amplifiers, which have to give twice that, leave {low:g} to "
                    f"{high:g} A"
                )
        if allowed.when == "resting" and len(plan.biases_A) > 1:
            yield f"biases_A: found {len(plan.biases_A)}; {name} can be written at rest only: expected one"
