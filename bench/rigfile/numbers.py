"""Numbers of a rig file that others refer to: each has an identity, by which draws, budgets and calibrations know it.

The identity of a number is its `id`, else its place in the file: `geometry/amb_gap`, `sensors/i_yi_p/gain`,
`bearings/upper/gap`. Where a number is asked for, a text refers to one by its identity, "-" in front of it turns its sign.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field

from bench.rigfile.toleranced import Toleranced

Reference = Annotated[str, Field(pattern=r"^-?\s*[\w.-]+(/[\w.-]+)*$")]


@dataclass(frozen=True)
class Term:
    """A number by its `identity`, as often as it counts: 1.0 or -1.0."""

    identity: str
    number: Toleranced
    factor: float = 1.0

    def __neg__(self) -> Term:
        return Term(self.identity, self.number, -self.factor)


@dataclass(frozen=True)
class Sum:
    """Numbers that add up, and what is exact, SI."""

    terms: tuple[Term, ...] = ()
    exact: float = 0.0

    @property
    def value(self) -> float:
        """By the numbers' own values, SI."""
        return self.exact + sum(t.factor * t.number.value for t in self.terms)

    def __add__(self, other: Sum) -> Sum:
        """What cancels is no term: two places that count from a third are apart by their own numbers alone."""
        counts: dict[str, tuple[Toleranced, float]] = {}
        for t in (*self.terms, *other.terms):
            counts[t.identity] = (t.number, counts.get(t.identity, (t.number, 0.0))[1] + t.factor)
        left = tuple(Term(identity, number, n) for identity, (number, n) in counts.items() if n)
        return Sum(left, self.exact + other.exact)

    def __neg__(self) -> Sum:
        return Sum(tuple(-t for t in self.terms), -self.exact)

    def __sub__(self, other: Sum) -> Sum:
        return self + -other


def numbers_in(tree: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, Toleranced]]:
    """Every number below a table of the rig file, with its identity."""
    return ((number.id or place, number) for place, number in numbers_at(tree, path))


def numbers_at(tree: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, Toleranced]]:
    """Every number below a table of the rig file, with its place there."""
    if isinstance(tree, Toleranced):
        yield "/".join(path), tree
    elif isinstance(tree, Mapping):
        for name, branch in tree.items():
            yield from numbers_at(branch, (*path, str(name)))
    elif isinstance(tree, tuple):
        for k, branch in enumerate(tree):
            yield from numbers_at(branch, (*path, str(k)))
    elif hasattr(type(tree), "model_fields"):
        for name, field in type(tree).model_fields.items():
            yield from numbers_at(getattr(tree, name), (*path, field.alias or name))


def referred(text: str, known: Mapping[str, Toleranced]) -> Sum:
    """What a reference stands for.

    Raises:
        KeyError: no number has that identity.
    """
    identity = text.removeprefix("-").strip()
    return Sum((Term(identity, known[identity], -1.0 if text.startswith("-") else 1.0),))
