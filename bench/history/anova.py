"""One-way analysis of variance: do groups differ by more than their members scatter? Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bench.figures import Array


@dataclass(frozen=True, slots=True)
class Anova:
    """Sums of squares and degrees of freedom between the groups and within them, in the values' unit squared."""

    between: float
    within: float
    dof_between: int
    dof_within: int

    @property
    def f(self) -> float:
        """F ratio of the mean squares; inf where nothing scatters within."""
        mean = self.within / self.dof_within
        return self.between / self.dof_between / mean if mean > 0 else math.inf

    @property
    def r_squared(self) -> float:
        """Share of the whole sum of squares that lies between the groups."""
        whole = self.between + self.within
        return self.between / whole if whole > 0 else 0.0

    @property
    def residual(self) -> float:
        """Standard deviation within the groups, pooled, with `dof_within` degrees of freedom."""
        return math.sqrt(self.within / self.dof_within)


def one_way(groups: Sequence[Array]) -> Anova:
    """Analysis of groups (n_k,) of values, taken about the mean of all first, as digits in common spoil sums of squares. NIST
    StRD, one-way analysis of variance, whose SiRstv and SmLs sets are the tests.

    Raises:
        ValueError: fewer than two groups, an empty one, or no more values than groups.
    """
    count = sum(g.size for g in groups)
    if len(groups) < 2 or any(g.size == 0 for g in groups) or count <= len(groups):
        raise ValueError(
            f"found {count} values in {len(groups)} groups; expected two groups or more, and more values than groups"
        )
    middle = math.fsum(float(x) for g in groups for x in g) / count
    near = [g - middle for g in groups]
    means = [math.fsum(g) / g.size for g in near]
    grand = math.fsum(float(x) for g in near for x in g) / count
    between = math.fsum(g.size * (m - grand) ** 2 for g, m in zip(near, means, strict=True))
    within = math.fsum(float(np.sum((g - m) ** 2)) for g, m in zip(near, means, strict=True))
    return Anova(between, within, len(groups) - 1, count - len(groups))
