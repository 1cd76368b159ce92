"""What is wrong with the machine that a rig file describes: places that contradict each other, axes that are no frame, numbers
of the wrong kind, channels that are not there."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterator
from datetime import date
from typing import Any

from bench import units
from bench.errors import Problem
from bench.rigfile.certificates import certified_numbers
from bench.rigfile.check_places import contradictions
from bench.rigfile.check_stages import encoders_of
from bench.rigfile.elements import From, Of
from bench.rigfile.model import RigFile
from bench.rigfile.numbers import Term
from bench.rigfile.placenames import places_named
from bench.rigfile.places import CENTRE, PlaceError, Places
from bench.rigfile.possible import beyond_likely
from bench.rigfile.toleranced import Toleranced

KINDS = {"at": "m", "by": "m", "gap": "m", "clearance": "m", "radius": "m", "length": "m", "offset": "m", "runout": "m",
         "centre_of_mass": "m", "ends": "m", "direction": "rad", "pull": "rad", "zero": "rad", "tilt": "rad",
         "up": "rad", "hand_angle": "rad",
         "weight_angle": "rad", "misalignment": "rad", "mass": "kg", "weight_mass": "kg", "polar_inertia": "kg m^2",
         "transverse_inertia": "kg m^2", "stiffness": "N/m", "asymmetry": "1", "pole_pairs": "1", "friction": "1"}  # fmt: skip
POSITIVE = ("gap", "clearance", "radius", "length", "mass", "polar_inertia", "transverse_inertia")
LIKELY = {"gap": (1e-6, 1e-2), "clearance": (1e-6, 0.1), "radius": (1e-4, 10.0), "at": (0.0, 10.0), "by": (0.0, 10.0),
          "centre_of_mass": (0.0, 10.0)}  # m; what is beyond is a slip of the unit  # fmt: skip
TURN_RAD = 2 * math.pi + 1e-6  # what is beyond was meant in degrees
TABLES = ("shaft", "bearings", "probes", "mark", "rings", "balancing", "coupling", "hooks", "levers", "motors")
# Those of encoders are looked at with the axes that they are (check_stages).

Found = tuple[str, str, str]


def problems_of(rig: RigFile) -> Iterator[Problem]:
    """All of the machine's tables at once."""
    for key, found, expected in _all(rig):
        yield Problem(rig.path, key, found, expected)


def _all(rig: RigFile) -> Iterator[Found]:
    places = Places(rig)
    yield from places.problems()
    yield from _numbers(rig, places)
    yield from _channels(rig)
    yield from _axes(rig)
    yield from _motors(rig)
    yield from _hooks(rig)
    yield from encoders_of(rig)
    yield from _certificates(rig)
    yield from _aliases(rig)
    if rig.customer is not None and rig.laboratory is not None and rig.laboratory.customer:
        yield "laboratory.customer", rig.laboratory.customer, "[customer] alone, where there is one"
    yield from contradictions(rig, places)


def _numbers(rig: RigFile, places: Places) -> Iterator[Found]:
    """Each is of the kind that is asked for there, and lengths that can only be positive are."""
    told = set[str]()
    for key, name, stated in (found for table in TABLES for found in _stated(getattr(rig, table), (table,))):
        try:
            term = places.number(stated, key)
        except PlaceError as error:
            if name not in ("at", "by", "direction", "pull", "ends", CENTRE):  # those are told by the places
                yield error.key, error.found, error.expected
            continue
        if term.number.unit != KINDS[name]:
            yield key, f"{term.identity} in {term.number.unit}", f"a unit of the kind of {KINDS[name]}"
        elif name in POSITIVE and term.factor * term.number.value <= 0:
            yield key, f"{term.factor * term.number.value:g} {term.number.unit}", "a positive number"
        elif name == "friction" and not 0 <= term.number.value < 1:
            yield key, f"{term.factor * term.number.value:g}", "0 to 1: the share of the weight that the pulley takes"
        elif (unlikely := _unlikely(name, term, by_reference=isinstance(stated, str))) and term.identity not in told:
            told.add(term.identity)
            found, expected = unlikely
            yield key, f"{term.identity}, {found}" if isinstance(stated, str) else found, expected
        elif name in POSITIVE and term.identity not in told and _wide(term):
            told.add(term.identity)
            width = term.number.half_width or term.number.standard_uncertainty
            found = f"{term.number.value:g} ± {width:g} {term.number.unit}"
            yield key, found, "a tolerance that leaves it positive: look at the units of both"


def _wide(term: Term) -> bool:
    """Whether what is positive may be none by what it states: by half the width, or one standard uncertainty. Of a length of
    [geometry] that is a slip of its unit that is told there."""
    number, (table, _, entry) = term.number, term.identity.partition("/")
    if table == "geometry" and beyond_likely(entry, number):
        return False
    return (number.half_width or number.standard_uncertainty) >= abs(number.value)


def _unlikely(name: str, term: Term, *, by_reference: bool) -> tuple[str, str] | None:
    """What is found and expected of a number that is a slip of its unit, wherever it stands; None also where it is told by
    another check: a length where [geometry] has it, the tilt where the shaft has it."""
    value, (table, _, entry) = term.number.value, term.identity.partition("/")
    if KINDS[name] == "rad" and abs(value) > TURN_RAD and (by_reference or name != "tilt"):
        expected = "one turn at most, -360 to 360 deg: write deg where degrees are meant"
        return f"{value:g} rad, which is {math.degrees(value):g} deg", expected
    low, high = LIKELY.get(name, (0.0, math.inf))
    if low <= abs(value) <= high or (table == "geometry" and beyond_likely(entry, term.number)):
        return None
    return f"{value:g} m", f"{low:g} to {high:g} m: look at the unit"


def _stated(tree: Any, path: tuple[str, ...]) -> Iterator[tuple[str, str, Toleranced | str]]:
    """Key, what it says and the number or reference, of all numbers in a table."""
    if tree is None or isinstance(tree, Of):
        return
    if isinstance(tree, Toleranced) or (isinstance(tree, str) and path[-1] in KINDS):
        yield ".".join(path), next(p for p in reversed(path) if p in KINDS), tree
    elif isinstance(tree, From):
        yield from _stated(tree.by, (*path, "by"))
    elif isinstance(tree, tuple):
        for k, entry in enumerate(tree):
            yield from _stated(entry, (*path, str(k)) if isinstance(entry, Toleranced) else path)
    elif hasattr(tree, "items"):
        for name, entry in tree.items():
            yield from _stated(entry, (*path, name))
    elif hasattr(type(tree), "model_fields"):
        for name in type(tree).model_fields:
            yield from _stated(getattr(tree, name), (*path, name))


def _hooks(rig: RigFile) -> Iterator[Found]:
    """A mass pulls one way: down, to a side or along the shaft, the last two over a pulley."""
    for name, hook in rig.hooks.items():
        if hook.pull is not None and hook.along is not None:
            yield f"hooks.{name}.along", f"{hook.along!r} beside a pull to the side", "one of both"
        if hook.pulley is not None and hook.pull is None and hook.along is None:
            yield (f"hooks.{name}.pulley", "one on a hook that pulls down",
                   "`pull`, the direction in which it pulls, or `along` the shaft; or no pulley")  # fmt: skip


def references_in(rig: RigFile) -> set[str]:
    """Identities of the numbers that the machine's tables, and what holds its shaft, refer to."""
    found = (stated for table in TABLES for _, _, stated in _stated(getattr(rig, table), (table,)))
    arms = {cell.arm for cell in rig.capabilities.load_cells.values() if cell.arm}
    return {text.removeprefix("-").strip() for text in found if isinstance(text, str)} | {*rig.spans} | arms


def _channels(rig: RigFile) -> Iterator[Found]:
    """They are there, in a unit of the kind, and each is one thing only."""
    taken: dict[str, str] = {}
    captured = {} if rig.capture is None else rig.capture.channels
    for key, channel, si in _named(rig):
        known = rig.channels.get(channel) or captured.get(channel)
        if known is None:
            yield key, channel, "a channel of this rig"
            continue
        if known.unit in units.UNITS and units.UNITS[known.unit].si != si:
            yield key, f"{channel} in {known.unit}", f"a channel in a unit of the kind of {si}"
        if channel in taken:
            yield key, channel, f"a channel of its own: it is that of {taken[channel]}"
        taken.setdefault(channel, key)


def _named(rig: RigFile) -> Iterator[Found]:
    """Key, channel and SI unit."""
    for b, bearing in rig.bearings.items():
        if bearing.voltage:
            yield f"bearings.{b}.voltage", bearing.voltage, "V"
        for a, axis in bearing.axes.items():
            yield from ((f"bearings.{b}.axes.{a}.coils", name, "A") for name in axis.coils)
            yield from ((f"bearings.{b}.axes.{a}.voltages", name, "V") for name in axis.voltages)
    yield from ((f"probes.{p}.channel", probe.channel, "m") for p, probe in rig.probes.items())
    for m, motor in rig.motors.items():
        yield from ((f"motors.{m}.currents", name, "A") for name in motor.currents)
        yield from (
            (f"motors.{m}.asked.{key}", name, "1" if key == "share" else "A") for key, name in motor.asked.items()
        )
    for e, encoder in rig.encoders.items():
        yield f"encoders.{e}.channel", encoder.channel, "rad" if encoder.measures == "angle" else "m"
    if rig.mark is not None:
        for name, si in (("angle", "rad"), ("speed", "rad/s"), ("pulses", "1"), ("edge", "s")):
            if channel := getattr(rig.mark, name):
                yield f"mark.{name}", channel, si


def _axes(rig: RigFile) -> Iterator[Found]:
    for b, bearing in rig.bearings.items():
        if bearing.kind == "radial" and bearing.at is None:
            yield f"bearings.{b}.at", "nothing", "where it is along the shaft"
        for a, axis in bearing.axes.items():
            key = f"bearings.{b}.axes.{a}.direction"
            if bearing.kind == "radial" and axis.direction is None:
                yield key, "nothing", "the angle around the shaft at which it pulls (docs/reference/angles.md)"
            if bearing.kind == "axial" and axis.direction is not None:
                yield key, "a direction", "none: an axial bearing pulls along the shaft"
    for p, probe in rig.probes.items():
        if probe.direction is not None and probe.at is None:
            yield f"probes.{p}.at", "nothing", "where it is along the shaft"
    needs = [name for name in ("bearings", "probes", "balancing", "hooks") if getattr(rig, name)]
    if needs and rig.shaft is None:
        yield "shaft", "nothing", f'[shaft] with far_end = "NAME": {needs[0]} are placed along it'


def _motors(rig: RigFile) -> Iterator[Found]:
    """Each segment has every component of its current."""
    for m, motor in rig.motors.items():
        parts = ", ".join(motor.components)
        if len(set(motor.components)) < len(motor.components):
            yield f"motors.{m}.components", parts, "each once"
        elif len(motor.currents) % len(motor.components):
            yield f"motors.{m}.currents", f"{len(motor.currents)} of {parts}", "as many of each component"


def _certificates(rig: RigFile) -> Iterator[Found]:
    for identity, number in certified_numbers(rig).items():
        if number.certificate and number.certificate not in rig.certificates:
            known = ", ".join(rig.certificates) or "(none)"
            yield f"{identity.replace('/', '.')}.certificate", number.certificate, f"one of [certificates]: {known}"
    for name, c in rig.certificates.items():
        for key, text in (("date", c.date), ("due", c.due)):
            if text and _day(text) is None:
                yield f"certificates.{name}.{key}", text, "a day, as 2026-11-23"
        day, due = _day(c.date), _day(c.due)
        if day and due and due < day:
            yield f"certificates.{name}.due", c.due, f"no day before its date, {c.date}"


def _aliases(rig: RigFile) -> Iterator[Found]:
    """Names of quantities at places: of places that there are, each place's once."""
    known, meant = places_named(rig), dict[str, str]()
    for name, full in rig.aliases.items():
        place = full.partition("@")[2]
        if place not in known:
            close = difflib.get_close_matches(place, known, 3)
            yield (
                f"aliases.{name}",
                full,
                f"KIND@PLACE with a place of the rig, such as {' or '.join(close or known[:3])}",
            )
        if full in meant:
            yield f"aliases.{name}", full, f"one name of it; {meant[full]} is another"
        meant[full] = name


def _day(text: str) -> date | None:
    try:
        return date.fromisoformat(text)
    except ValueError:
        return None
