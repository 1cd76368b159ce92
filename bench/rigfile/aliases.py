"""A rig's own names of quantities at its places: `[aliases]` says that `K_i` is `K@inboard`.

A quantity is a kind (`K`), measured at a place (`where`) that the rig file names. A rig that has another word for one of them
says so; it then stands in records, calibrations and reports, and both are understood wherever a name is asked for.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TypeVar

T = TypeVar("T")
Aliases = Mapping[str, str]
SEPARATOR = ", "  # of the parts of a place


def renamed(aliases: Aliases, kind: str, where: str) -> tuple[str, str]:
    """What the rig calls a kind at a place, and what is left of the place: `K` at `inboard, 3` is `K_i` at `3`."""
    parts = where.split(SEPARATOR)
    for name, meant in aliases.items():
        of, _, place = meant.partition("@")
        asked = place.split(SEPARATOR)
        if of == kind and parts[: len(asked)] == asked:
            return name, SEPARATOR.join(parts[len(asked) :])
    return kind, where


def known_as(aliases: Aliases, key: str) -> str:
    """`quantity` or `quantity@where` by the rig's own names."""
    kind, _, where = key.partition("@")
    name, left = renamed(aliases, kind, where)
    return f"{name}@{left}" if left else name


def in_full(aliases: Aliases, key: str) -> str:
    """`quantity` or `quantity@where` by kind and place."""
    name, _, left = key.partition("@")
    kind, _, place = aliases.get(name, name).partition("@")
    where = SEPARATOR.join(filter(None, (place, left)))
    return f"{kind}@{where}" if where else kind


def names_of(aliases: Aliases, kind: str) -> Iterator[tuple[str, str]]:
    """Each name that the rig has for a kind, with its place."""
    for name, meant in aliases.items():
        of, _, place = meant.partition("@")
        if of == kind:
            yield name, place


def names_meant(aliases: Aliases, keys: Iterable[str]) -> tuple[str, ...]:
    """`name`, `name@place` or `@place` by the rig's own names; a kind alone is all that it is called."""
    out: list[str] = []
    for key in keys:
        of_kind = [name for name, _ in names_of(aliases, key)]
        out += of_kind or [key if key.startswith("@") else known_as(aliases, key)]
    return tuple(dict.fromkeys(out))


def by_names(aliases: Aliases, values: Mapping[str, T]) -> dict[str, T]:
    """Values by the rig's own names; what is said of a kind alone holds wherever nothing is said of the place."""
    out: dict[str, T] = {}
    for key, value in values.items():
        of_kind = [name for name, _ in names_of(aliases, key)]
        out |= {name: value for name in of_kind if name not in out}
        out |= {} if of_kind else {known_as(aliases, key): value}
    return out


def with_full_names(aliases: Aliases, values: Mapping[str, T]) -> dict[str, T]:
    """Values by the rig's own names, each by kind and place too."""
    return {**{in_full(aliases, name): value for name, value in values.items()}, **values}
