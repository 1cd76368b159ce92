"""Places and directions of a machine's parts that cannot all be true."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import combinations
from typing import Any

from bench.rigfile.model import RigFile
from bench.rigfile.numbers import Sum, Term
from bench.rigfile.places import CENTRE, PlaceError, Places
from bench.rigfile.toleranced import Toleranced

APART_M = 1e-3  # two bearings of a kind that are nearer are one, or a slip
APART_RAD = math.radians(10)  # two axes of a bearing that are nearer leave a direction unheld
STANDS_RAD = math.radians(1)  # from upright
AGREE = 3.0  # standard uncertainties of a span and of the places that it lies between, and
AGREE_M = 1e-4  # what a drawing is rounded to
ROUNDED = 1e-3  # share of an inertia or a mass, to which it is rounded
Found = tuple[str, str, str]


def contradictions(rig: RigFile, places: Places) -> Iterator[Found]:
    """Key, found and expected of each."""
    for look in (_apart, _parallel, _upright, _ends, _spans, _rings, _inertias):
        yield from look(rig, places)


def _told(look: Callable[[Any], Sum], part: Any) -> Sum | None:
    """None where it cannot be told, which is told elsewhere."""
    try:
        return look(part)
    except PlaceError:
        return None


def _apart(rig: RigFile, places: Places) -> Iterator[Found]:
    """Two bearings of a kind are not in one place."""
    told = [(n, b.kind, _told(places.place, f"bearings/{n}")) for n, b in rig.bearings.items() if b.at is not None]
    placed = [(name, kind, at.value) for name, kind, at in told if at is not None]
    for (one, kind, a), (other, another, b) in combinations(placed, 2):
        if kind == another and abs(a - b) < APART_M:
            yield f"bearings.{other}.at", f"{b * 1e3:g} mm, where {one} is", "a place of its own"


def _parallel(rig: RigFile, places: Places) -> Iterator[Found]:
    """The axes of a bearing look in different directions."""
    for bearing, part in rig.bearings.items():
        told = [(axis, _told(places.direction, f"bearings/{bearing}/{axis}")) for axis in part.axes]
        for (one, a), (other, b) in combinations([(axis, d.value) for axis, d in told if d is not None], 2):
            if abs(math.sin(a - b)) < math.sin(APART_RAD):
                yield (f"bearings.{bearing}.axes.{other}.direction", f"{math.degrees(b):g}°, along {one}",
                       f"an axis that is {math.degrees(APART_RAD):g}° or more from parallel")  # fmt: skip


def _upright(rig: RigFile, places: Places) -> Iterator[Found]:
    """Where directions do not count from up, the file says which of them is up, unless the shaft stands: then none is."""
    if rig.shaft is None:
        return
    with suppress(PlaceError):
        tilt = 0.0 if rig.shaft.tilt is None else places.number(rig.shaft.tilt, "shaft.tilt").number.value
        stands = abs(math.cos(tilt)) < math.sin(STANDS_RAD)
        if stands and rig.shaft.up is not None:
            yield "shaft.up", "a direction on a shaft that stands", "none: `zero_at` says where directions have their 0"
        if not stands and rig.shaft.up is None and rig.shaft.zero_at != "up":
            yield ("shaft.zero_at", f"{rig.shaft.zero_at!r} on a shaft that does not stand",
                   "`up` beside it: which direction, counted from there, is up")  # fmt: skip


def _ends(rig: RigFile, places: Places) -> Iterator[Found]:
    """Nothing is beyond the shaft's ends."""
    if rig.shaft is None or rig.shaft.ends is None:
        return
    near, far = (_told(places.end, k) for k in (0, 1))
    if near is None or far is None:
        return
    low, high = near.value, far.value
    if low >= high:
        yield "shaft.ends", f"{low * 1e3:g} to {high * 1e3:g} mm", "the near end first"
        return
    for part in dict.fromkeys((CENTRE, *places.parts)):
        at = _told(places.place, part)
        if at is not None and not low <= at.value <= high:
            key = f"shaft.{CENTRE}" if part == CENTRE else f"{part.replace('/', '.')}.at"
            yield key, f"{at.value * 1e3:g} mm, beyond the shaft", f"{low * 1e3:g} to {high * 1e3:g} mm"


def _spans(rig: RigFile, places: Places) -> Iterator[Found]:
    """A length that was measured between two parts agrees with their places."""
    for identity, (one, other) in rig.spans.items():
        a, b, span = _told(places.place, one), _told(places.place, other), places.known.get(identity)
        if a is None or b is None or span is None:
            continue
        between = b - a
        if between.terms and all(t.identity == identity for t in between.terms):
            continue
        spread = math.hypot(span.standard_uncertainty, *(t.number.standard_uncertainty for t in between.terms))
        if abs(abs(between.value) - span.value) > AGREE * spread + AGREE_M:
            lengths = " and ".join(t.identity for t in between.terms)
            yield (_value_of(identity), f"{span.value * 1e3:g} mm", f"{abs(between.value) * 1e3:g} mm from {one} to {other}, "
                   f"which {lengths} give, within their tolerances")  # fmt: skip


def _rings(rig: RigFile, places: Places) -> Iterator[Found]:
    """The rings catch the shaft before it strikes a magnet."""
    stated = [(f"bearings.{n}.gap", b.gap) for n, b in rig.bearings.items() if b.kind == "radial" and b.gap is not None]
    gaps = [t for key, gap in stated for t in _terms(places, gap, key)]
    least = min(gaps, key=lambda gap: gap.number.value, default=None)
    rings = {t.identity: t.number.value for n, r in rig.rings.items() if r.kind == "radial"
             for t in _terms(places, r.clearance, f"rings.{n}.clearance")}  # fmt: skip
    for identity, clearance in rings.items():
        if least is not None and clearance >= least.number.value:
            yield (_value_of(identity), f"{clearance:g} m",
                   f"less than {least.identity} = {least.number.value:g} m, or the journal strikes the AMB first")  # fmt: skip


def _inertias(rig: RigFile, places: Places) -> Iterator[Found]:
    """About its axis a body has as much inertia as about both others together, no more; about those no more than if all of its
    mass were a shaft's length away, and what its thickness adds. Both but for their tolerances and rounded figures."""
    shaft = rig.shaft
    if shaft is None:
        return
    polar, transverse, mass = (
        _number(places, getattr(shaft, key), f"shaft.{key}", unit)
        for key, unit in (("polar_inertia", "kg m^2"), ("transverse_inertia", "kg m^2"), ("mass", "kg"))
    )
    if transverse is None:
        return
    if polar is not None and _least(polar) > 2 * _most(transverse):
        yield ("shaft.polar_inertia", f"{polar.value:g} kg m^2",
               f"at most {2 * transverse.value:.4g} kg m^2, twice transverse_inertia: no body has more")  # fmt: skip
    ends = [_told(places.end, k) for k in (0, 1)] if shaft.ends is not None else []
    if mass is None or len(ends) < 2 or ends[0] is None or ends[1] is None:
        return
    length = ends[1].value - ends[0].value
    thick = 0.0 if polar is None else _most(polar)
    if length > 0 and _least(transverse) > _most(mass) * length**2 + thick / 2:
        most = mass.value * length**2 + (0.0 if polar is None else polar.value / 2)
        yield ("shaft.transverse_inertia", f"{transverse.value:g} kg m^2",
               f"at most {most:.4g} kg m^2, which {mass.value:g} kg within {length * 1e3:g} mm can have: look at the units "
               "of mass, inertias and ends")  # fmt: skip


def _number(places: Places, stated: Toleranced | str | None, key: str, unit: str) -> Toleranced | None:
    """A number above 0 in the unit; None where there is none, or none that can be told."""
    found = [t.number for t in _terms(places, stated, key)] if stated is not None else []
    return found[0] if found and found[0].unit == unit and found[0].value > 0 else None


def _most(number: Toleranced) -> float:
    return number.value * (1 + ROUNDED) + AGREE * number.standard_uncertainty


def _least(number: Toleranced) -> float:
    return number.value * (1 - ROUNDED) - AGREE * number.standard_uncertainty


def _terms(places: Places, stated: Toleranced | str, key: str) -> tuple[Term, ...]:
    """The number, or nothing where there is none of that identity."""
    try:
        return (places.number(stated, key),)
    except PlaceError:
        return ()


def _value_of(identity: str) -> str:
    return f"{identity.replace('/', '.')}.value"
