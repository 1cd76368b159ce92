"""Budgets of a record by the rig file's numbers: which entries are one of them, each in that number's own unit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from bench.calibration import stands
from bench.record.records import BudgetEntry, Record
from bench.record.setup import Certified
from bench.uncertainty import Influence
from bench.uncertainty.forms import form


def certified_in(record: Record) -> Mapping[str, Certified]:
    """Numbers of the rig file that the results rest on, by identity; none of a record of before schema 3."""
    return {} if record.setup is None else record.setup.certified


def influence_of(e: BudgetEntry) -> Influence:
    """The influence that an entry is of."""
    dof = math.inf if e.dof is None else e.dof
    return Influence(e.influence, e.name, uncertainty_of(e), e.unit, e.type, e.distribution, dof)  # type: ignore[arg-type]


def uncertainty_of(entry: BudgetEntry) -> float:
    """Of the influence, in its unit; records of before 2026-11-23 have only what it contributes."""
    if entry.standard_uncertainty is not None:
        return entry.standard_uncertainty
    return entry.contribution / abs(entry.sensitivity) if entry.sensitivity else 0.0


def is_number(e: BudgetEntry, certified: Mapping[str, Certified]) -> bool:
    """Whether an entry is one of the rig file's numbers, whole, that is the same in every run: the rule of adoption."""
    return e.influence in certified and stands(influence_of(e), certified)


def in_units(record: Record) -> Record:
    """A record whose budgets have each number of its rig file in the number's own unit: another version, or another procedure,
    may have had it as a share. Contributions stay, their signs but for a share of a negative number."""
    certified = certified_in(record)
    told = (replace(m, budget=tuple(_in_unit(e, certified) for e in m.budget)) for m in record.measurements)
    return replace(record, measurements=tuple(told)) if certified else record


def _in_unit(e: BudgetEntry, certified: Mapping[str, Certified]) -> BudgetEntry:
    number = certified.get(e.influence)
    factor = None if number is None else form(influence_of(e), number)
    if number is None or factor is None:
        return e
    u = number.standard_uncertainty
    return replace(e, sensitivity=e.sensitivity * factor, standard_uncertainty=u, unit=number.unit)
