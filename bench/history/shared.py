"""Which influences of two runs are one and the same thing, and the runs' results as estimates that share them.

The rule within one machine is that of `bench.calibration.adopted`: what stands in the rig file (a gain, a span, a mass) is the
same in every run, what a run invents (its scatter, its hysteresis) happened once, in that run, and what came with a calibration
has its own run's name in front. Between runs some of the former are not the same either: a number of a day (the air's
density), one that was certified anew, and all those of another machine but for a thing with one certificate that both went by.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from bench.calibration import of_a_day, of_the_rig
from bench.findings import SIMULATED_CONTROLLER
from bench.record.forms import influence_of, uncertainty_of
from bench.record.records import BudgetEntry, Measurement, Record
from bench.rundir import NAME
from bench.uncertainty import Estimate, Influence
from bench.uncertainty.estimate import Array, Deviations

SAME = 1e-9  # of a standard uncertainty: rounding of a quotient


@dataclass(frozen=True)
class Identities:
    """Of the influences of two runs: `standing` are those of the rig file that are the same thing in both; whether the runs
    were made on one machine."""

    standing: frozenset[str]
    one_machine: bool

    def of(self, influence: str, run_id: str) -> str:
        """An influence's identity beyond its run."""
        if influence in self.standing or NAME.fullmatch(influence.partition("/")[0]):
            return influence
        return f"{run_id}/{influence}"


def identities(a: Record, b: Record) -> Identities:
    """Of two runs, by what their records say, `in_units`."""
    ours, theirs = _entries(a), _entries(b)
    one_machine = same_machine(a, b)
    both = (i for i in ours.keys() & theirs.keys() if not of_a_day(i) and _stands(a, ours[i]) and _stands(b, theirs[i]))
    standing = frozenset(i for i in both if _alike(ours[i], theirs[i]) and _one_thing(i, a, b, one_machine))
    return Identities(standing, one_machine)


def same_machine(a: Record, b: Record) -> bool:
    """Whether two runs were made on one machine: by its serial number, without one by the rig's name. A virtual one is another
    with another seed, and never the real one."""
    if (a.seed, _served(a)) != (b.seed, _served(b)):
        return False
    one, other = ((r.uut.get("model"), r.uut.get("serial")) for r in (a, b))
    return one == other if one[1] and other[1] else a.rig == b.rig


def _served(record: Record) -> bool:
    return any(f.code == SIMULATED_CONTROLLER for f in record.findings)


def _entries(record: Record) -> dict[str, BudgetEntry]:
    return {e.influence: e for m in record.measurements for e in m.budget}


def _stands(record: Record, entry: BudgetEntry) -> bool:
    """Whether an influence stands in the rig file. Records of before schema 3 do not say it: by its name, and no Type A."""
    if record.setup is not None:
        return entry.influence in record.setup.certified
    return of_the_rig(entry.influence) and entry.type == "B"


def _alike(a: BudgetEntry, b: BudgetEntry) -> bool:
    same = a.distribution == b.distribution and a.dof == b.dof
    return same and math.isclose(uncertainty_of(a), uncertainty_of(b), rel_tol=SAME)


def _one_thing(influence: str, a: Record, b: Record, one_machine: bool) -> bool:
    """A number of one machine is the same thing for as long as it is stated alike; one of two machines where both go by one
    certificate. Of virtual machines each draws its own, whatever its certificates say."""
    if a.setup is None or b.setup is None:
        return one_machine
    one, other = a.setup.certified[influence], b.setup.certified[influence]
    if one_machine:
        return replace(one, certificate="") == replace(other, certificate="")
    virtual = a.seed is not None or b.seed is not None or _served(a) or _served(b)
    return bool(one.certificate) and one == other and not virtual


def linear(m: Measurement, run_id: str, of: Identities, known: dict[str, Influence]) -> Estimate:
    """A measured quantity of a record as an estimate, by its budget: its linear model.

    Args:
        known: influences by identity, to which it adds its own, so that one identity is one object for all.
    """
    assert m.value is not None
    sensitivities: dict[Influence, float] = {}
    for e in m.budget:
        u = uncertainty_of(e)
        if u * e.sensitivity == 0:
            continue
        key = of.of(e.influence, run_id)
        one = known.setdefault(key, replace(influence_of(e), id=key))
        sensitivities[one] = sensitivities.get(one, 0.0) + e.sensitivity * (u / one.u)
    return Estimate(m.value, m.unit, sensitivities)


def as_one(other: Estimate, one: Estimate, run_other: str, run_one: str) -> Estimate:
    """`other` with the bounds (Type B) that its run found for itself taken for those of the same name that `one` has: as if
    both had one cause. Which of them have is not known: a method on one machine may repeat an error, or make a new one."""
    ours = {i.id: i for i in one.sensitivities if i.kind == "B"}

    def rename(i: Influence) -> Influence:
        run, _, name = i.id.partition("/")
        mine = ours.get(f"{run_one}/{name}", i) if run == run_other and not of_a_day(name) else i
        return mine if mine.distribution == i.distribution and mine.u > 0 else i

    return renamed(other, rename)


def renamed(estimate: Estimate, rename: Callable[[Influence], Influence]) -> Estimate:
    """An estimate by other influences, its model included; one that is more uncertain than its own acts by as much less."""
    names = {i: rename(i) for i in estimate.sensitivities}
    scales = {i: i.u / name.u if name.u > 0 else 1.0 for i, name in names.items()}
    sensitivities: dict[Influence, float] = {}
    for i, c in estimate.sensitivities.items():
        sensitivities[names[i]] = sensitivities.get(names[i], 0.0) + c * scales[i]
    model = estimate.sampler
    if model is None:
        return Estimate(estimate.value, estimate.unit, sensitivities)

    def sampled(deviations: Deviations) -> Array:
        return model({i.id: deviations[name.id] * scales[i] for i, name in names.items()})

    return Estimate(estimate.value, estimate.unit, sensitivities, sampled)
