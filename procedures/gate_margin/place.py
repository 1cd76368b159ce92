"""What the rig file says of a gate and of what catches the shaft, and the places of a plan."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from bench.recording import Recording
from bench.rigfile import RigFile
from bench.rigfile.bit import Bit
from procedures.gate_margin.plan import Plan
from procedures.position_loops.movers import motion, radial
from procedures.shared.rates import rate_of

USUAL_HZ = 35e3
WINDOWS, TRIAL = "windows", "trial"
GATE, TIME = "gate_m", "gate_s"


@dataclass(frozen=True)
class Place:
    """Of the grid: along, m, around, rad, and what it is called."""

    place_m: float
    angle_rad: float

    @property
    def name(self) -> str:
        """As results have it."""
        return f"{self.place_m * 1e3:g} mm, {math.degrees(self.angle_rad):.4g}°"


@dataclass(frozen=True)
class Plane:
    """One bearing and axis: its probe and that one's channel, the current that pushes there and the stiffness it holds against,
    those of both planes of the axis, the share of the weight that the controller adds beside its limit, the axis' name."""

    probe: str
    channel: str
    current: str
    stiffness: str
    both: tuple[str, str]
    carried: float
    axis: str


def grid(plan: Plan) -> tuple[Place, ...]:
    """Every place with every angle; the angles to and fro, so that no way is long."""
    out = []
    for k, place in enumerate(plan.places_m):
        out += [Place(place, angle) for angle in plan.angles_rad[:: -1 if k % 2 else 1]]
    return tuple(out)


def planes(rig: RigFile) -> tuple[Plane, ...]:
    """Of every axis both planes; none where the rig file tells of no forces."""
    can = rig.capabilities.hold
    named = {channel: probe for probe, channel in radial(rig).items()}
    if can is None:
        return ()
    return tuple(
        Plane(named[channel], channel, current, stiffness, axis.stiffness, axis.carried, name)
        for name, axis in can.axes.items()
        for channel, current, stiffness in zip(axis.positions, axis.currents, axis.stiffness, strict=True)
        if channel in named
    )


def limits(rig: RigFile) -> tuple[Bit, ...]:
    """Bits that say that a bearing's force is at its limit."""
    can, wanted = rig.capabilities.loop_injection, radial(rig).values()
    loops = () if can is None else can.loops.values()
    return tuple(loop.limited for loop in loops if loop.channel in wanted and loop.limited is not None)


def captured(rig: RigFile) -> tuple[str, ...]:
    """Readings of all radial probes, and the bearings' currents where they are told."""
    return (*radial(rig).values(), *(p.current for p in planes(rig)))


def rate(rig: RigFile) -> float:
    """Of captures, Hz: that of the readings."""
    return rate_of(rig, None, USUAL_HZ)


def samples(gate_s: float, hz: float) -> int:
    """Of one window."""
    return max(round(gate_s * hz), 1)


def bound_of(recording: Recording[Any]) -> tuple[float, float]:
    """The gate, m, and its time, s, as the controller had them; what the rig file says where nothing was recorded."""
    rig = recording.rig
    labels: Mapping[str, Any] = next((s.labels for s in recording.steps(WINDOWS)), {})
    at = motion(rig)
    gate, seconds = rig.parameters[at.gate].default, rig.parameters[at.gate_time].default
    return float(labels.get(GATE, gate)), float(labels.get(TIME, seconds))
