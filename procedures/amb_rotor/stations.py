"""Where a machine's axes pull, its probes look and its rings stand, in the coordinates of its shaft: by the rig file's tables.

y is along the first axis of the first bearing, z across it, to the side of that bearing's second axis; at a place l from the
centre of mass towards the far end the shaft stands at y + l theta and z - l psi (T 2.17). So what looks or pulls there at an
angle a from y towards z moves by

    cos a (y + l theta) + sin a (z - l psi)

which is a row of a matrix: one for the probes, one for the bearings, one for the rings. Places and angles are sums of numbers
with identities, so that what is made of them is uncertain by each once.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from bench.errors import Lacking
from bench.rigfile import RigFile
from bench.rigfile.numbers import Sum, Term
from bench.rigfile.places import CENTRE, PlaceError, Places
from bench.rigfile.supports import Support, once_per_rig, two_planes
from bench.rigfile.toleranced import Toleranced

Array = npt.NDArray[np.float64]
SQUARE = 1e-12  # of a cosine: what rounding leaves of nothing
COORDINATES = ("y", "z", "psi", "theta")
NUDGES: tuple[tuple[str, float], ...] = (("y", 10e-6), ("theta", 100e-6))  # of the set points, m and rad, at most
AXIAL = "x"
ALONG = ""  # where axes are asked for by name: along the shaft, and no axis is called so
NOTHING = Sum()
DETERMINED = 1e-3  # least over greatest singular value, arms over their own length


@dataclass(frozen=True)
class Placed:
    """What pulls or looks: `arm` from the centre of mass, m; `angle` from y towards z, rad; `sign`, -1 for a reading that falls
    when the shaft moves that way."""

    arm: Sum
    angle: Sum
    sign: int = 1

    @property
    def row(self) -> tuple[float, float, float, float]:
        """Of y, z, psi, theta."""
        return row(self.arm.value, self.angle.value, self.sign)


@dataclass(frozen=True)
class Ring:
    """A touchdown ring: `arm` from the centre of mass, m; None: where two of the four probes stand, those of its bearing, 0 the
    near one, 1 the far one (`plane`). `clearance` m."""

    name: str
    plane: int
    arm: Sum | None
    clearance: Term


@dataclass(frozen=True)
class Stations:
    """Of one machine. `axes` by name; `probes` by channel, those that look along an axis first, in the axes' order; `first` rad
    is the direction of y around the shaft, `hand` 1 where z is counter-clockwise from it; `sense` 1 where the shaft turns
    counter-clockwise, -1 where it turns clockwise; `tilt` rad from the horizontal;
    `gaps` m by axis, where they are told; `helpers`, the motors that hold the shaft beside the bearings."""

    axes: Mapping[str, Placed]
    probes: Mapping[str, Placed]
    rings: tuple[Ring, ...] = ()
    first: Sum = NOTHING
    hand: int = 1
    sense: int = 1
    tilt: Sum = NOTHING
    gaps: Mapping[str, Term] = field(default_factory=dict)
    helpers: tuple[str, ...] = ()

    @property
    def up(self) -> tuple[float, float]:
        """Shares of the upward unit vector along y and z; short of 1 where the shaft does not lie."""
        return upward(self.first.value, self.hand, self.tilt.value)

    @property
    def spin(self) -> int:
        """1 where the shaft turns from y towards z, -1 where from z towards y."""
        return self.hand * self.sense

    @property
    def channels(self) -> tuple[str, ...]:
        """Of all radial probes."""
        return tuple(self.probes)

    @property
    def reads(self) -> Array:
        """(n, 4): what the probes make of y, z, psi, theta."""
        return np.array([p.row for p in self.probes.values()])

    @property
    def pulls(self) -> Array:
        """(4, 4): what the axes' displacements are of them; its transpose makes forces and moments of the axes' forces."""
        return np.array([p.row for p in self.axes.values()])

    @property
    def lacks(self) -> tuple[str, ...]:
        """What cannot be told of the shaft, a line each."""
        out = [f"motors.{name}: found one that gives radial force; expected a shaft that its two bearings alone hold"
               for name in self.helpers]  # fmt: skip
        if not _determine(self.reads):
            out.append(f"probes: found {len(self.probes)} radial, from which position and tilts do not follow; expected four "
                       "or more, of two directions in two planes")  # fmt: skip
        if not _determine(self.pulls):
            out.append(
                "bearings: found axes that do not hold position and tilts; expected two directions in two planes"
            )
        return tuple(out)

    def share(self, direction: str, axis: str) -> float:
        """How far the shaft moves along an axis where it moves along y or z by one; 1 along x."""
        return 1.0 if direction == AXIAL else self.axes[axis].row[COORDINATES.index(direction)]

    def sorted_pair(self, one: str, other: str) -> tuple[str, str]:
        """Of a bearing's two axes the one that is more along y, and the other."""
        return (other, one) if self.share("y", one) ** 2 + SQUARE < self.share("y", other) ** 2 else (one, other)

    def moved(self, at: Mapping[str, float]) -> dict[str, float]:
        """How far the shaft at some coordinates (m and rad) is off the middle along each axis, m; what does not move is left
        out, and along the shaft (ALONG) it is that coordinate's own."""
        out: dict[str, float] = {}
        for coordinate, value in at.items():
            k = COORDINATES.index(coordinate) if coordinate != AXIAL else None
            by = {ALONG: 1.0} if k is None else {a: p.row[k] for a, p in self.axes.items() if p.row[k]}
            for axis, factor in by.items():
                out[axis] = out[axis] + factor * value if axis in out else factor * value
        return out


def row(arm: float, angle: float, sign: int = 1) -> tuple[float, float, float, float]:
    """What moves at an `arm` m from the centre of mass at an `angle` rad from y, of y, z (m), psi, theta (rad)."""
    y, z = (sign * _rounded(f(angle)) for f in (math.cos, math.sin))
    return y, z, -z * arm, y * arm


def _rounded(share: float) -> float:
    nearest = float(round(share))
    return nearest if abs(share - nearest) < SQUARE else share


def _determine(rows: Array) -> bool:
    if len(rows) < 4:
        return False
    length = max(float(np.hypot(rows[:, 2], rows[:, 3]).max()), 1e-9)
    singular = np.linalg.svd(rows / [1, 1, length, length], compute_uv=False)
    return bool(singular[-1] > DETERMINED * singular[0])


def in_two_planes(axes: Sequence[str], near: float, far: float) -> Stations:
    """Of four axes, y and z of the near bearing and then of the far one, at their places from the centre of mass, m."""
    arms, angles = (near, near, far, far), (0.0, math.pi / 2) * 2
    return Stations(
        {a: Placed(Sum(exact=arm), Sum(exact=angle)) for a, arm, angle in zip(axes, arms, angles, strict=True)}, {}
    )


@once_per_rig
def stations(rig: RigFile) -> Stations:
    """Of a rig's machine of two radial bearings with two axes each.

    Raises:
        Lacking: it has other bearings, or a place or direction of something cannot be told.
    """
    planes, places = two_planes(rig, probed=False), Places(rig)
    try:
        return _stations(rig, places, planes)
    except PlaceError as error:
        raise Lacking(str(error)) from error


def _stations(rig: RigFile, places: Places, planes: tuple[Support, Support]) -> Stations:
    one, other = (f"bearings/{planes[0].name}/{axis.name}" for axis in planes[0].axes)
    y = places.direction(one)
    hand = 1 if math.sin(places.direction(other).value - y.value) > 0 else -1

    def turned(part: str) -> Sum:
        angle = places.direction(part) - y
        return angle if hand > 0 else -angle

    axes = {a.name: Placed(places.distance(CENTRE, f"bearings/{p.name}"), turned(f"bearings/{p.name}/{a.name}"))
            for p in planes for a in p.axes}  # fmt: skip
    looking = {probe.channel: Placed(places.distance(CENTRE, f"probes/{name}"), turned(f"probes/{name}"), probe.sign)
               for name, probe in rig.probes.items() if probe.direction is not None}  # fmt: skip
    own = [a.position for p in planes for a in p.axes if a.position]
    stand = Counter(p.arm.value for p in looking.values())
    tilted = rig.shaft is not None and rig.shaft.tilt is not None
    return Stations(
        axes,
        {name: looking[name] for name in dict.fromkeys((*own, *looking))},
        tuple(_rings(rig, places, planes, paired=list(stand.values()) == [2, 2])),
        y,
        hand,
        1 if rig.shaft is None else rig.shaft.sense,
        Sum((places.number(rig.shaft.tilt, "shaft.tilt"),)) if tilted else Sum(),  # type: ignore[union-attr, arg-type]
        {a: gap for p in planes for a, gap in _gap(rig, places, p)},
        tuple(name for name, motor in rig.motors.items() if "radial force" in motor.gives),
    )


def _gap(rig: RigFile, places: Places, plane: Support) -> list[tuple[str, Term]]:
    gap = rig.bearings[plane.name].gap
    return [] if gap is None else [(a.name, places.number(gap, f"bearings.{plane.name}.gap")) for a in plane.axes]


def upward(first: float, hand: int, tilt: float) -> tuple[float, float]:
    """The upward unit vector along y and z, of y at `first` rad from up and a shaft that stands `tilt` rad."""
    lies = _rounded(math.cos(tilt)) if tilt else 1.0
    return lies * math.cos(first), lies * -hand * math.sin(first)


def _rings(rig: RigFile, places: Places, planes: tuple[Support, Support], *, paired: bool) -> list[Ring]:
    """One whose place nobody states is at its bearing: where two of four probes stand (`paired`), else where the bearing is."""
    names = [p.name for p in planes]
    out = []
    for name, ring in rig.rings.items():
        if ring.kind != "radial":
            continue
        arm = places.distance(CENTRE, f"rings/{name}") if ring.at is not None else None
        if arm is None and name not in names:
            raise PlaceError(f"rings.{name}.at", "nothing", "its place, or the name of the bearing that it belongs to")
        if arm is None and not paired:
            arm = places.distance(CENTRE, f"bearings/{name}")
        nearest = names.index(name) if name in names else _nearest(arm, places, names)
        out.append(Ring(name, nearest, arm, places.number(ring.clearance, f"rings.{name}.clearance")))
    return out


def _nearest(arm: Sum | None, places: Places, names: list[str]) -> int:
    at = 0.0 if arm is None else arm.value
    far = [abs(places.distance(CENTRE, f"bearings/{name}").value - at) for name in names]
    return far.index(min(far))


def stated(rig: RigFile, number: Toleranced | str | None, key: str) -> Toleranced | None:
    """A number of the machine's tables, by itself or by its identity; None where the rig file has none."""
    if number is None:
        return None
    with suppress(PlaceError):
        return Places(rig).number(number, key).number
    return None


def halved(t: Toleranced) -> float:
    """How far a number may be off: its half width, or three standard uncertainties."""
    return t.half_width or 3 * t.standard_uncertainty


def gaps(rig: RigFile) -> dict[str, float]:
    """Air gaps by axis, m, as far as they are told."""
    places, out = Places(rig), dict[str, float]()
    for name, bearing in rig.bearings.items():
        if bearing.gap is not None:
            with suppress(PlaceError):  # who needs it asks for it
                gap = places.number(bearing.gap, f"bearings.{name}.gap")
                out |= dict.fromkeys(bearing.axes, gap.factor * gap.number.value)
    return out
