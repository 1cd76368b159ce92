"""What of a rig file the twin is made of, in the order of its core: axes, probes, rings, balancing planes, and where each is.

Inside the twin x runs along the shaft in the sense in which its speed counts, so that a shaft whose `sense` is -1 is described
from its near end: stations and angles turn their sign, and nothing else knows of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

from bench.errors import ConfigError, Problem
from bench.rigfile import RigFile
from bench.rigfile.elements import Probe
from bench.rigfile.numbers import Sum
from bench.rigfile.places import CENTRE, Places
from bench.rigfile.supports import once_per_rig
from bench.rigfile.toleranced import Toleranced

Numbers = Mapping[str, float]
MOST = {"radial axes": 12, "axial axes": 1, "probes": 16, "rings": 8, "balancing planes": 4}
TOGETHER_M = 1e-3  # probes that are nearer to each other along the shaft see the same journal


@dataclass(frozen=True)
class AxisPart:
    """An axis of a bearing: its name, its bearing's, and the channels of what is told of it."""

    name: str
    bearing: str
    coils: tuple[str, ...]
    voltages: tuple[str, ...]

    @property
    def part(self) -> str:
        """As the rig's places know it."""
        return f"bearings/{self.bearing}/{self.name}"


@dataclass(frozen=True)
class RingPart:
    """A plane in which the shaft can touch: `ring` of the rig file ("" where it states none), `part` that stands there."""

    ring: str
    part: str


@dataclass(frozen=True)
class Layout:
    """Parts in the core's order. `journals` are the planes of the radial probes, each by its first probe's name."""

    radial: tuple[AxisPart, ...]
    axial: AxisPart | None
    looking: tuple[str, ...]
    along: tuple[str, ...]
    journals: Mapping[str, tuple[str, ...]]
    rings: tuple[RingPart, ...]
    planes: tuple[str, ...]
    sense: int

    @property
    def axes(self) -> tuple[AxisPart, ...]:
        """All of them, the axial one last."""
        return (*self.radial, self.axial) if self.axial is not None else self.radial

    @property
    def probes(self) -> tuple[str, ...]:
        """Names of the probes, those along the shaft last."""
        return (*self.looking, *self.along)


@once_per_rig
def layout_of(rig: RigFile) -> Layout:
    """What the twin of a rig is made of.

    Raises:
        ConfigError: something that a twin needs is missing, or is more than it can do; each by name.
    """
    if lacking := tuple(_lacking(rig)):
        raise ConfigError(f"rig {rig.name} cannot be simulated as it is described:", lacking)
    radial = tuple(_axes(rig, "radial"))
    axial = tuple(_axes(rig, "axial"))
    looking = tuple(n for n, p in rig.probes.items() if p.direction is not None)
    shaft = rig.shaft
    assert shaft is not None
    return Layout(
        radial=radial,
        axial=axial[0] if axial else None,
        looking=looking,
        along=tuple(n for n, p in rig.probes.items() if p.direction is None),
        journals=_journals(rig, looking),
        rings=tuple(_rings(rig)),
        planes=tuple(f"balancing/{name}" for name in rig.balancing) or _outer(rig),
        sense=shaft.sense,
    )


def _axes(rig: RigFile, kind: str) -> Iterator[AxisPart]:
    for b, bearing in rig.bearings.items():
        for name, axis in bearing.axes.items() if bearing.kind == kind else ():
            yield AxisPart(name, b, axis.coils, axis.voltages)


def _journals(rig: RigFile, looking: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Probes that stand in one plane, by the first one's name."""
    places, out = Places(rig), dict[str, tuple[str, ...]]()
    at = {name: places.place(f"probes/{name}").value for name in looking}
    for name in looking:
        first = next((n for n in out if abs(at[n] - at[name]) < TOGETHER_M), name)
        out[first] = (*out.get(first, ()), name)
    return out


def _rings(rig: RigFile) -> Iterator[RingPart]:
    """A ring that has no place stands in the plane of the bearing of its name, or in every radial bearing's."""
    bearings = [name for name, b in rig.bearings.items() if b.kind == "radial"]
    stated = {name: ring for name, ring in rig.rings.items() if ring.kind == "radial"}
    for name, ring in stated.items():
        if ring.at is not None:
            yield RingPart(name, f"rings/{name}")
        else:
            yield from (RingPart(name, f"bearings/{b}") for b in ([name] if name in bearings else bearings))
    if not stated:
        yield from (RingPart("", f"bearings/{b}") for b in bearings)


def _outer(rig: RigFile) -> tuple[str, ...]:
    """Where no plane is stated, unbalance acts in those of the first and the last radial bearing."""
    places = Places(rig)
    at = {f"bearings/{n}": places.place(f"bearings/{n}").value for n, b in rig.bearings.items() if b.kind == "radial"}
    ends = sorted(at, key=lambda part: at[part])
    return tuple(dict.fromkeys((ends[0], ends[-1])))


def _lacking(rig: RigFile) -> Iterator[Problem]:
    """What a twin cannot do without, or has too much of."""

    def problem(key: str, found: str, expected: str) -> Problem:
        return Problem(rig.path, key, found, expected)

    if not any(b.kind == "radial" for b in rig.bearings.values()):
        yield problem(
            "bearings", "no radial one", "one that holds the shaft; a twin's rotor floats, and a stage has none"
        )
        return
    if rig.shaft is None or (rig.shaft.mass is None and "mass" not in rig.simulation):
        yield problem("shaft.mass", "nothing", "the mass of what floats, here or as simulation.mass")
        return
    counts = {"radial axes": len(list(_axes(rig, "radial"))), "axial axes": len(list(_axes(rig, "axial"))),
              "probes": len(rig.probes), "rings": len(list(_rings(rig))), "balancing planes": len(rig.balancing)}  # fmt: skip
    yield from (
        problem(what, str(n), f"at most {MOST[what]} in a twin") for what, n in counts.items() if n > MOST[what]
    )
    taken: dict[str, str] = {}
    for axis in (*_axes(rig, "radial"), *_axes(rig, "axial")):
        key = f"bearings.{axis.bearing}.axes.{axis.name}"
        if (first := taken.setdefault(axis.name, axis.bearing)) != axis.bearing:
            yield problem(key, f"the name of an axis of {first} too", "a name of its own: a twin knows axes by name")
        if not axis.coils:
            yield problem(f"{key}.coils", "nothing", "one or two coils")
    if any(m for m in rig.motors.values() if any("force" in way for way in m.gives)):
        yield problem("motors", "one that gives force", "none: a twin's rotor is held by its bearings alone")
    if not any(_looks(p) for p in rig.probes.values()):
        yield problem("probes", "none that looks at the shaft from the side", "what the controller holds the shaft by")


def _looks(probe: Probe) -> bool:
    return probe.direction is not None


@once_per_rig
def places_of(rig: RigFile) -> Places:
    """Of a rig file, whose numbers it looks for once."""
    return Places(rig)


@dataclass(frozen=True)
class Geometry:
    """Places and angles of one machine, from the numbers `v` that were drawn for it; what is not among them is nominal."""

    rig: RigFile
    layout: Layout
    v: Numbers

    @cached_property
    def places(self) -> Places:
        """Of the rig file."""
        return places_of(self.rig)

    def station(self, part: str) -> float:
        """Place of a part on the twin's x, m from the centre of mass."""
        return self.layout.sense * (self.told(self.places.place(part)) - self.told(self.places.place(CENTRE)))

    def angle(self, part: str) -> float:
        """Direction of a part from y towards z, rad."""
        return self.layout.sense * self.told(self.places.direction(part))

    def number(self, stated: Toleranced | str, key: str) -> float:
        """A number that the rig file states at `key`, or refers to."""
        return self.told(Sum((self.places.number(stated, key),)))

    def told(self, total: Sum) -> float:
        """What a sum of the rig file's numbers is for this machine."""
        return total.exact + sum(t.factor * self.v.get(drawn_as(t.identity), t.number.value) for t in total.terms)


def drawn_as(identity: str) -> str:
    """The name under which a number is drawn."""
    return identity.replace("/", ".")
