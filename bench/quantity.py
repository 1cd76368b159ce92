"""Declared measurands, and what was measured of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bench.uncertainty import Estimate


@dataclass(frozen=True, slots=True)
class Quantity:
    """A declared measurand: its name in records and truth, its unit and its definition in one line; `title` is what a report
    calls it where the name is no word."""

    name: str
    unit: str
    about: str
    title: str = ""

    def measured(self, estimate: Estimate, where: str = "") -> Measured:
        """This quantity's value in this run."""
        return Measured(self, estimate, where)


@dataclass(frozen=True, slots=True)
class Measured:
    """A quantity with its estimate; `where` says at which place of the machine, when that is not the name."""

    quantity: Quantity
    estimate: Estimate
    where: str = ""
