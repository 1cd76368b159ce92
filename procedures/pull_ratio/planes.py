"""Planes in which magnets pull a shaft and a vector of current holds it, by the rig file; where to go in them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from bench.errors import Lacking
from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_coils import CoilSystem
from bench.rigfile.capabilities_of_loops import InjectedLoop
from bench.rigfile.places import PlaceError, Places
from procedures.position_loops.injection import integrator_s
from procedures.pull_ratio.plan import Plan
from procedures.shared.rates import rate_of

RADIAL = "radial force"
USUAL_HZ = 35e3
BOTH = "both"


@dataclass(frozen=True)
class Plane:
    """`name` of the motor, or of its current system; the system; names of the loops along d and along q."""

    name: str
    system: CoilSystem
    loops: tuple[str, str]


def systems(rig: RigFile) -> Mapping[str, CoilSystem]:
    """Current systems that give a radial force."""
    found = rig.capabilities.coil_map
    return {} if found is None else {name: s for name, s in found.systems.items() if s.gives == RADIAL}


def loop_of(rig: RigFile, channel: str) -> str:
    """Name of the position loop that a channel shows; "": none that has a set point."""
    can = rig.capabilities.loop_injection
    loops = {} if can is None else can.loops
    return next((name for name, one in loops.items() if one.channel == channel and one.set_point), "")


def loop(rig: RigFile, name: str) -> InjectedLoop:
    """By its name.

    Raises:
        Lacking: the rig file tells of no loops.
    """
    if rig.capabilities.loop_injection is None:
        raise Lacking("capabilities.loop_injection: found none")
    return rig.capabilities.loop_injection.loops[name]


def planes(rig: RigFile) -> tuple[Plane, ...]:
    """In the order of the rig file."""
    motors = {frozenset(m.currents): name for name, m in rig.motors.items()}
    return tuple(
        Plane(motors.get(frozenset(s.coils), name), s, (loop_of(rig, s.axes[0]), loop_of(rig, s.axes[1])))
        for name, s in systems(rig).items()
    )


def axes(rig: RigFile) -> dict[str, tuple[str, ...]]:
    """By the name of an axis its loops, in the order of the planes; a hold's own name for it, if it has one."""
    hold = rig.capabilities.hold
    held: dict[tuple[str, ...], str] = {}
    if hold is not None:
        held = {axis.positions: name for name, axis in hold.axes.items()}
    out = {}
    for k in (0, 1):
        loops = tuple(p.loops[k] for p in planes(rig))
        channels = tuple(p.system.axes[k] for p in planes(rig))
        out[held.get(channels, "/".join(loops))] = loops
    return out


def positions(rig: RigFile) -> tuple[str, ...]:
    """Channels of the readings: of each plane its two axes."""
    return tuple(c for p in planes(rig) for c in p.system.axes)


def currents(rig: RigFile) -> tuple[str, ...]:
    """Channels of the currents: of each plane d and q."""
    return tuple(c for p in planes(rig) for c in (p.system.read_d, p.system.read_q))


def angles(rig: RigFile) -> tuple[str, ...]:
    """Channels by which the phases of the currents go."""
    return tuple(dict.fromkeys(p.system.angle for p in planes(rig)))


def captured(rig: RigFile) -> tuple[str, ...]:
    """What is captured at each level."""
    return (*positions(rig), *currents(rig), *angles(rig))


def rate(rig: RigFile, plan: Plan) -> float:
    """Of captures, Hz."""
    return rate_of(rig, plan.rate_hz, USUAL_HZ)


def settle_s(rig: RigFile, plan: Plan) -> float:
    """After each step, s."""
    slow = max(integrator_s(rig, {}, loop(rig, name)) for p in planes(rig) for name in p.loops)
    return max(plan.settle_s, plan.time_constants * slow)


def place(rig: RigFile, plan: Plan) -> float | None:
    """Set point along the shaft; None: there is none, or it stays."""
    hold = rig.capabilities.hold
    middle = None if hold is None else hold.middle
    if rig.capabilities.motion is None:
        return None
    return plan.place_m if plan.place_m is not None else None if middle is None else middle.value


def upwards(rig: RigFile, channel: str) -> float:
    """Cosine of the angle between what a probe counts and up; 0 where the rig file tells no direction."""
    probe = next(((name, p) for name, p in rig.probes.items() if p.channel == channel), None)
    if probe is None:
        return 0.0
    try:
        return probe[1].sign * math.cos(Places(rig).direction(f"probes/{probe[0]}").value)
    except PlaceError:
        return 0.0


def needed_N(rig: RigFile, name: str, away_m: float) -> tuple[float, float]:
    """What a loop has to give so far from its probe's zero, by the rig file's numbers, and the most that it gives, N: 0 and
    infinity where these are not told."""
    one, known = loop(rig, name), Places(rig).known
    if one.limit not in rig.parameters or one.stiffness not in known or one.inertia not in known:
        return 0.0, math.inf
    sensor = rig.sensors.get(one.channel)
    off = 0.0 if sensor is None else abs(sensor.offset.value) + math.sqrt(3) * sensor.offset.standard_uncertainty
    weight = known[one.inertia].value * one.share * rig.site.gravity.value * abs(upwards(rig, one.channel))
    return known[one.stiffness].value * (away_m + off) + weight, rig.parameters[one.limit].default


@dataclass(frozen=True)
class Level:
    """Where to go: `moved` is a loop, or both of an axis; `level_m` of these, all others at zero; `branch` +1 from below."""

    axis: str
    moved: str
    level_m: float
    branch: int


def order(rig: RigFile, plan: Plan) -> Iterator[Level]:
    """Up and down, so that a drift that is linear in time cancels; both planes together first."""
    for axis, loops in axes(rig).items():
        for moved in (BOTH, *loops):
            for k, level in enumerate((*plan.levels_m, *plan.levels_m[-2::-1])):
                yield Level(axis, moved, level, 1 if 0 < k < len(plan.levels_m) else -1)


def asked(rig: RigFile, one: Level) -> dict[str, float]:
    """Set points by parameter."""
    return {
        loop(rig, name).set_point: one.level_m if one.moved in (BOTH, name) else 0.0 for name in axes(rig)[one.axis]
    }
