"""From readings of the probes to where the shaft is: centre of mass, tilts, distances to the rings (T 2.17).

Where the probes stand in two planes, two in each, the centre of mass and the tilts follow from them alone; where there are
more, or elsewhere, by least squares: all of them are weighed alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.rigfile.toleranced import Toleranced
from procedures.amb_rotor.stations import Stations, row, stations

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Edge:
    """A ring: `arm` m from the centre of mass, None where the probes of the near (0) or the far (1) `plane` stand; `clearance`
    m."""

    plane: int
    arm: float | None
    clearance: float


@dataclass(frozen=True)
class Facts:
    """What the readings are turned into positions with. By probe: `gains`, below zero where it reads backwards, `offsets` m,
    `arms` m from the centre of mass and `angles` rad from y; when the reference's phase was zero, `t_0` s; the `rings`."""

    gains: tuple[float, ...]
    offsets: tuple[float, ...]
    arms: tuple[float, ...]
    angles: tuple[float, ...]
    t_0: float
    rings: tuple[Edge, ...]

    @property
    def matrix(self) -> Array:
        """(n, 4): what the probes see of y, z, psi, theta."""
        return np.array([row(arm, angle) for arm, angle in zip(self.arms, self.angles, strict=True)])

    @property
    def pairs(self) -> tuple[tuple[int, int], tuple[int, int]] | None:
        """Of four probes, those that stand in the near and in the far plane; None where they do not stand so."""
        at = sorted(set(self.arms))
        near, far = ([k for k, arm in enumerate(self.arms) if arm == x] for x in (at[0], at[-1]))
        return ((near[0], near[1]), (far[0], far[1])) if len(at) == 2 and len(near) == len(far) == 2 else None


def centre(readings: Array, f: Facts) -> Array:
    """y, z of the centre of mass from where the sensors read zero, psi, theta: (4, n)."""
    return _solved(readings / np.array(f.gains)[:, None], f)


def distances(readings: Array, f: Facts) -> Array:
    """Of the shaft from each ring's centre, (rings, n) m."""
    at = at_rings((readings - np.array(f.offsets)[:, None]) / np.array(f.gains)[:, None], f)
    return np.array([np.hypot(y, z) for y, z in at]).reshape(len(f.rings), readings.shape[1])


def left(readings: Array, f: Facts) -> Array:
    """The least distance to a ring, (n,) m, below zero inside it; infinite without any."""
    clear = np.array([ring.clearance for ring in f.rings])
    found: Array = np.min(clear[:, None] - distances(readings, f), axis=0, initial=np.inf)
    return found


def at_rings(x: Array, f: Facts) -> list[tuple[Array, Array]]:
    """y and z (n,) m at each ring, of displacements (n probes, n) m at the probes."""
    q, out = _solved(x, f), []
    for ring in f.rings:
        if ring.arm is None and f.pairs is not None:
            out.append(_plane(x, f, f.pairs[ring.plane]))
            continue
        arm = ring.arm if ring.arm is not None else (min(f.arms), max(f.arms))[ring.plane]
        out.append((q[0] + arm * q[3], q[1] - arm * q[2]))
    return out


def _solved(x: Array, f: Facts) -> Array:
    """y, z, psi, theta of displacements at the probes (n, m)."""
    if f.pairs is None:
        return np.asarray(np.linalg.pinv(f.matrix) @ x)
    (yi, zi), (yo, zo) = (_plane(x, f, pair) for pair in f.pairs)
    near, far = (f.arms[pair[0]] for pair in f.pairs)
    theta, psi = (yo - yi) / (far - near), (zi - zo) / (far - near)
    return np.array([yi + -near * theta, zo + far * psi, psi, theta])


def _plane(x: Array, f: Facts, pair: tuple[int, int]) -> tuple[Array, Array]:
    """y and z where two probes stand."""
    ways = f.matrix[list(pair), :2]
    if np.array_equal(ways, np.eye(2)):
        return x[pair[0]], x[pair[1]]
    y, z = np.linalg.inv(ways) @ x[list(pair)]
    return y, z


def nominal(rig: RigFile, t_0: float = 0.0) -> Facts:
    """The facts as the rig file states them."""
    s = stations(rig)
    sensors = [rig.sensors[name] for name in s.channels]
    return Facts(
        tuple(p.sign * sensor.gain.value for p, sensor in zip(s.probes.values(), sensors, strict=True)),
        tuple(sensor.offset.value for sensor in sensors),
        *_places(s),
        t_0,
        edges(s),
    )


def ideal(s: Stations) -> Facts:
    """The same for readings without gains and offsets."""
    signs = tuple(float(p.sign) for p in s.probes.values())
    return Facts(signs, (0.0,) * len(signs), *_places(s), 0.0, edges(s))


def edges(s: Stations) -> tuple[Edge, ...]:
    """The rings as the rig file states them."""
    return tuple(Edge(r.plane, None if r.arm is None else r.arm.value, abs(r.clearance.number.value)) for r in s.rings)


def _places(s: Stations) -> tuple[tuple[float, ...], tuple[float, ...]]:
    return tuple(p.arm.value for p in s.probes.values()), tuple(p.angle.value for p in s.probes.values())


@dataclass(frozen=True)
class Length:
    """A number of the rig file that places and angles are made of: by `identity`, and how often it counts in which of the
    `Facts`: kind (arms, angles, rings, clearances), index, factor."""

    identity: str
    number: Toleranced
    counts: tuple[tuple[str, int, float], ...]

    @property
    def name(self) -> str:
        """For a budget."""
        table, _, rest = self.identity.partition("/")
        return (rest if table == "geometry" else self.identity.replace("/", " ")).replace("_", " ")

    def moved(self, f: Facts, by: float) -> Facts:
        """The facts with this number greater by so much."""
        values = {
            "arms": list(f.arms),
            "angles": list(f.angles),
            "rings": [0.0 if r.arm is None else r.arm for r in f.rings],
            "clearances": [r.clearance for r in f.rings],
        }
        for kind, k, factor in self.counts:
            values[kind][k] += factor * by
        rings = tuple(
            Edge(r.plane, None if r.arm is None else arm, clearance)
            for r, arm, clearance in zip(f.rings, values["rings"], values["clearances"], strict=True)
        )
        return Facts(f.gains, f.offsets, tuple(values["arms"]), tuple(values["angles"]), f.t_0, rings)


def lengths(rig: RigFile) -> list[Length]:
    """All that are uncertain: of the probes' places, their angles, the rings' places, their clearances."""
    s = stations(rig)
    sums = [
        *((("arms", k), p.arm) for k, p in enumerate(s.probes.values())),
        *((("angles", k), p.angle) for k, p in enumerate(s.probes.values())),
        *((("rings", k), r.arm) for k, r in enumerate(s.rings) if r.arm is not None),
    ]
    found: dict[str, list[tuple[str, int, float]]] = {}
    numbers: dict[str, Toleranced] = {}
    counted = [(kind, k, term) for (kind, k), total in sums for term in total.terms]
    counted += [("clearances", k, r.clearance) for k, r in enumerate(s.rings)]
    for kind, k, term in counted:
        numbers[term.identity] = term.number
        found.setdefault(term.identity, []).append((kind, k, abs(term.factor) if kind == "clearances" else term.factor))
    return [Length(i, numbers[i], tuple(of)) for i, of in found.items() if numbers[i].standard_uncertainty > 0]
