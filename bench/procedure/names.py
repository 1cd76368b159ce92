"""Quantities and findings by the names that a rig has of its own for kinds at its places."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from bench.findings import Finding
from bench.quantity import Measured, Quantity
from bench.rigfile.aliases import Aliases, names_meant, names_of, renamed

LETTERS = {"psi": "ψ", "theta": "θ"}  # places as a title has them


def quantities_on(aliases: Aliases, quantities: Iterable[Quantity]) -> tuple[Quantity, ...]:
    """Declared quantities, each of which the rig has names for by these."""
    return tuple({found.name: found for quantity in quantities for found in _called(aliases, quantity)}.values())


def _called(aliases: Aliases, quantity: Quantity) -> Iterator[Quantity]:
    named = [_at(quantity, name, place) for name, place in names_of(aliases, quantity.name)]
    yield from named or [quantity]


def _at(quantity: Quantity, name: str, place: str) -> Quantity:
    title = f"{quantity.title} {LETTERS.get(place, place)}" if quantity.title else ""
    return Quantity(name, quantity.unit, f"{place}: {quantity.about}", title)


def by_names_of(aliases: Aliases, item: Measured | Finding) -> Measured | Finding:
    """What a procedure yields, by the rig's names."""
    if isinstance(item, Finding):
        return replace(item, concerns=names_meant(aliases, item.concerns)) if item.concerns and aliases else item
    kind = item.quantity
    name, where = renamed(aliases, kind.name, item.where)
    if name == kind.name:
        return item
    place = item.where.removesuffix(where).removesuffix(", ")
    return Measured(_at(kind, name, place), item.estimate, where)
