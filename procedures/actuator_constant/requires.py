"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from collections.abc import Iterator

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from procedures.actuator_constant.plan import Plan
from procedures.actuator_constant.sines import places
from procedures.position_loops.injection import REFERENCE, ability
from procedures.position_loops.motors import motors, periods_of


def requires(rig: RigFile) -> Requires:
    """By the names that the rig has."""
    can, driving = rig.capabilities.loop_injection, rig.capabilities.force_currents
    wanted = ("loop_injection", "force_currents", "motion")
    if can is None or not driving or rig.capabilities.motion is None:
        return Requires(capabilities=wanted, capture=())
    shown = tuple(dict.fromkeys(can.loops[one.loop].channel for one in driving.values()))
    currents = tuple(one.current for one in driving.values())
    coils = tuple(c for name in driving for c in rig.motors[name].currents)
    return Requires(
        channels=(*shown, *currents, STATE),
        sensors=coils,
        machine=periods_of(rig, "machine", driving),
        geometry=periods_of(rig, "geometry", driving),
        capabilities=wanted,
        capture=(*shown, *currents, *coils, *([can.wave] if can.wave else [])),
        lacks=tuple(_lacks(rig)),
    )


def _lacks(rig: RigFile) -> Iterator[str]:
    can = ability(rig)
    if REFERENCE not in can.places:
        yield "capabilities.loop_injection.places: found no reference"
    for loop in dict.fromkeys(one.loop for one in rig.capabilities.force_currents.values()):
        if not can.loops[loop].inertia:
            yield f"capabilities.loop_injection.loops.{loop}: found no inertia"
        if len(motors(rig, loop)) > 2:
            yield f"capabilities.force_currents: found {len(motors(rig, loop))} motors along {loop}; expected one or two"
        if not places(rig, Plan.model_validate({}), loop):
            yield f"capabilities.motion: {loop} is moved by none of its set points"
