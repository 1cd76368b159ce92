"""What each influence alone moves of a result whose interval is by Monte Carlo: its contributions to the standard deviation of
the draws, in place of those of the linear model, which are no part of it where the model is not linear.

JCGM 101:2008 gives no budget of its own; annex B proposes the output's standard deviation with one input drawn and the others
held at their estimates. Such parts do not add up to u^2: at a kink or a minimum (a greatest distance about a centre) the one
that is held lends the other more, or less, than it has. Here the others are drawn too and averaged over: with f_i = E[Y | X_i],
the part u_i^2 = var f_i is the main effect of the decomposition of a variance (Sobol, Math. Comput. Simul. 55, 271 (2001);
Saltelli et al., Global Sensitivity Analysis, 2008, 4.5). For independent inputs the parts never exceed u^2; what they leave
moves with several influences at once and belongs to none. In a linear model u_i is |c_i| u(x_i), as in JCGM 100.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bench.uncertainty.estimate import Array, Influence

Group = Sequence[tuple[Influence, float]]
"""Influences with their linear sensitivities that are looked at as one: the roots of one covariance, or one influence."""
NUMBERS = 200_000  # draws times groups that are looked at: some hundredths of a second, shares to half a per cent
MOST, LEAST = 40, 20  # steps of a main effect, and draws in one
SURE = 4.0  # standard deviations beyond which a departure from the linear model is one
FEW = 2  # degrees of freedom at which a t distribution has no standard deviation, and fewer


def spread(influence: Influence) -> float:
    """Standard deviation of an influence as it is drawn: of a t distribution sqrt(nu/(nu - 2)) times its u (JCGM 101, 6.4.9.4).

    For two degrees of freedom or fewer there is none; then it is u."""
    return influence.u * drawn_over_u(influence.dof)


def drawn_over_u(dof: float) -> float:
    """Standard deviation of a t distribution of `dof` degrees of freedom over its scale; 1 where it has none."""
    return math.sqrt(dof / (dof - 2)) if FEW < dof < math.inf else 1.0


def straight(sensitivities: Mapping[Influence, float]) -> dict[str, float]:
    """Contributions by influence id of a linear model, as drawn."""
    return {i.id: abs(c) * spread(i) for i, c in sensitivities.items()}


@dataclass(frozen=True)
class _Effect:
    """The main effect of a group for each draw, (n,), and its variance."""

    values: Array
    variance: float


def main_effects(groups: Sequence[Group], deviations: Mapping[str, Array], drawn: Array, u: float) -> dict[str, float]:
    """Contributions by influence id, in the unit of `u`; the sum of their squares is at most u^2.

    Args:
        groups: every influence of the model once.
        deviations: their draws by id, (n,) or more each.
        drawn: the model's output for them, (n,).
        u: standard deviation of all draws.
    """
    groups = [g for g in groups if any(i.u > 0 for i, _ in g)]
    count = min(len(drawn), max(1, NUMBERS // max(len(groups), 1)))
    y = drawn[:count] - drawn[:count].mean()
    forms = [_form(g, deviations, count) for g in groups]
    linear = np.sum([f for f, moves in forms if moves], axis=0) if any(moves for _, moves in forms) else np.zeros(count)
    squares = float(linear @ linear)
    scale = float(linear @ y) / squares if squares > 0 else 0.0
    bent = y - scale * linear
    effects = [_effect(f, scale if moves else 0.0, bent) for f, moves in forms]
    rest = y - np.sum([e.values for e in effects], axis=0) if effects else y
    whole = math.fsum(e.variance for e in effects) + float(rest @ rest) / count
    out: dict[str, float] = {}
    for group, effect in zip(groups, effects, strict=True):
        share = effect.variance / whole if whole > 0 else 0.0
        out |= _shared_out(group, u * math.sqrt(share))
    return out


def _form(group: Group, deviations: Mapping[str, Array], count: int) -> tuple[Array, bool]:
    """The group as one variable, (n,) about zero: its linear form, or the plain sum where the model has no slope there."""
    moves = any(c != 0 for _, c in group)
    form = np.zeros(count)
    for influence, c in group:
        form += (c if moves else 1.0) * deviations[influence.id][:count]
    return form - form.mean(), moves


def _effect(form: Array, scale: float, bent: Array) -> _Effect:
    """What the output has of one variable: `scale` times it, and of what that leaves (`bent`) a slope of its own, if it is
    sure, and then the mean as a function of the variable."""
    along = float(form @ bent)
    if abs(along) > SURE * math.sqrt(float(form**2 @ bent**2)):
        own = along / float(form @ form)
        scale, bent = scale + own, bent - own * form
    order = np.argsort(form)
    values = scale * form
    values[order] += _steps(bent[order])
    return _Effect(values, float(values.var()))


def _steps(y: Array) -> Array:
    """The mean of y (n,) as a function of its place, as steps: a regression tree (Breiman et al., 1984), split where that
    takes most off the scatter, for as long as it takes SURE^2 of its variance. It finds a bend and a jump alike."""
    sums, squares = (np.concatenate([[0.0], np.cumsum(x)]) for x in (y, y**2))

    def split(start: int, end: int) -> tuple[float, int, int, int]:
        """Gain (negative: a heap gives the least first; 0 where it is none), where, and what is split."""
        at = np.arange(start + LEAST, end - LEAST)
        if not len(at):
            return 0.0, start, start, end
        left, total = sums[at] - sums[start], sums[end] - sums[start]
        gains = left**2 / (at - start) + (total - left) ** 2 / (end - at) - total**2 / (end - start)
        best = int(np.argmax(gains))
        within = (squares[end] - squares[start] - total**2 / (end - start) - gains[best]) / (end - start)
        return (-float(gains[best]) if gains[best] > SURE**2 * within else 0.0), int(at[best]), start, end

    leaves = [split(0, len(y))]
    while len(leaves) < MOST and leaves[0][0] < 0:
        _, at, start, end = heapq.heappop(leaves)
        heapq.heappush(leaves, split(start, at))
        heapq.heappush(leaves, split(at, end))
    out = np.zeros(len(y))
    for _, _, start, end in leaves if len(leaves) > 1 else ():
        out[start:end] = (sums[end] - sums[start]) / (end - start)
    return out


def _shared_out(group: Group, contribution: float) -> dict[str, float]:
    """A group's contribution by its members: as their squares are in the linear form."""
    moves = any(c != 0 for _, c in group)
    parts = [(abs(c) if moves else 1.0) * i.u for i, c in group]
    whole = math.hypot(*parts)
    return {i.id: contribution * p / whole if whole > 0 else 0.0 for (i, _), p in zip(group, parts, strict=True)}
