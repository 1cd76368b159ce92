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
Inputs = Mapping[str, Estimate]
Shares = Mapping[str, tuple[float, Mapping[str, float]]]  # value and contributions by influence
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
    centre = f({name: e.value for name, e in inputs.items()})
    middle = _named(centre)
    influences = [i for i in merged((1.0, e) for e in inputs.values()) if i.u > 0]
    slopes: dict[str, dict[Influence, float]] = {name: {} for name in middle}
    bends: dict[str, float] = dict.fromkeys(middle, 0.0)
    traces: dict[str, float] = dict.fromkeys(middle, 0.0)
    shares = {name: (e.value, e.contributions) for name, e in inputs.items()}
    for influence in influences:
        up, down = (_named(f(_shifted(shares, influence, side))) for side in (1.0, -1.0))
        for name in middle:
            slopes[name][influence] = (up[name] - down[name]) / (2 * influence.u)
            second = up[name] - 2 * middle[name] + down[name]
            bends[name], traces[name] = max(bends[name], abs(second)), traces[name] + second
    between = _between(lambda z: _named(f(_moved(shares, z))), influences, middle, traces)
    out = {}
    for name, value in middle.items():
        linear = Estimate(value, "", slopes[name])
        bent = max(bends[name], between[name]) > NONLINEAR * linear.u or any(e.nonlinear for e in inputs.values())
        out[name] = Estimate(value, "", slopes[name], _sampler(f, inputs, name, influences)) if bent else linear
    return out if isinstance(centre, dict) else out[_ONE]


def _named(result: float | dict[str, float]) -> dict[str, float]:
    named = {k: float(v) for k, v in result.items()} if isinstance(result, dict) else {_ONE: float(result)}
    for name, value in named.items():
        if not math.isfinite(value):
            raise AnalysisError(f"the model gives {value} for {name or 'its output'}; expected a finite number")
    return named


def _shifted(shares: Shares, influence: Influence, side: float) -> dict[str, float]:
    return {name: value + side * share.get(influence.id, 0.0) for name, (value, share) in shares.items()}


def _moved(shares: Shares, by: Mapping[str, float]) -> dict[str, float]:
    """Inputs with influences, by id, moved by so many standard uncertainties."""
    return {key: v + sum(share.get(i, 0.0) * z for i, z in by.items()) for key, (v, share) in shares.items()}


def _between(
    model: Callable[[Mapping[str, float]], dict[str, float]],
    influences: Sequence[Influence],
    middle: Mapping[str, float],
    traces: Mapping[str, float],
) -> dict[str, float]:
    """How much each output bends between two influences: root of the sum of squares of the mixed second differences.

    Along a direction s of n signs the second difference is the trace plus the sum of s_i s_j H_ij, whose mean square over
    random signs is twice the sum of squares (Hutchinson, Commun. Stat. Simul. Comput. 19, 433 (1990)): 2 DIRECTIONS
    evaluations in place of n^2. The step is one standard uncertainty in all, to stay as near as one influence does.
    """
    n, squares = len(influences), dict.fromkeys(middle, 0.0)
    if n < 2:
        return squares
    step = 1 / math.sqrt(n)
    signs = np.random.default_rng(n).choice([-step, step], (DIRECTIONS, n))
    for row in signs:
        up, down = (model({i.id: float(side * s) for i, s in zip(influences, row, strict=True)}) for side in (1, -1))
        for name, value in middle.items():
            squares[name] += (n * (up[name] - 2 * value + down[name]) - traces[name]) ** 2 / (2 * DIRECTIONS)
    return {name: math.sqrt(square) for name, square in squares.items()}


def _sampler(
    f: Callable[[dict[str, float]], float] | Callable[[dict[str, float]], dict[str, float]],
    inputs: Inputs,
    name: str,
    influences: Sequence[Influence],
) -> Sampler:
    shares = {key: (e.value, e.contributions) for key, e in inputs.items()}

    def shifted(by: Mapping[str, float]) -> float:
        return _named(f(_moved(shares, by)))[name]

    def sampled(deviations: Deviations) -> Array:
        if max((len(v) for v in deviations.values()), default=1) > BATCH:  # for fewer the expansion asks as often
            curved = any(e.nonlinear for e in inputs.values())
            quick = None if curved else expanded(shifted, {i.id: i.u for i in influences}, deviations)
            if quick is None:
                raise ManyDraws
            return quick
        drawn = {key: e.sampled(deviations) for key, e in inputs.items()}
        count = max((len(v) for v in drawn.values()), default=1)
        full = {key: np.broadcast_to(v, (count,)) for key, v in drawn.items()}
        out = np.empty(count)
        for k in range(count):
            out[k] = _named(f({key: float(v[k]) for key, v in full.items()}))[name]
        return out

    return sampled
