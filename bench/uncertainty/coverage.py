"""Coverage intervals: effective degrees of freedom, coverage factor, and Monte Carlo where the GUM's do not hold."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Literal

import numpy as np

from bench.errors import AnalysisError
from bench.uncertainty.estimate import Array, Estimate, Influence
from bench.uncertainty.maineffects import FEW, Group, main_effects, straight
from bench.uncertainty.propagation import BATCH, ManyDraws
from bench.uncertainty.tails import Tails, tails_of_draws, tails_of_t

PROBABILITY = 0.95
DRAWS = 200_000
MOST_ASKED = 20_000  # draws for which a model itself is asked, in batches: some seconds for a fit
ENDS_KNOWN = 0.025  # of U: what its ends may be unsure by, 5 % of u: between one and two digits of u (JCGM 101, 7.9.2)
DOMINANT = 0.5  # share of the variance beyond which one non-normal component decides the shape
KEPT = 12  # drawn influences, 1.6 MB each
NO_U = "no standard deviation"
ONE_DRAW = 0.1  # of the sum of squares: of a normal's 200 000 draws the greatest carries 0.0001
MINOR = 0.01  # share of the variance under which a component's own shape does not show
_HALF_WIDTHS = {"rectangular": math.sqrt(3), "triangular": math.sqrt(6), "arcsine": math.sqrt(2)}  # of u, GUM 4.3


@dataclass(frozen=True, slots=True)
class Interval:
    """A 95 % coverage interval [low, high]; U is its half width and k is U/u. `why` says what chose the method.

    `u` is the standard uncertainty by the same method: of the linear model, or the standard deviation of the draws. It and k
    are None where the interval alone is stated: with two degrees of freedom or fewer, and where the distribution has no
    standard deviation. `tails` are the probabilities of an error beyond multiples of the half width
    (`bench.uncertainty.tails`). `contributions` are what influences, by id, have of `u`, where that is of the draws
    (`bench.uncertainty.maineffects`); empty where those of the linear model are.
    """

    low: float
    high: float
    k: float | None
    U: float
    dof: float
    method: Literal["gum", "monte-carlo"]
    why: str
    u: float | None
    tails: Tails
    contributions: Mapping[str, float] = field(default_factory=dict)


def welch_satterthwaite(estimate: Estimate) -> float:
    """Effective degrees of freedom (GUM eq. G.2b), truncated down to an integer (G.6.4); inf if all are exact.

    The formula is for variances that are estimated independently. Parts of one covariance (`ensemble`) are not: all of them
    scatter with the same residuals, and any sum of them has the degrees of freedom of that one estimate (Willink, Metrologia
    44, 340 (2007)).
    """
    u = estimate.u
    if u == 0:
        return math.inf
    shares: dict[tuple[str, float], list[float]] = {}
    for i, c in estimate.sensitivities.items():
        if not math.isinf(i.dof):
            # Ratios first: the fourth power of a small u would underflow.
            shares.setdefault((ensemble(i), i.dof), []).append((c * i.u / u) ** 2)
    inverse = math.fsum(math.fsum(some) ** 2 / dof for (_, dof), some in shares.items())
    if inverse == 0:
        return math.inf
    effective = 1 / inverse
    return max(1.0, float(math.floor(effective * (1 + 1e-12))))  # 1e-12: a sum of one dof is that dof


def ensemble(i: Influence) -> str:
    """Which estimate of a covariance an influence is a part of: the roots of a covariance are influences `<identity>/k` of
    Type A with u = 1, unit 1; else itself. A variance that is pooled over many cases is one such estimate."""
    stem, _, last = i.id.rpartition("/")
    return stem if stem and last.isdigit() and i.kind == "A" and i.unit == "1" and i.u == 1.0 else i.id


def coverage_factor(dof: float) -> float:
    """k = t_0.975(dof), for 95 % (GUM G.3.4)."""
    from scipy.special import ndtri, stdtrit

    tail = (1 + PROBABILITY) / 2
    return float(ndtri(tail)) if math.isinf(dof) else float(stdtrit(dof, tail))


def interval(estimate: Estimate, seed: int = 0) -> Interval:
    """The 95 % interval: value -+ k u, or probabilistically symmetric from Monte Carlo (JCGM 101, 7.7).

    Monte Carlo takes over where one non-normal component carries more than half of the variance (the central limit
    does not help, GUM G.2.2) or the model is not linear over the spread of its inputs (5.1.2 note). A model that has to be
    asked for each draw is asked in batches until the ends are known (JCGM 101, 7.9), MOST_ASKED times at most; `why` says so.

    Raises:
        AnalysisError: value or uncertainty is not finite, or the model fails for drawn inputs.
    """
    if not (math.isfinite(estimate.value) and math.isfinite(estimate.u)):
        raise AnalysisError(f"found {estimate.value} with u {estimate.u}; expected finite numbers")
    dof = welch_satterthwaite(estimate)
    reason = _against_gum(estimate)
    if not reason:
        k = coverage_factor(dof)
        wide = k * estimate.u
        u = estimate.u if dof > FEW else None
        why = "normal or many comparable components, linear model"
        return _stated(estimate.value - wide, estimate.value + wide, dof, "gum", why, u, tails_of_t(k, dof))
    deviations: dict[str, Array] = {}
    try:
        drawn = _sampled(estimate, seed, deviations)
    except ManyDraws:
        drawn, unsure = _in_batches(estimate, seed, deviations)
        reason += f"; the model was asked for {len(drawn)} draws, which leave {unsure:.1%} of U open at its ends"
    low, middle, high = (float(q) for q in np.quantile(drawn, [0.025, 0.5, 0.975]))
    if not (math.isfinite(low) and math.isfinite(high)):
        raise AnalysisError("the model does not give finite numbers over the spread of its inputs")
    u = None if _few(estimate) else _standard_deviation(drawn, middle)
    beyond = tails_of_draws(drawn, estimate.value, low, high)
    stated = _stated(low, high, dof, "monte-carlo", reason if u is not None else f"{reason}; {NO_U}", u, beyond)
    return stated if u is None else replace(stated, contributions=_contributions(estimate, deviations, drawn, u))


def _stated(
    low: float, high: float, dof: float, method: Literal["gum", "monte-carlo"], why: str, u: float | None, tails: Tails
) -> Interval:
    half = (high - low) / 2
    k = None if u is None else half / u if u > 0 else 0.0
    return Interval(low, high, k, half, dof, method, why, u, tails)


def _contributions(estimate: Estimate, deviations: Mapping[str, Array], drawn: Array, u: float) -> dict[str, float]:
    if not estimate.nonlinear:
        return straight(estimate.sensitivities)
    return main_effects([members for _, members in _ensembles(estimate)], deviations, drawn, u)


def _ensembles(estimate: Estimate) -> list[tuple[float, Group]]:
    """Influences with their sensitivities, those of one covariance together, each group with its degrees of freedom."""
    together: dict[tuple[str, float], list[tuple[Influence, float]]] = {}
    for influence, c in estimate.sensitivities.items():
        together.setdefault((ensemble(influence), influence.dof), []).append((influence, c))
    return [(dof, members) for (_, dof), members in together.items()]


def _few(estimate: Estimate) -> bool:
    """Whether something is drawn from a t distribution that has no standard deviation (JCGM 101, 6.4.9.4)."""
    return any(i.dof <= FEW and i.u > 0 and (c != 0 or estimate.nonlinear) for i, c in estimate.sensitivities.items())


def _standard_deviation(drawn: Array, middle: float) -> float | None:
    """Of the draws, whose median is `middle`; None where one of them alone carries a tenth of the sum of squares: so it is
    where the distribution has no standard deviation (a ratio whose denominator may be zero), and the next draws would give
    another number."""
    off = drawn - middle
    total = float(off @ off)
    if not math.isfinite(total) or float(np.abs(off).max()) ** 2 > ONE_DRAW * total:
        return None if total else 0.0
    return float(drawn.std(ddof=1))


def _sampled(estimate: Estimate, seed: int, deviations: dict[str, Array]) -> Array:
    """Draws of the output; of a model that is not linear, those of its influences into `deviations`.

    In a linear model what is normal, and what carries under a hundredth of the variance by
    itself, is drawn as one normal of their joint variance, and the roots of one covariance are drawn as one t: a few draws in
    place of some hundred. What the former leaves out of the fourth moment is under a hundredth of it, and moves the interval by
    less than the draws scatter."""
    if estimate.nonlinear:
        deviations.update({i.id: draw(i, seed, DRAWS) for i in estimate.sensitivities})
        return estimate.sampled(deviations)
    small, variance = MINOR * estimate.u**2, 0.0
    apart: dict[Influence, float] = {}
    for dof, members in _ensembles(estimate):
        own = math.fsum((c * i.u) ** 2 for i, c in members)
        if (math.isinf(dof) and members[0][0].distribution == "normal") or (own < small and dof > 4):
            variance += own if math.isinf(dof) else own * dof / (dof - 2)
        elif len(members) > 1:
            apart[members[0][0]] = math.sqrt(own)  # roots have u = 1
        else:
            apart[members[0][0]] = members[0][1]
    if variance > 0:
        apart[Influence("", "the others", math.sqrt(variance), estimate.unit, "B", "normal")] = 1.0
    return Estimate(estimate.value, estimate.unit, apart).sampled({i.id: draw(i, seed, DRAWS) for i in apart})


def _in_batches(estimate: Estimate, seed: int, deviations: dict[str, Array]) -> tuple[Array, float]:
    """Draws of a model that is asked for each of them (those of its influences into `deviations`), until twice the standard
    deviation of either end's mean over the batches is small beside U (JCGM 101, 7.9.4, for the ends alone: where there is no
    u it would never end), and that over U."""
    deviations.update({i.id: draw(i, seed, MOST_ASKED) for i in estimate.sensitivities})
    parts: list[Array] = []
    ends: list[Array] = []
    unsure = math.inf
    for start in range(0, MOST_ASKED, BATCH):
        parts.append(estimate.sampled({key: v[start : start + BATCH] for key, v in deviations.items()}))
        ends.append(np.quantile(parts[-1], [0.025, 0.975]))
        if len(parts) > 2:
            low, high = np.mean(ends, axis=0)
            apart = 2 * float(np.std(ends, axis=0, ddof=1).max()) / math.sqrt(len(ends))
            unsure = 2 * apart / float(high - low) if high > low else 0.0
            if unsure <= ENDS_KNOWN:
                break
    return np.concatenate(parts), unsure


def _against_gum(estimate: Estimate) -> str:
    if estimate.nonlinear:
        return "the model is not linear over the spread of its inputs"
    variance = estimate.u**2
    for influence, c in estimate.sensitivities.items():
        if influence.distribution != "normal" and (c * influence.u) ** 2 > DOMINANT * variance:
            return f"the {influence.distribution} component {influence.id} carries over half of the variance"
    return ""


@lru_cache(maxsize=KEPT)
def draw(influence: Influence, seed: int, count: int) -> Array:
    """Deviations drawn for one influence, (count,): the same for the same seed and id, whatever else is drawn. Kept,
    because the quantities of one run share most of their influences; not to be written to.

    A normal one with finite degrees of freedom is drawn from the scaled t distribution (JCGM 101, 6.4.9); those that are parts
    of one covariance (`ensemble`) from one multivariate t (JCGM 102, 5.3.2).
    """
    out = _drawn(influence, seed, count)
    out.setflags(write=False)
    return out


def _drawn(influence: Influence, seed: int, count: int) -> Array:
    rng = _generator(influence.id, seed)
    if influence.distribution == "normal":
        normal = influence.u * rng.standard_normal(count)
        return (
            normal if math.isinf(influence.dof) else normal * _spread(ensemble(influence), influence.dof, seed, count)
        )
    a = influence.u * _HALF_WIDTHS[influence.distribution]
    if influence.distribution == "rectangular":
        return rng.uniform(-a, a, count)
    if influence.distribution == "arcsine":
        return a * np.sin(rng.uniform(-math.pi, math.pi, count))
    return a * (rng.random(count) + rng.random(count) - 1)


@lru_cache(maxsize=KEPT // 2)
def _spread(identity: str, dof: float, seed: int, count: int) -> Array:
    """What turns normal draws into those of a t, (count,): sqrt(dof/chi-squared), the same for all parts of one covariance."""
    return np.sqrt(dof / _generator(f"chi-squared of {identity}", seed).chisquare(dof, count))


def _generator(identity: str, seed: int) -> np.random.Generator:
    digest = hashlib.sha256(identity.encode()).digest()
    return np.random.default_rng([seed, int.from_bytes(digest[:8], "little")])
