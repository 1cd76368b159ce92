"""What a balancing draws."""

from __future__ import annotations

from collections.abc import Iterator

from bench.figures import Figure
from procedures.estimators.balance_checks import Evaluated


def all_figures(found: Evaluated) -> Iterator[Figure]:
    """In the order of the report."""
    yield from ()
