"""Propagation through a model that is only known as a function."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import overload

import numpy as np

from bench.errors import AnalysisError
from bench.uncertainty.curvature import expanded
from bench.uncertainty.estimate import NONLINEAR, Array, Deviations, Estimate, Influence, Sampler, merged

DIRECTIONS = 4  # along which influences are moved together
BATCH = 2_000  # draws for which a model itself is asked at a time: 100/(1 - 0.95), JCGM 101, 7.9.4 b
STACK = 256  # sets of inputs that a stacked model is given at a time: some megabytes of small matrices
Inputs = Mapping[str, Estimate]
Stacked = Callable[[dict[str, Array]], Mapping[str, Array]]
"""A model of many sets of inputs at once: each input (n,) by name, and so each output."""
_ONE = ""  # name of the output of a model that returns one number


class ManyDraws(Exception):
    """A model whose expansion does not hold is to be asked for each of more than BATCH draws: ask for a batch at a time."""


@overload
def propagate(f: Callable[[dict[str, float]], float], inputs: Inputs) -> Estimate: ...
@overload
def propagate(f: Callable[[dict[str, float]], dict[str, float]], inputs: Inputs) -> dict[str, Estimate]: ...
def propagate(
    f: Callable[[dict[str, float]], float] | Callable[[dict[str, float]], dict[str, float]], inputs: Inputs
) -> Estimate | dict[str, Estimate]:
    """Estimates of the outputs of `f`, by central differences, one elementary influence at a time.

    The step is the influence's u, carried to every input that shares it (GUM 5.1.3 note 2). An output whose second
    difference exceeds a tenth of its combined u for any influence is `nonlinear` and keeps the model for Monte Carlo.
    So is one that bends as much between influences (a product of two values near zero). Units are left empty.
    Its `sampled` raises ManyDraws for more than BATCH draws where the expansion to second order does not hold.

    Raises:
        AnalysisError: an output is not finite, or one id stands for two different influences.
    """
    out = propagate_stacked(_one_by_one(f), inputs)
    return out[_ONE] if list(out) == [_ONE] else out


def propagate_stacked(f: Stacked, inputs: Inputs) -> dict[str, Estimate]:
    """As `propagate`, of a model that takes all the moved inputs at once, in stacks: where small matrices are most of a model,
    numpy solves hundreds of them in the time that it takes to be called for one.

    Raises:
        AnalysisError: as `propagate`.
    """
    influences = [i for i in merged((1.0, e) for e in inputs.values()) if i.u > 0]
    centre = np.array([e.value for e in inputs.values()])
    shares = _shares(inputs, influences)
    directions = _directions(len(influences)) @ shares
    points = np.concatenate([centre[None], centre + shares, centre - shares, centre + directions, centre - directions])
    asked = _asked(f, dict(zip(inputs, points.T, strict=True)))
    curved = any(e.nonlinear for e in inputs.values())
    out = {}
    for name, y in asked.items():
        slopes, bend = _differences(y, influences)
        linear = Estimate(float(y[0]), "", slopes)
        bent = curved or bend > NONLINEAR * linear.u
        out[name] = Estimate(float(y[0]), "", slopes, _sampler(f, inputs, name, influences)) if bent else linear
    return out


def _one_by_one(f: Callable[[dict[str, float]], float] | Callable[[dict[str, float]], dict[str, float]]) -> Stacked:
    """A model of single numbers as one of stacks."""

    def stacked(inputs: dict[str, Array]) -> dict[str, Array]:
        rows = zip(*(v.tolist() for v in inputs.values()), strict=True) if inputs else [()]
        found = [_named(f(dict(zip(inputs, row, strict=True)))) for row in rows]
        return {name: np.array([one[name] for one in found]) for name in found[0]}

    return stacked


def _named(result: float | dict[str, float]) -> dict[str, float]:
    return {k: float(v) for k, v in result.items()} if isinstance(result, dict) else {_ONE: float(result)}


def _asked(f: Stacked, inputs: dict[str, Array]) -> dict[str, Array]:
    """Outputs (n,) by name for inputs (n,), STACK at a time."""
    count = max((len(v) for v in inputs.values()), default=1)
    parts = [f({name: v[at : at + STACK] for name, v in inputs.items()}) for at in range(0, count, STACK)]
    out = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    for name, y in out.items():
        for value in y[~np.isfinite(y)]:
            raise AnalysisError(f"the model gives {value} for {name or 'its output'}; expected a finite number")
    return out


def _shares(inputs: Inputs, influences: Sequence[Influence]) -> Array:
    """(n, m): how far a standard uncertainty of each influence moves each input."""
    row = {influence.id: k for k, influence in enumerate(influences)}
    out = np.zeros((len(influences), len(inputs)))
    for column, e in enumerate(inputs.values()):
        for key, share in e.contributions.items():
            if key in row:
                out[row[key], column] = share
    return out


def _differences(y: Array, influences: Sequence[Influence]) -> tuple[dict[Influence, float], float]:
    """Slopes by influence, and how much an output bends: along one, or between two of them. `y` is the output where nothing is
    moved, each influence up, each down, and all of them along the `_directions` and back."""
    n = len(influences)
    middle, up, down = y[0], y[1 : n + 1], y[n + 1 : 2 * n + 1]
    there, back = y[2 * n + 1 :].reshape(2, -1)
    slopes = {i: float(a - b) / (2 * i.u) for i, a, b in zip(influences, up, down, strict=True)}
    second = up - 2 * middle + down
    between = _between(n, there - 2 * middle + back, float(second.sum()))
    return slopes, max(float(np.abs(second).max(initial=0.0)), between)


def _directions(n: int) -> Array:
    """Signs in which n influences are moved together, one standard uncertainty in all, to stay as near as one influence does;
    none where there are not two of them."""
    if n < 2:
        return np.zeros((0, n))
    step = 1 / math.sqrt(n)
    return np.asarray(np.random.default_rng(n).choice([-step, step], (DIRECTIONS, n)))


def _between(n: int, second: Array, trace: float) -> float:
    """How much an output bends between two influences: root of the sum of squares of the mixed second differences.

    Along a direction s of n signs the `second` difference is the trace plus the sum of s_i s_j H_ij, whose mean square over
    random signs is twice the sum of squares (Hutchinson, Commun. Stat. Simul. Comput. 19, 433 (1990)): 2 DIRECTIONS
    evaluations in place of n^2.
    """
    return math.sqrt(float(((n * second - trace) ** 2).sum()) / (2 * DIRECTIONS))


def _sampler(f: Stacked, inputs: Inputs, name: str, influences: Sequence[Influence]) -> Sampler:
    shares = {key: (e.value, e.contributions) for key, e in inputs.items()}

    def shifted(by: Mapping[str, float]) -> float:
        moved = {key: v + sum(share.get(i, 0.0) * z for i, z in by.items()) for key, (v, share) in shares.items()}
        return float(_asked(f, {key: np.array([v]) for key, v in moved.items()})[name][0])

    def sampled(deviations: Deviations) -> Array:
        if max((len(v) for v in deviations.values()), default=1) > BATCH:  # for fewer the expansion asks as often
            curved = any(e.nonlinear for e in inputs.values())
            quick = None if curved else expanded(shifted, {i.id: i.u for i in influences}, deviations)
            if quick is None:
                raise ManyDraws
            return quick
        drawn = {key: e.sampled(deviations) for key, e in inputs.items()}
        count = max((len(v) for v in drawn.values()), default=1)
        return _asked(f, {key: np.broadcast_to(v, (count,)) for key, v in drawn.items()})[name]

    return sampled
