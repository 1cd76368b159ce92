"""The two balancing planes of a shaft: where weights go, at what radius, and by what scale the operator reads their angle.

A scale begins `zero` on from the shaft's mark, and runs with the shaft's angle (`sense` 1) or against it (-1): what stands at a
on it stands at zero + sense a from the mark. An unbalance is solved from the mark, and told on the scale of its plane.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import Lacking
from bench.rigfile import RigFile
from bench.rigfile.elements import BalancingPlane
from bench.rigfile.places import CENTRE, PlaceError, Places
from bench.rigfile.supports import once_per_rig
from bench.rigfile.toleranced import Toleranced
from bench.uncertainty import Estimate
from procedures.amb_rotor.lengths import number
from procedures.synchronous import facts

Complex = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class Plane:
    """A plane by its `name`: `at`, its place from the centre of mass, towards its own end, m; `radius` of the weights m; `zero`
    of the scale rad; what is not known of a weight's mass kg and angle rad; `positions` of its holes, 0 where a weight goes at
    any angle. `scaled` says whether the rig file tells where the scale begins."""

    name: str
    at: Estimate
    radius: Estimate
    zero: Estimate
    sense: int
    weight_mass: Toleranced
    weight_angle: Toleranced
    positions: int
    scaled: bool

    def from_mark(self, angle: Any, zero: Any = None) -> Any:
        """Of an angle on the scale, rad; by another zero than the rig file's where one is given. So of stacks (n,)."""
        return (self.zero.value if zero is None else zero) + self.sense * angle

    def turned(self, u: complex, zero: float | None = None) -> complex:
        """An unbalance that stands on the scale, from the mark."""
        begins = self.zero.value if zero is None else zero
        seen = u if self.sense > 0 else u.conjugate()
        return complex(seen * np.exp(1j * begins))

    def told(self, u: Any, zero: Any = None) -> Any:
        """An unbalance from the mark as the scale has it; so stacks of them (n,)."""
        begins = self.zero.value if zero is None else zero
        back = u * np.exp(-1j * begins)
        return back if self.sense > 0 else back.conjugate()


Planes = tuple[Plane, Plane]


def missing(rig: RigFile) -> Iterator[str]:
    """What a balancing needs of the planes and the rig file does not say, a line each. Of more than two a plan names two."""
    if len(rig.balancing) < 2:
        found = ", ".join(rig.balancing) or "none"
        yield f"balancing: found {found}; this procedure takes two planes"
        return
    yield from _of_two(rig) if len(rig.balancing) == 2 else ()
    yield from _more_probes(rig)


def chosen(rig: RigFile, names: Sequence[str]) -> RigFile:
    """The rig with the two planes that a plan names, or as it is where it names none: what another plane has on it acts like
    an unbalance in these two."""
    if not names or {*names} == rig.balancing.keys():
        return rig
    return rig.model_copy(update={"balancing": {n: p for n, p in rig.balancing.items() if n in names}})


def of_plan(rig: RigFile, names: Sequence[str]) -> Iterator[str]:
    """What is wrong with the planes that a plan names, or with its naming none."""
    known = ", ".join(rig.balancing)
    if not names and len(rig.balancing) > 2:
        ends = ", ".join(f'"{part.partition("/")[2]}"' for part in facts.unbalance_planes(rig))
        yield f"planes: found none; expected the two of {known} in which weights are fixed, such as planes = [{ends}]"
    elif names and (len({*names}) != 2 or len(names) != 2 or not {*names} <= rig.balancing.keys()):
        yield f"planes: found {', '.join(names)}; expected two of {known}"
    elif names:
        yield from _of_two(chosen(rig, names))


def _of_two(rig: RigFile) -> Iterator[str]:
    for name, plane in rig.balancing.items():
        for key in ("weight_mass", "weight_angle"):
            if getattr(plane, key) is None:
                yield f"balancing.{name}.{key}: found none; expected what is not known of a weight that is fixed there"
    yield from _one_sided(rig)


def _more_probes(rig: RigFile) -> Iterator[str]:
    """Runout counts as an unbalance by what the loop sees of it (`runout.as_unbalance`): the four probes that are read here."""
    aside = [name for name, probe in rig.probes.items() if probe.direction is not None]
    if len(aside) > 4:
        found = f"probes: found {len(aside)} that look at the shaft from the side"
        yield f"{found}; this procedure takes four: the controller may hold the shaft by the runout of the others"


def _one_sided(rig: RigFile) -> Iterator[str]:
    """What is permissible is shared out between planes on both sides of the centre of mass."""
    places = Places(rig)
    try:
        at = [places.distance(CENTRE, f"balancing/{name}").value for name in rig.balancing]
    except PlaceError as error:
        yield str(error)
        return
    if min(at) >= 0 or max(at) <= 0:
        told = ", ".join(f"{name} at {1e3 * x:+.4g} mm" for name, x in zip(rig.balancing, at, strict=True))
        yield f"balancing: found {told} from the centre of mass; this procedure takes planes on both sides of it"


@once_per_rig
def planes_of(rig: RigFile) -> Planes:
    """Of a rig, the nearest to the near end first.

    Raises:
        Lacking: it has not two, or they are not told.
    """
    if lines := (*missing(rig), *of_plan(rig, ())):
        raise Lacking(*lines)
    near, far = (part.partition("/")[2] for part in facts.unbalance_planes(rig))
    lengths = facts.collect_lengths(rig)
    return _plane(rig, near, lengths["l_iu"]), _plane(rig, far, lengths["l_ou"])


def names_of(rig: RigFile) -> tuple[str, str]:
    """Of both planes."""
    one, other = planes_of(rig)
    return one.name, other.name


def _plane(rig: RigFile, name: str, at: Estimate) -> Plane:
    p, places, key = rig.balancing[name], Places(rig), f"balancing.{name}"
    zero = Estimate.exact(0.0, "rad")
    if p.zero is not None:
        zero = number(rig, p.zero, f"{key}.zero", f"zero of the scale, {name}")
    mass, angle = (_weight(places, p, key, what) for what in ("weight_mass", "weight_angle"))
    radius = number(rig, p.radius, f"{key}.radius", "radius of the weights")
    return Plane(name, at, radius, zero, p.sense, mass, angle, p.positions or 0, p.zero is not None or p.sense < 0)


def _weight(places: Places, plane: BalancingPlane, key: str, what: str) -> Toleranced:
    stated = getattr(plane, what)
    assert stated is not None  # `missing` says so
    return places.number(stated, f"{key}.{what}").number


def all_told(planes: Planes, from_mark: Complex, zeros: Sequence[Any]) -> Complex:
    """Unbalances (..., 2) from the mark on the scales of their planes, which begin at `zeros`."""
    return np.stack([p.told(from_mark[..., k], zeros[k]) for k, p in enumerate(planes)], axis=-1)


def describe(plane: Plane) -> str:
    """How the angles of a plane count, for the operator."""
    if not plane.scaled:
        return "Angles are counted from y towards z, in the direction of rotation, while the scale's zero faces y."
    way = "with" if plane.sense > 0 else "against"
    return (f"Angles are those of the plane's own scale, which begins {math.degrees(plane.zero.value) % 360:.1f}° on from the "
            f"mark and runs {way} the shaft's angle.")  # fmt: skip
