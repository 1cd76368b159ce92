"""What a plan of positions asks too much of the rig: said before anything moves."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from bench.rigfile import RigFile
from procedures.amb_rotor import rings
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.laws import of_laws
from procedures.bearing_model.grid import find_room, most, places, protected, reach
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
        yield (f"radius_m: found {radius * 1e6:.1f} µm; {_nearest(rig)} leave {room * 1e6:.1f} µm")
    for name, value in (*machine.point("y", radius).items(), *machine.point("z", radius).items()):
        if abs(value) > reach(rig, name):
            yield f"radius_m: found {radius * 1e6:.1f} µm; {name} goes to {reach(rig, name) * 1e6:.0f} µm"
    if plan.tilt_rad > (most_tilted := _tilted(rig)):
        yield (
            f"tilt_rad: found {plan.tilt_rad * 1e6:.0f} µrad; set points, {_nearest(rig)} leave {most_tilted * 1e6:.0f} µrad"
        )
    yield from _biases(rig, plan)


def _nearest(rig: RigFile) -> str:
    """What ends the room."""
    if protected(rig) < rings.room(rig):
        return "the limits of the probes (envelope, protect) and a margin"
    return "the ring, the sensors' zeros and their runout"


def _tilted(rig: RigFile) -> float:
    """The greatest tilt, rad, that set points, probes and rings leave."""
    machine = conventions(rig)
    s = machine.stations
    arms = [*(p.arm for p in s.probes.values()), *(ring.arm for ring in s.rings if ring.arm is not None)]
    arm = max(abs(a.value) for a in arms)
    points = {**machine.point("psi", 1.0), **machine.point("theta", 1.0)}
    return min([find_room(rig) / arm, *(reach(rig, name) / abs(v) for name, v in points.items() if v)])


def _biases(rig: RigFile, plan: Plan) -> Iterator[str]:
    """Passes at biases that the controller does not take, or cannot change while the shaft floats."""
    machine = conventions(rig)
    if plan.biases_A and not machine.biases:
        yield "biases_A: the controller takes none (capabilities.bias); leave them out"
        return
    bound = machine.can.current_limit
    limit = rig.parameters[bound].default if bound else rig.envelope.max_current_A
    for name in dict.fromkeys(machine.biases.values()):
        allowed = rig.parameters[name]
        low, high = allowed.low, min(allowed.high, limit / 2)
        for bias in plan.biases_A:
            if not low <= bias <= high:
                yield (
                    f"biases_A: found {bias:g} A; {name} and amplifiers, which have to give twice that, leave {low:g} to "
                    f"{high:g} A"
                )
        if allowed.when == "resting" and len(plan.biases_A) > 1:
            yield f"biases_A: found {len(plan.biases_A)}; {name} can be written at rest only: expected one"
