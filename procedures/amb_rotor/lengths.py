"""The lengths of a shaft in two radial bearings, as far as each is one number of the rig file: by the machine's tables.

Where all of them are, as on the stand of the thesis, its equations hold with these numbers as they are printed (T Table 2.3);
where a place is the sum of several numbers, or axes stand at angles that are uncertain, rows of places and angles
(`stations`) take them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from bench.errors import Lacking
from bench.rigfile import RigFile
from bench.rigfile.numbers import Sum, Term
from bench.rigfile.once import once_per_rig
from bench.rigfile.places import CENTRE, PlaceError, Places
from bench.rigfile.supports import Support, two_planes
from bench.rigfile.toleranced import Toleranced
from bench.uncertainty import Estimate
from bench.uncertainty.estimate import merged
from procedures.shared.certificates import certified


@once_per_rig
def lengths_by_name(rig: RigFile) -> Mapping[str, Term]:
    """Distances from the centre of mass, as amounts: of the bearings `l_ia` and `l_oa`, of their probes `l_is` and `l_os`, of
    two balancing planes `l_iu` and `l_ou`, of the coupling `l_c`; `amb_span` between the bearings; `gap` of both bearings,
    `clearance` of all rings, `coupling` N/m. What is no single number, or several different ones, is left out."""
    try:
        near, far = two_planes(rig, probed=False)
    except Lacking:
        return {}
    found: dict[str, Term] = {}
    for name, several in _stated(rig, near, far):
        try:
            sums = list(several)
        except PlaceError:
            continue
        terms = {(t.identity, t.factor): t for total in sums for t in total.terms}
        alone = all(len(total.terms) == 1 and not total.exact for total in sums)
        if alone and len(terms) == 1 and next(iter(terms.values())).factor == 1.0:
            found[name] = next(iter(terms.values()))
    return found


def _stated(rig: RigFile, near: Support, far: Support) -> Iterator[tuple[str, Iterator[Sum]]]:
    places = Places(rig)
    ends = (("i", near, -1), ("o", far, 1))
    for side, plane, way in ends:
        yield f"l_{side}a", _away(places, [f"bearings/{plane.name}"], way)
        channels = {axis.position for axis in plane.axes}
        yield f"l_{side}s", _away(places, [f"probes/{n}" for n, p in rig.probes.items() if p.channel in channels], way)
    planes = [f"balancing/{name}" for name in rig.balancing]
    for side, _, way in ends:
        yield f"l_{side}u", _away(places, planes, way, outermost=True)
    yield "l_c", _away(places, ["coupling"] if rig.coupling is not None else [], -1)
    yield "amb_span", (places.distance(f"bearings/{a.name}", f"bearings/{b.name}") for a, b in ((near, far),))
    gaps = {f"bearings.{p.name}.gap": rig.bearings[p.name].gap for p in (near, far)}
    yield "gap", _numbers(places, gaps)
    yield (
        "clearance",
        _numbers(places, {f"rings.{n}.clearance": r.clearance for n, r in rig.rings.items() if r.kind == "radial"}),
    )
    yield "coupling", _numbers(places, {} if rig.coupling is None else {"coupling.stiffness": rig.coupling.stiffness})


def _away(places: Places, parts: list[str], way: int, *, outermost: bool = False) -> Iterator[Sum]:
    """From the centre of mass, towards the near end (-1) or the far one (1)."""
    found = [places.distance(CENTRE, part) for part in parts]
    if outermost:
        found = [max(found, key=lambda total: way * total.value)] if len(found) > 1 else []
    yield from (total if way > 0 else -total for total in found)


def _numbers(places: Places, told: Mapping[str, Toleranced | str | None]) -> Iterator[Sum]:
    """Each of several; nothing where one is not told."""
    if None not in told.values():
        yield from (Sum((places.number(stated, key),)) for key, stated in told.items() if stated is not None)


def named(term: Term) -> Estimate:
    """A length with its identity's last part as its name."""
    return certified(term.identity, term.number, term.identity.rpartition("/")[2].replace("_", " "))


def number(rig: RigFile, told: Toleranced | str, key: str, name: str) -> Estimate:
    """A number that a table states or refers to, by its identity; `name` for a budget."""
    term = Places(rig).number(told, key)
    found = certified(term.identity, term.number, name)
    return (
        found if term.factor == 1.0 else Estimate(term.factor * found.value, found.unit, merged([(term.factor, found)]))
    )


def summed(total: Sum, unit: str) -> Estimate:
    """A sum of the rig file's numbers as an Estimate that shares each."""
    terms = [(t.factor, certified(t.identity, t.number, in_words(t.identity))) for t in total.terms]
    return Estimate(total.value, unit, merged(terms))


def in_words(identity: str) -> str:
    """An identity for a budget: `bearings/vorn/at` is "bearings vorn at"."""
    return identity.replace("/", " ").replace("_", " ")
