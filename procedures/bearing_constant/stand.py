"""What the rig file says of the bearings' planes, of where masses hang and of what is recorded."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from bench.errors import Lacking
from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_coils import CoilSystem
from bench.rigfile.places import Places
from procedures.bearing_constant.plan import Plan
from procedures.position_loops.injection import USUAL_HZ, ability, integrator_s
from procedures.shared.rates import rate_of

RADIAL = "radial force"


@dataclass(frozen=True)
class Plane:
    """A motor that gives a radial force, `at` m along the shaft, and the `system` of its currents: q up, d across."""

    motor: str
    at: float
    system: CoilSystem

    @property
    def channels(self) -> tuple[str, str]:
        """Currents d and q of captures."""
        return self.system.read_d, self.system.read_q


def planes(rig: RigFile) -> tuple[Plane, ...]:
    """By place, the one nearest to the far end first.

    Raises:
        Lacking: coils of no motor.
    """
    can = rig.capabilities.coil_map
    found = [s for s in can.systems.values() if s.gives == RADIAL] if can is not None else []
    out = [Plane(_motor(rig, s), Places(rig).place(f"motors/{_motor(rig, s)}").value, s) for s in found]
    return tuple(sorted(out, key=lambda plane: -plane.at))


def _motor(rig: RigFile, system: CoilSystem) -> str:
    for name, motor in rig.motors.items():
        if set(system.coils) <= set(motor.currents) and motor.at is not None:
            return name
    raise Lacking(f"motors: found none with a place and the coils {', '.join(system.coils)}")


def hooks(rig: RigFile, plan: Plan) -> tuple[str, ...]:
    """Where masses hang, the far one first."""
    at = {name: Places(rig).place(f"hooks/{name}").value for name in plan.hooks or rig.hooks if name in rig.hooks}
    names = sorted(at, key=lambda name: -at[name])
    return tuple(names) if plan.hooks or len(names) < 2 else (names[0], names[-1])


def masses(rig: RigFile, plan: Plan) -> tuple[str, ...]:
    """The lighter and the heavier."""
    names = sorted(plan.masses or rig.masses, key=lambda name: rig.masses[name].value if name in rig.masses else 0.0)
    return tuple(names) if plan.masses or len(names) < 2 else (names[0], names[-1])


def visits(rig: RigFile, plan: Plan) -> list[tuple[str, str]]:
    """Hook and mass of each visit ("": nothing hangs), mirrored in time: what drifts evenly is in neither."""
    (far, *more), (light, *heavier) = hooks(rig, plan), masses(rig, plan)
    near, heavy = more[0] if more else far, heavier[-1] if heavier else light
    once = [(far, ""), (far, light), (near, heavy), (near, light), (far, heavy), (far, "")]
    other = [(far, ""), (far, heavy), (near, light), (near, heavy), (far, light), (far, "")]
    return [visit for k in range(plan.rounds) for visit in (other if k % 2 else once)]


def set_points(rig: RigFile, plan: Plan) -> Mapping[str, float]:
    """Where the mover is sent after each lift."""
    motion, hold = rig.capabilities.motion, rig.capabilities.hold
    assert motion is not None
    middle = hold.middle.value if hold is not None and hold.middle is not None else rig.parameters[motion.place].default
    return {motion.place: middle if plan.place_m is None else plan.place_m, motion.angle: plan.angle_rad}


def settle_s(rig: RigFile, plan: Plan) -> float:
    """Waited for after that."""
    loops = ability(rig).loops.values()
    return max(plan.settle_s, plan.time_constants * max(integrator_s(rig, {}, loop) for loop in loops))


def positions(rig: RigFile) -> tuple[str, ...]:
    """Radial readings of captures."""
    return tuple(axis for plane in planes(rig) for axis in plane.system.axes)


def captured(rig: RigFile) -> tuple[str, ...]:
    """Channels of a capture: both currents of each plane, and what its probes read."""
    return (*(c for plane in planes(rig) for c in plane.channels), *positions(rig))


def rate(rig: RigFile, plan: Plan) -> float:
    """Of captures, Hz."""
    return rate_of(rig, plan.rate_hz, USUAL_HZ)


def phase(rig: RigFile, plan: Plan, plane: Plane) -> float:
    """Of the field by the controller, rad electrical, where the mover is held."""
    zero = rig.parameters[plane.system.zero].default if plane.system.zero in rig.parameters else 0.0
    motion = rig.capabilities.motion
    assert motion is not None
    held = set_points(rig, plan)
    reading = held[motion.angle] if plane.system.angle == motion.angle_channel else held[motion.place]
    return math.remainder(plane.system.per * reading - zero, 2 * math.pi)
