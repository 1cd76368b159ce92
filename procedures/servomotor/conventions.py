"""What the servomotor's controller calls its signals, what the bits of its status mean, and where the shaft's planes lie.

Whatever looks at a recording or drives a rig gets them from `conventions(rig)` and names no signal by itself: channels are
those of the rig file.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.rigfile.places import Places
from bench.rigfile.roles import Status
from bench.rigfile.supports import Support, SupportedAxis, once_per_rig, two_planes
from procedures.shared.unsupported import of_weight, unlike

Array = npt.NDArray[np.float64]
Value = TypeVar("Value", float, Array)


@dataclass(frozen=True)
class Servomotor:
    """Signals by axis: "x" or, upwards, "y" with the bearing, inboard "i" or outboard "o". `coils` has of each axis the one
    that pulls towards the positive end first. `segments` are the motor's currents: four amplitudes in the order of T (6.9), or
    q and d of each half, where it has two segments (T 7), and `components` how many each segment has; `direction` rad is where
    its first one pushes. `asked`: what a capture calls the currents that the law asks for, "along", "across" and "torque", and
    the "share" of the torque that the segments along have.
    `sensors` and `ambs` are the inboard and the outboard lever from the centre of mass, by their names in the rig file's
    geometry. Then the flags by what they mean."""

    positions: Mapping[str, str]
    coils: Mapping[str, tuple[str, str]]
    segments: tuple[str, ...]
    components: int
    direction: float
    asked: Mapping[str, str]
    sensors: tuple[str, str]
    ambs: tuple[str, str]
    axes: Mapping[str, str]
    bearings: tuple[str, str]
    amb_limit: int
    segment_limit: int
    contact_inboard: int
    contact_outboard: int
    lacks: tuple[str, ...] = ()  # where the rig is not as these procedures take it

    @property
    def contact(self) -> int:
        """Contact at either end."""
        return self.contact_inboard | self.contact_outboard

    @property
    def turning(self) -> tuple[str, ...]:
        """The currents whose mean is the torque current: those along the field."""
        return self.segments[:: self.components]

    @property
    def vectors(self) -> tuple[tuple[str, ...], ...]:
        """The currents of each segment, q and d, or its amplitude alone."""
        n = self.components
        return tuple(self.segments[k : k + n] for k in range(0, len(self.segments), n))

    def pushed(self, x: Value, y: Value) -> tuple[Value, Value]:
        """A vector by its horizontal and its upward part as the motor has it: across and along its first segment (T 7.6, with
        the sign of (7.6b) put right)."""
        c, s = math.cos(self.direction), math.sin(self.direction)
        return x * c + y * s, y * c - x * s

    @property
    def levers(self) -> tuple[str, ...]:
        """Names of all levers, inboard ones first."""
        return tuple(name for pair in zip(self.sensors, self.ambs, strict=True) for name in pair)

    def positions_of(self, *axes: str) -> tuple[str, ...]:
        """Position signals of some axes, in that order."""
        return tuple(self.positions[axis] for axis in axes)

    def coils_of(self, *axes: str) -> tuple[str, ...]:
        """Coil currents of some axes, in that order."""
        return tuple(coil for axis in axes for coil in self.coils[axis])

    def coils_along(self, direction: str) -> dict[str, str]:
        """Coils of both AMBs along "x" or "y", by bearing and the end they pull to: "ip", "in", "op", "on"."""
        return {f"{b}{end}": coil for b in "io" for end, coil in zip("pn", self.coils[f"{direction}{b}"], strict=True)}

    def control(self, axis: str, at: Callable[[str], Value]) -> Value:
        """Control current of an axis in A, half the difference of its coils' currents, which `at` gives by name."""
        positive, negative = self.coils[axis]
        return (at(positive) - at(negative)) / 2

    def sensor_share(self, z: float, rig: RigFile) -> float:
        """`sensor_share` by the nominal lengths of the rig file."""
        l_is, l_os = (rig.geometry[name].value for name in self.sensors)
        return sensor_share(z, l_is, l_os)


ROLES = ("yi", "yo", "xi", "xo")
PHASE, LOADS = "gamma", ("load_x", "load_y")
"""What a capture of the controller calls the motor's phase angle, and the load on it as its observer has it, across and up."""


@once_per_rig
def conventions(rig: RigFile) -> Servomotor:
    """Those of a rig with two radial bearings: the one nearer to the near end is the inboard one.

    Raises:
        Lacking: the rig has other bearings, or one of them without what belongs to an axis.
    """
    planes = two_planes(rig)
    axes = dict(chain.from_iterable(_of(plane, end) for end, plane in zip("io", planes, strict=True)))
    frame = [(axes[f"y{end}"], axes[f"x{end}"]) for end in "io"]
    upright = replace(planes[0], axes=frame[0]), replace(planes[1], axes=frame[1])
    return Servomotor(
        positions={role: axes[role].position for role in ROLES},
        coils={role: (axes[role].coils[0], axes[role].coils[1]) for role in ROLES},
        **_motor(rig),
        sensors=("com_to_inboard_sensor", "com_to_outboard_sensor"),
        ambs=("com_to_inboard_amb", "com_to_outboard_amb"),
        axes={role: axes[role].name for role in ROLES},
        bearings=(planes[0].name, planes[1].name),
        amb_limit=Status.CURRENT_LIMIT,
        segment_limit=Status.SEGMENT_LIMIT,
        contact_inboard=Status.CONTACT_NEAR,
        contact_outboard=Status.CONTACT_FAR,
        lacks=(*unlike(rig, upright), *of_weight(rig, upright, (0.0, -math.pi / 2))),
    )


def _motor(rig: RigFile) -> dict[str, Any]:
    """The currents of the motor that pushes, what they are, and which way."""
    name = next((name for name, m in rig.motors.items() if "radial force" in m.gives), None)
    if name is None:
        return {"segments": (), "components": 1, "direction": 0.0, "asked": {}}
    motor, at = rig.motors[name], f"motors/{name}"
    direction = Places(rig).direction(at).value if motor.direction is not None else 0.0
    return {
        "segments": motor.currents,
        "components": len(motor.components),
        "direction": direction,
        "asked": motor.asked,
    }


def _of(plane: Support, end: str) -> Iterator[tuple[str, SupportedAxis]]:
    """The axes of a bearing by what they are here: y is the one that stands steeper."""
    up = max(plane.axes, key=lambda axis: round(abs(math.cos(axis.direction)), 6))
    return ((f"{'y' if axis is up else 'x'}{end}", axis) for axis in plane.axes)


def sensor_share(z: float, l_is: float, l_os: float) -> float:
    """Share of the outboard sensor in the displacement at plane z, m from the centre of mass, outboard positive; the inboard
    one's is the rest (T 6.7). `l_is`, `l_os`: their distances from it, m."""
    return (z + l_is) / (l_is + l_os)


def displacement(inboard: Array, outboard: Array, share: float) -> Array:
    """Displacement in m of the plane that has that `share`, from both sensors' readings."""
    return inboard * (1 - share) + outboard * share


def radial_currents(one: Array, two: Array, three: Array, four: Array) -> tuple[Array, Array]:
    """i_x, i_y in A by the currents of the four segments (T 6.18), or by q1, d1, q2, d2 of two (T 7.11, 7.12): i_x is
    (d2 - d1)/2, i_y is (q1 - q2)/2."""
    return (four - two) / 2, (one - three) / 2
