"""Which motors are looked at, how the mover is sent for them, what is captured meanwhile."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_coils import CoilMap, CoilSystem
from bench.rigfile.capabilities_of_loops import Motion
from procedures.emf_constant.plan import Plan
from procedures.position_loops.injection import USUAL_HZ
from procedures.shared.rates import rate_of

MARGIN_S = 0.03  # of a capture before its move: a command takes a while
FASTER = 4  # than the loops


@dataclass(frozen=True)
class Winding:
    """A motor's coils. `channel` reads what its phase goes with, `per` rad a metre or radian; `phases` rad by coil; `voltages`
    the channel of each coil's voltage; `others` phases by coil of each other current system in the same coils; `stars` of coils
    whose common voltage nobody knows."""

    motor: str
    channel: str
    per: float
    phases: Mapping[str, float]
    voltages: Mapping[str, str]
    others: tuple[Mapping[str, float], ...]
    stars: tuple[tuple[str, ...], ...]

    @property
    def coils(self) -> tuple[str, ...]:
        """By the channels of their currents."""
        return tuple(self.phases)


@dataclass(frozen=True)
class Line:
    """Moves along or around for one `motor`: set point, ends, parameters of how fast, rate and rise."""

    motor: str
    parameter: str
    ends: tuple[float, float]
    rates: Mapping[str, float]
    rate: float
    rise: float

    @property
    def seconds(self) -> float:
        """Of a move: it rises, goes on, falls; or never reaches its rate."""
        way = abs(self.ends[1] - self.ends[0])
        if way < self.rate**2 / self.rise:
            return 2 * math.sqrt(way / self.rise)
        return way / self.rate + self.rate / self.rise


def _system(can: CoilMap, current: str) -> CoilSystem | None:
    return next((s for s in can.systems.values() if s.read_q == current), None)


def windings(rig: RigFile) -> dict[str, Winding]:
    """By motor, those whose currents the winding's table tells, with a voltage of each coil."""
    can, out = rig.capabilities.coil_map, {}
    for motor, one in rig.capabilities.force_currents.items():
        system = None if can is None else _system(can, one.current)
        step = rig.capabilities.current_steps.get(one.along)
        if can is None or system is None or step is None or len(step.voltages) != len(step.currents):
            continue
        of_bridge = dict(zip(step.currents, step.voltages, strict=True))
        voltages = {c: of_bridge.get(can.bridges.get(c, ""), "") for c in system.coils}
        if not all(voltages.values()):
            continue
        phases = {c: math.radians(p) for c, p in system.coils.items()}
        others = tuple(
            {c: math.radians(p) for c, p in s.coils.items()}
            for s in can.systems.values()
            if s is not system and set(s.coils) == set(phases)
        )
        stars = tuple(s for s in can.stars if set(s) <= set(phases))
        out[motor] = Winding(motor, system.angle, system.per, phases, voltages, others, stars)
    return out


def chosen(rig: RigFile, plan: Plan) -> dict[str, Winding]:
    """The plan's motors."""
    return {name: w for name, w in windings(rig).items() if not plan.motors or name in plan.motors}


def lines(rig: RigFile, plan: Plan) -> tuple[Line, ...]:
    """Moves of the plan's motors, one motor after the other: captures at a high rate take few channels."""
    at = rig.capabilities.motion
    return () if at is None else tuple(_lines(at, chosen(rig, plan), plan))


def _lines(at: Motion, of: Mapping[str, Winding], plan: Plan) -> Iterator[Line]:
    along = {at.place_rate: plan.place_rate_m_s, at.place_rise: plan.place_rise_m_s2}
    around = {at.angle_rate: plan.angle_rate_rad_s, at.angle_rise: plan.angle_rise_rad_s2}
    for motor, winding in of.items():
        if winding.channel == at.place_channel:
            rates = {name: value for name, value in along.items() if name}
            yield Line(motor, at.place, plan.places_m, rates, plan.place_rate_m_s, plan.place_rise_m_s2)
        elif winding.channel == at.angle_channel:
            rates = {name: value for name, value in around.items() if name}
            yield Line(motor, at.angle, plan.angles_rad, rates, plan.angle_rate_rad_s, plan.angle_rise_rad_s2)


def captured(rig: RigFile, motor: str) -> tuple[str, ...]:
    """Channels of a capture of a motor's moves."""
    one = windings(rig)[motor]
    return (one.channel, *one.coils, *one.voltages.values())


def loops_hz(rig: RigFile) -> float:
    """At which places are read."""
    return rate_of(rig, None, USUAL_HZ)


def rate(rig: RigFile, plan: Plan) -> float:
    """Of captures, Hz. At the rate of the loops each voltage would be read at one instant between two answers of the loops to
    their readings, and that is not their mean."""
    return rate_of(rig, plan.rate_hz, FASTER * loops_hz(rig))


def held(rig: RigFile, plan: Plan) -> int:
    """For how many samples a reading of a place stands."""
    return max(1, round(rate(rig, plan) / loops_hz(rig)))


def seconds(line: Line, plan: Plan) -> float:
    """Of a capture."""
    return MARGIN_S + line.seconds + plan.rest_s
