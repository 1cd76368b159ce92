"""The twin's mechanics once more, for tests: vectors in the rig file's own frame, from the rig file's own places and
directions. Nothing of it is shared with the core, nor with what makes the core's tables.

x towards the far end, y up, z a quarter turn on counter-clockwise seen from there. The shaft's centre line is at
r + t x p e_x for a place p from the centre of mass, t the small rotation. With the spin momentum H = I_p w e along the tilted
axis e = e_x + t x e_x, whose own change a torque along e makes,
    m r'' = sum F + m g,    I t'' = sum (p e_x) x F - I_p w t' x e_x.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.rigfile.numbers import Sum
from bench.rigfile.places import CENTRE, Places
from bench.rigfile.toleranced import Toleranced

Array = npt.NDArray[np.float64]
ALONG = np.array([1.0, 0.0, 0.0])
SATURATED_M = 1e-4
Pull = tuple[float, Array]  # where along the shaft from its centre of mass, and the force there


@dataclass(frozen=True)
class Rotor:
    """A rig with the numbers `v` that were drawn for it."""

    rig: RigFile
    v: Mapping[str, float]

    def _sum(self, total: Sum) -> float:
        return total.exact + sum(t.factor * self.v[t.identity.replace("/", ".")] for t in total.terms)

    def number(self, stated: Toleranced | str | None, key: str, other: float = 0.0) -> float:
        """A number of the rig file; `other` where it has none."""
        return other if stated is None else self._sum(Sum((Places(self.rig).number(stated, key),)))

    def place(self, part: str) -> float:
        """From the centre of mass towards the far end, m."""
        return self._sum(Places(self.rig).place(part)) - self._sum(Places(self.rig).place(CENTRE))

    def way(self, part: str) -> Array:
        """A direction around the shaft."""
        angle = self._sum(Places(self.rig).direction(part))
        return np.array([0.0, math.cos(angle), math.sin(angle)])

    @property
    def sense(self) -> int:
        """Of the speed."""
        assert self.rig.shaft is not None
        return self.rig.shaft.sense


@dataclass(frozen=True)
class Motion:
    """Of a rigid shaft, in the rig file's frame; `spin` about +x, `angle` of its mark from up."""

    at: Array
    tilt: Array
    velocity: Array
    turning: Array
    angle: float
    spin: float

    def place(self, p: float) -> Array:
        """Displacement of the centre line."""
        return np.asarray(self.at + np.cross(self.tilt, p * ALONG))

    def speed(self, p: float) -> Array:
        """And how fast."""
        return np.asarray(self.velocity + np.cross(self.turning, p * ALONG))


def motion(s: Array, sense: int) -> Motion:
    """Of the core's state: its frame is turned half about the vertical where the speed counts clockwise."""
    turn = np.array([sense, 1.0, sense])
    tilt, turning = (turn * np.array([0, s[k], s[k + 1]]) for k in (3, 9))
    return Motion(turn * s[:3], tilt, turn * s[6:9], turning, sense * s[5], sense * s[11])


def attraction(beta: float, gap: float, xi: float, pair: tuple[float, float]) -> float:
    """N, of a pair of coils."""
    near, far = max(gap - xi, SATURATED_M), max(gap + xi, SATURATED_M)
    return beta * ((pair[0] / near) ** 2 - (pair[1] / far) ** 2)


def forces(rotor: Rotor, m: Motion, coil: Array) -> Iterator[Pull]:
    """Of all bearings: `coil` (2, n) A, of their axes in the order of the rig file, radial ones first."""
    radial = [(b, a) for b, part in rotor.rig.bearings.items() for a in part.axes if part.kind == "radial"]
    axial = [(b, a) for b, part in rotor.rig.bearings.items() for a in part.axes if part.kind == "axial"]
    for k, (bearing, axis) in enumerate((*radial, *axial)):
        part = rotor.rig.bearings[bearing]
        p = rotor.place(f"bearings/{bearing}") if part.kind == "radial" else 0.0
        way = rotor.way(f"bearings/{bearing}/{axis}") if part.kind == "radial" else ALONG
        gap = rotor.number(part.gap, f"bearings.{bearing}.gap", 5e-4)
        xi = float(way @ m.place(p)) + rotor.v[f"magnetic_offset.{axis}"]
        yield p, attraction(rotor.v[f"beta.{axis}"], gap, xi, (float(coil[0, k]), float(coil[1, k]))) * way


def unbalances(rotor: Rotor, m: Motion, spin_rate: float) -> Iterator[Pull]:
    """u e(phi + a) turns with the shaft: minus its second derivative."""
    for name in rotor.rig.balancing:
        at = m.angle + rotor.sense * rotor.v[f"unbalance_phase.{name}"]
        out = np.array([0.0, math.cos(at), math.sin(at)])
        aside = np.cross(ALONG, out)
        yield rotor.place(f"balancing/{name}"), rotor.v[f"unbalance.{name}"] * (m.spin**2 * out - spin_rate * aside)


def touching(rotor: Rotor, m: Motion) -> Iterator[tuple[float, Array, float]]:
    """Of the rings that have a place: where, force, and torque about x."""
    v = rotor.v
    for name, ring in rotor.rig.rings.items():
        if ring.kind != "radial" or ring.at is None:
            continue
        p = rotor.place(f"rings/{name}")
        off, speed = m.place(p) * [0, 1, 1], m.speed(p) * [0, 1, 1]
        r, clearance = float(np.linalg.norm(off)), rotor.number(ring.clearance, f"rings.{name}.clearance")
        out = off / r if r else off
        push = v["ring_stiffness"] * (r - clearance) + v["ring_damping"] * float(speed @ out)
        if r <= clearance or push <= 0:
            continue
        aside = np.cross(ALONG, out)
        drag = v["ring_friction"] * push * math.tanh((float(speed @ aside) + v["ring_radius"] * m.spin) / 0.01)
        yield p, -push * out - drag * aside, -drag * v["ring_radius"]


def derivative(rotor: Rotor, s: Array, coil: Array, torque: float = 0.0) -> Array:
    """Of the core's state, (12,): positions x y z psi theta and angle, and their rates; a rigid shaft with rings that have
    places. `torque` N m along the speed, drag in the bearings apart."""
    rig, v, m = rotor.rig, rotor.v, motion(s, rotor.sense)
    shaft = rig.shaft
    assert shaft is not None
    mass, polar, inertia = (
        rotor.number(getattr(shaft, key), f"shaft.{key}", v.get(key, 0.0))
        for key in ("mass", "polar_inertia", "transverse_inertia")
    )
    met = list(touching(rotor, m))
    rate = (rotor.sense * torque - v["viscous"] * m.spin + sum(t for *_, t in met)) / polar
    pulls = [*forces(rotor, m, coil), *unbalances(rotor, m, rate), *((p, f) for p, f, _ in met), *_coupling(rotor, m)]
    tilt = rotor.number(shaft.tilt, "shaft.tilt")
    down = v["site.gravity"] * np.array([-math.sin(tilt), -math.cos(tilt), 0.0])
    force = sum((f for _, f in pulls), np.zeros(3)) + mass * down
    moment = sum((np.cross(p * ALONG, f) for p, f in pulls), np.zeros(3))
    bent = (moment - polar * m.spin * np.cross(m.turning, ALONG)) / inertia
    turn = np.array([rotor.sense, 1.0, rotor.sense])
    moved, turned = turn * force / mass, turn * bent
    if not any(b.kind == "axial" for b in rig.bearings.values()):
        moved[0] = 0.0
    return np.array([*s[6:12], *moved, turned[1], turned[2], rotor.sense * rate])


def _coupling(rotor: Rotor, m: Motion) -> Iterator[Pull]:
    """Relaxed where the shaft is `offset` up and, as drawn, aside."""
    part = rotor.rig.coupling
    if part is not None:
        p = rotor.place("coupling")
        at = m.place(p) - np.array([0.0, rotor.number(part.offset, "coupling.offset"), 0.0])
        yield p, -rotor.number(part.stiffness, "coupling.stiffness") * at * [0, 1, 1]
