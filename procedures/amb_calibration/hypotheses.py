"""Loads that contradict each other: how much, and which one mistake would make them agree.

At each axis F_0, K and K2 take three of the means over the loads; the others show by how much the stated masses contradict
each other. An error of all masses that goes with the load or with its square is not among that: K or K2 takes it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from procedures.amb_calibration import fit
from procedures.amb_calibration.fit import Fit, Hangings
from procedures.amb_calibration.scatter import Scatter, residual_maker, scatter

Array = npt.NDArray[np.float64]
CHANCE = 5e-4  # of a sound set and hangings: below it the loads contradict each other
MISTAKE = 3e-3  # of each mass: more is no scatter of a set but a mistake, of which no distribution is known
DOUBT = 0.05  # of the same: below it each mass is taken for less sure than its certificate says


@dataclass(frozen=True)
class Contradiction:
    """`seen` (n,) N, the n ways in which the loads can contradict each other, their `covariance` (n, n) by certificates and
    scatter, and their `effect` (n, L) N per kg of each load of `kg` (L,), nothing (the hanger) first; `dof` of the scatter;
    `axes`, K."""

    seen: Array
    covariance: Array
    effect: Array
    kg: Array
    dof: int
    axes: int = 2

    @property
    def total(self) -> float:
        """Chi-squared of the whole."""
        return float(self.seen @ np.linalg.solve(self.covariance, self.seen))

    @property
    def probability(self) -> float:
        """Of as much by chance: of the whole, or of what wrong masses can make, whichever is less."""
        from scipy import special

        pulls, _ = self.of_masses()
        return min(
            self.chance(self.total), float(special.fdtrc(len(pulls), self.dof, float(pulls @ pulls) / len(pulls)))
        )

    def of_masses(self) -> tuple[Array, Array]:
        """What wrong masses can make of it, (n/K,), each in its standard deviation: all K axes see a load's error alike,
        so that the other ways say nothing of masses. And by how much a relative error of all masses spreads each."""
        root = np.linalg.cholesky(self.covariance)
        ways, spread, _ = np.linalg.svd(np.linalg.solve(root, self.effect * self.kg))
        count = len(self.seen) // self.axes
        return ways[:, :count].T @ np.linalg.solve(root, self.seen), spread[:count]

    def chance(self, chi2: float, fitted: int = 0) -> float:
        """Probability of as much by chance where `fitted` terms were adjusted; the scatter is known with `dof` (F test)."""
        from scipy import special

        parts = len(self.seen) - fitted
        return float(special.fdtrc(parts, self.dof, chi2 / parts))


@dataclass(frozen=True)
class Suspect:
    """A load that by itself would make the others agree: index (-1 nothing), the mass to add to it and its u, kg, and the
    `chance` of what remains. The u has in it what remains beyond certificates and scatter (Birge)."""

    load: int
    extra_kg: float
    u_kg: float
    misfit: float
    chance: float


def contradiction(f: Fit, h: Hangings, s: Scatter, p: Mapping[str, float], u_mass: Array) -> Contradiction:
    """What the means over the loads say of the masses.

    `p` as for `fit.fit`; `u_mass` (L,) kg, nothing (the hanger) first.
    """
    newton_per_kg = np.array(fit.shares(f.pull, p)) * p["gravity"]
    axes = range(len(f.terms))
    kg = np.array([0.0, *(p[f"mass_{k}"] for k in range(len(u_mass) - 1))])
    membership = np.eye(len(u_mass))[h.load.reshape(-1) + 1]
    averaging = (membership / membership.sum(axis=0)).T
    maps = [averaging @ residual_maker(f, b) for b in axes]  # (L, A P) each
    effect = np.concatenate([maps[b] @ membership * newton_per_kg[b] for b in axes])  # (K L, L): N per kg
    noise = np.block([[(maps[b] * s.covariance[b, c].reshape(-1)) @ maps[c].T for c in axes] for b in axes])
    covariance = effect @ np.diag(u_mass**2) @ effect.T + noise
    # F_0, K and K2 take three of the five means at each axis; what is left of those directions is not information.
    ways = np.linalg.eigh(covariance)[1][:, -len(axes) * (len(u_mass) - 3) :]
    return Contradiction(
        ways.T @ s.level_means.reshape(-1), ways.T @ covariance @ ways, ways.T @ effect, kg, s.dof, len(axes)
    )  # fmt: skip


def mistaken(c: Contradiction, beyond: float) -> bool:
    """Whether no value can be stated: an interval that holds whatever `beyond` (`scatter_of_set`) of such a size may be, with
    the two degrees of freedom that four masses leave, would be a tenth of K_o and more."""
    return c.probability <= CHANCE and beyond > MISTAKE


def suspects(c: Contradiction) -> list[Suspect]:
    """For each load what extra mass explains the contradiction best; most plausible first."""
    found = []
    weights = np.linalg.inv(c.covariance)
    for k in range(c.effect.shape[1]):
        information = float(c.effect[:, k] @ weights @ c.effect[:, k])
        extra = float(c.effect[:, k] @ weights @ c.seen) / information
        left = c.total - extra**2 * information
        birge = max(1.0, left / (len(c.seen) - 1)) ** 0.5
        # A load heavier than stated has a force assumed too small: its residual (assumed less fitted) is negative.
        found.append(Suspect(k - 1, -extra, birge * information**-0.5, left, c.chance(left, 1)))
    return sorted(found, key=lambda x: x.misfit)


def exchanged(
    h: Hangings, p: Mapping[str, float], bias_A: float, u_mass: Array
) -> tuple[int, int] | None:  # fmt: skip
    """Two masses which, each hung where the other was called for, would make the loads agree; None where no two would.

    Everything is fitted again for each pair: exchanged masses are wrong by as much as they weigh.
    """
    count = len(u_mass) - 1
    best, at = 0.0, None
    for a, b in combinations(range(count), 2):
        turned = {**p, f"mass_{a}": p[f"mass_{b}"], f"mass_{b}": p[f"mass_{a}"]}
        fitted = fit.fit(h, turned, bias_A, count)
        u = u_mass.copy()
        u[[a + 1, b + 1]] = u[[b + 1, a + 1]]
        c = contradiction(fitted, h, scatter(fitted, h, count), turned, u)
        if (chance := c.probability) > max(best, CHANCE):
            best, at = chance, (a, b)
    return at


def scatter_of_set(c: Contradiction) -> float:
    """Relative standard deviation of each hung mass, beside its certificate, that makes the contradiction an ordinary one
    (chi-squared equal to its degrees of freedom; Mandel and Paule, Anal. Chem. 42, 1194 (1970)). 0 where it is ordinary
    anyway: its probability by chance is `DOUBT` or more."""
    from scipy import special

    pulls, spread = c.of_masses()
    count = len(pulls)

    def excess(t: float) -> float:
        return float((pulls**2 / (1 + (t * spread) ** 2)).sum()) - count

    if excess(0.0) <= 0 or special.fdtrc(count, c.dof, float(pulls @ pulls) / count) >= DOUBT:
        return 0.0
    from scipy import optimize  # slow to import, and sound loads do not need it

    return float(optimize.brentq(excess, 0.0, float(np.abs(pulls).max() * np.sqrt(count) / spread.min())))
