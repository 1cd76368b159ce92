"""Where the parts of a machine are: places along the shaft and directions around it, as sums of the rig file's numbers."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from bench.rigfile.elements import ORIGIN, From, MachineTables, Of
from bench.rigfile.numbers import Sum, Term, numbers_in, referred
from bench.rigfile.once import once_per_rig
from bench.rigfile.toleranced import Toleranced

CENTRE = "centre_of_mass"
WITHOUT_NUMBERS = (
    "simulation",
    "channels",
    "parameters",
    "devices",
    "links",
    "capture",
    "envelope",
    "capabilities",
    "plans",
    "calibration",
    "laboratory",
    "customer",
)
PLACED = ("bearings", "probes", "rings", "balancing", "hooks", "levers", "motors")
"""Tables of parts that have a place, if they have any, of their own."""


class PlaceError(ValueError):
    """A place or direction that cannot be told: `key` of the rig file, what was found there and what is expected."""

    def __init__(self, key: str, found: str, expected: str) -> None:
        super().__init__(f"{key}: found {found}; expected {expected}")
        self.key, self.found, self.expected = key, found, expected


@once_per_rig
def _numbers(tables: MachineTables) -> Mapping[str, Toleranced]:
    fields = type(tables).model_fields
    return dict(numbers_in({name: getattr(tables, name) for name in fields if name not in WITHOUT_NUMBERS}))


@dataclass(frozen=True)
class Places:
    """Of one rig file. Parts are known by table and name, as `bearings/upper`; an axis as `bearings/upper/u`."""

    tables: MachineTables

    @cached_property
    def known(self) -> Mapping[str, Toleranced]:
        """Every number by its identity, but what only the simulator draws from."""
        return _numbers(self.tables)

    @cached_property
    def _stated(self) -> dict[str, Any]:
        """What the file says of each part's place; None where a part has none."""
        shaft = self.tables.shaft
        out: dict[str, Any] = {CENTRE: shaft.centre_of_mass if shaft is not None else None}
        for table in PLACED:
            out |= {f"{table}/{name}": part.at for name, part in getattr(self.tables, table).items()}
        if self.tables.coupling is not None:
            out["coupling"] = self.tables.coupling.at
        return out

    @cached_property
    def _turned(self) -> dict[str, Any]:
        """What the file says of each direction around the shaft."""
        t = self.tables
        out: dict[str, Any] = {f"bearings/{b}/{a}": axis.direction
                               for b, bearing in t.bearings.items() for a, axis in bearing.axes.items()}  # fmt: skip
        out |= {f"probes/{name}": probe.direction for name, probe in t.probes.items()}
        out |= {f"hooks/{name}": hook.pull for name, hook in t.hooks.items()}
        out |= {f"motors/{name}": motor.direction for name, motor in t.motors.items()}
        if t.mark is not None:
            out["mark"] = t.mark.direction
        return out

    @property
    def parts(self) -> tuple[str, ...]:
        """All that has a place."""
        return tuple(name for name, stated in self._stated.items() if stated is not None)

    @property
    def _from(self) -> tuple[str, ...]:
        """All that a place may count from, each once."""
        return tuple(dict.fromkeys((ORIGIN, CENTRE, *self.parts)))

    @property
    def directed(self) -> tuple[str, ...]:
        """All that has a direction."""
        return tuple(name for name, stated in self._turned.items() if stated is not None)

    def place(self, part: str) -> Sum:
        """Along the shaft from the origin, m, positive towards the far end. The centre of mass is the origin where the file
        says nothing of its place.

        Raises:
            PlaceError: no such part, it has no place, or places that count from each other.
        """
        return self._place(part, ())

    def _place(self, part: str, through: tuple[str, ...]) -> Sum:
        if part == ORIGIN or (part == CENTRE and self._stated[CENTRE] is None):
            return Sum()
        if part in through:
            found = " from ".join((*through, part))
            raise PlaceError(f"{_key(through[0], 'at')}.from", found, "a place that does not count from itself")
        stated = self._stated.get(part)
        if stated is None:
            known = ", ".join(self._from)
            key = f"{_key(through[-1], 'at')}.from" if through else part
            raise PlaceError(key, part, f"a part with a place: one of {known}")
        key = _key(part, "at")
        if isinstance(stated, From):
            return self._place(stated.from_, (*through, part)) + self._sum(stated.by, f"{key}.by")
        return self._sum(stated, key)

    def end(self, k: int) -> Sum:
        """The near end (0) or the far one (1) of a shaft whose ends are stated.

        Raises:
            PlaceError: it cannot be told.
        """
        assert self.tables.shaft is not None
        assert self.tables.shaft.ends is not None
        stated = self.tables.shaft.ends[k]
        key = f"shaft.ends.{k}"
        if isinstance(stated, From):
            return self._place(stated.from_, ()) + self._sum(stated.by, f"{key}.by")
        return self._sum(stated, key)

    def distance(self, one: str, other: str) -> Sum:
        """From one part to another, m, positive towards the far end: as it was measured between them, else by their places.

        Raises:
            PlaceError: as for `place`.
        """
        for identity, pair in self.tables.spans.items():
            if set(pair) == {one, other}:
                if identity not in self.known:
                    raise PlaceError(
                        f"spans.{identity}", repr(identity), f"the identity of a number{_near(identity, self.known)}"
                    )
                span = Term(identity, self.known[identity])
                ahead = (self.place(other) - self.place(one)).value > 0
                return Sum((span if ahead else -span,))
        return self.place(other) - self.place(one)

    def direction(self, part: str) -> Sum:
        """Around the shaft, rad, counter-clockwise seen from outside the far end; from up, also where the file's 0 is another
        direction and it says which one is up.

        Raises:
            PlaceError: no such part, it has no direction, or directions that are told by each other.
        """
        shaft = self.tables.shaft
        from_zero = self._direction(part, ())
        return from_zero if shaft is None or shaft.up is None else from_zero - self._sum(shaft.up, "shaft.up")

    def _direction(self, part: str, through: tuple[str, ...]) -> Sum:
        if part in through:
            found = " of ".join((*through, part))
            raise PlaceError(f"{_key_of_direction(through[0])}.of", found, "a direction that is not told by itself")
        stated = self._turned.get(part)
        if stated is None:
            known = ", ".join(self.directed) or "(nothing has one)"
            key = f"{_key_of_direction(through[-1])}.of" if through else part
            raise PlaceError(key, part, f"what has a direction: one of {known}")
        if isinstance(stated, Of):
            return self._direction(stated.of, (*through, part)) + Sum(exact=math.radians(stated.plus_deg))
        return self._sum(stated, _key_of_direction(part))

    def number(self, stated: Toleranced | str, key: str) -> Term:
        """A number that the file states or refers to.

        Raises:
            PlaceError: no number has that identity.
        """
        return self._sum(stated, key).terms[0]

    def _sum(self, stated: Toleranced | str, key: str) -> Sum:
        if isinstance(stated, Toleranced):
            return Sum((Term(stated.id or key.replace(".", "/"), stated),))
        try:
            return referred(stated, self.known)
        except KeyError:
            identity = stated.removeprefix("-").strip()
            raise PlaceError(key, repr(identity), f"the identity of a number{_near(identity, self.known)}") from None

    def problems(self) -> Iterator[tuple[str, str, str]]:
        """Key, found and expected of all that cannot be told."""
        for part in self.parts:
            yield from _tried(self.place, part)
        for part in self.directed:
            yield from _tried(self.direction, part)
        for k in (0, 1) if self.tables.shaft is not None and self.tables.shaft.ends is not None else ():
            yield from _tried(self.end, k)
        for identity, pair in self.tables.spans.items():
            if identity not in self.known:
                yield f"spans.{identity}", identity, f"the identity of a number{_near(identity, self.known)}"
            for part in pair:
                if part not in self._from:
                    yield f"spans.{identity}", part, f"one of {', '.join(self._from)}"


def _key(part: str, entry: str) -> str:
    """Of a part's entry in the rig file."""
    return f"shaft.{CENTRE}" if part == CENTRE else f"{part.replace('/', '.')}.{entry}"


def _key_of_direction(part: str) -> str:
    table, *names = part.split("/")
    if table == "bearings":
        return f"bearings.{names[0]}.axes.{'.'.join(names[1:])}.direction"
    return ".".join((table, *names, "pull" if table == "hooks" else "direction"))


def _near(identity: str, known: Mapping[str, Toleranced]) -> str:
    close = difflib.get_close_matches(identity, known, 1)
    return f", such as {close[0]}" if close else ""


def _tried(look: Callable[[Any], Sum], part: Any) -> Iterator[tuple[str, str, str]]:
    try:
        look(part)
    except PlaceError as error:
        yield error.key, error.found, error.expected
