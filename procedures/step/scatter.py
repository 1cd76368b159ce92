"""What the repeats of a step scatter by: their own spread, fits with one left out, and fits to steps of several sizes."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bench.uncertainty import Estimate, Influence
from procedures.step.oscillation import Array, One, Swing
from procedures.step.steps import Case


@dataclass(frozen=True)
class Seen:
    """Values of a quantity by case with the variance of each mean and its dof; the deviation goes with size to the -`power`."""

    unit: str
    power: int
    values: dict[Case, float]
    variances: dict[Case, float]
    dof: dict[Case, int]


def repeated(unit: str, power: int, ones: Mapping[Case, Sequence[One]], of: Callable[[Case, One], float]) -> Seen:
    seen = Seen(unit, power, {}, {}, {})
    for case, o in ones.items():
        values = np.array([of(case, x) for x in o])
        within, dof = alike([x.begin for x in o], values)
        seen.values[case], seen.dof[case] = float(values.mean()), dof
        seen.variances[case] = within / dof / len(o) if dof else math.nan
    return seen


def jackknifed(
    unit: str,
    fits: Mapping[Case, Sequence[Swing]],
    ones: Mapping[Case, Sequence[One]],
    of: Callable[[Swing, Sequence[One]], float],
) -> Seen:
    """With one step after the other left out; those that begin at other set points differ where a bearing is not linear, so
    that each is held against those that begin where it does."""
    seen = Seen(unit, 1, {}, {}, {})
    for case, all_of in fits.items():
        if not all_of:
            continue
        o, n = ones[case], len(ones[case])
        value = of(all_of[0], o)
        left = np.array([of(s, [x for j, x in enumerate(o) if j != k]) for k, s in enumerate(all_of[1:])])
        if not np.isfinite([value, *left]).all():
            continue
        within, dof = alike([x.begin for x in o], left)
        if dof:
            seen.values[case], seen.dof[case] = value, dof
            seen.variances[case] = (n - 1) ** 2 / n * within / dof
    return seen


def alike(kinds: Sequence[Hashable], values: Array) -> tuple[float, int]:
    """Sum of squares of steps of the same kind about their means, and its degrees of freedom."""
    total, dof = 0.0, 0
    for kind in dict.fromkeys(kinds):  # in order: a set would add in another one in each process
        of = values[[k == kind for k in kinds]]
        total, dof = total + float(((of - of.mean()) ** 2).sum()), dof + len(of) - 1
    return total, dof


def pooled(name: str, case: Case, seen: Seen) -> Estimate:
    """A case's value. Noise is the same for all steps of a setting, an axis and a speed: their scatter is taken together, one
    estimate whose parts have one identity with running numbers."""
    alike = [c for c in seen.values if c.group == case.group]
    dof = float(sum(seen.dof[c] for c in alike))
    scaled = [seen.dof[c] * seen.variances[c] * (c.size / case.size) ** (2 * seen.power) for c in alike]
    u = math.sqrt(sum(scaled) / dof)
    influence = Influence(
        id=f"scatter/{name}/{case.group}/{alike.index(case) + 1}",
        name="scatter of the repeats",
        u=1.0,
        unit="1",
        kind="A",
        distribution="normal",
        dof=dof,
        source=f"repeats of {len(alike)} cases together",
    )
    return Estimate(seen.values[case], seen.unit, {influence: u})


def left_out(kinds: Sequence[Hashable], values: Array, shares: Array) -> float:
    """Variance of a fit to n steps, from the values (n,) that it has without each of them; scatter is told among steps of a
    kind. `shares` (n,) are what each has of the fit's squared weights, 1 in all: without one of share h the fit moves by
    h/(1 - h) of its residual, and h is its part. Kinds of one step tell nothing, and are taken for as good as the others."""
    total = told = 0.0
    for kind in dict.fromkeys(kinds):
        mine = np.array([k == kind for k in kinds])
        if (many := int(mine.sum())) > 1:
            parts = (values[mine] - values[mine].mean()) * (1 - shares[mine])
            total, told = total + many / (many - 1) * float((parts**2).sum()), told + float(shares[mine].sum())
    return total / told


def weighed(kinds: Sequence[tuple[Case, float]]) -> float:
    """Degrees of freedom of a scatter to which steps add as the square of their size (Welch-Satterthwaite)."""
    freedom = {kind: kinds.count(kind) - 1 for kind in dict.fromkeys(kinds)}
    parts = [(many, many * case.size**2) for (case, _), many in freedom.items() if many]
    return sum(part for _, part in parts) ** 2 / sum(part**2 / many for many, part in parts)
