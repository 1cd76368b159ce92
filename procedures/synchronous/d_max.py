"""D_max of what turns with a shaft (ISO 14839-2): the greatest distance from the clearance's centre over a turn."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from bench.uncertainty import Estimate, Influence
from bench.uncertainty.estimate import merged

Array = npt.NDArray[np.float64]
TURN = np.linspace(0, 2 * math.pi, 73)
PLACES = 12  # along each axis, of the mean over them
GRID = 61  # mean places along each axis between which D_max is interpolated


def farthest(means: Sequence[Estimate], parts: Mapping[float, Sequence[Estimate]], where: str) -> Estimate:
    """D_max of what turns with the shaft, about its mean place: the distance at the angle at which it is greatest, along the
    direction there (the maximum does not move at first order).

    A mean place that is only known to lie about the centre makes D_max greater, whichever way it lies: the value is the mean
    of D_max over where it may lie (JCGM 101, 7.6), and intervals are by Monte Carlo.
    """
    names = [*means, *(e for four in parts.values() for e in four)]
    fixed = [np.array([e.value]) for e in names]
    _, way = _farthest(fixed, list(parts))
    terms = [(float(w[0]), e) for w, e in zip(way, names, strict=True)]
    # the orbit is known so well that it enters linearly, and by so little that its influences may be one
    u = Estimate(0.0, "m", merged(terms[2:])).u
    straight = Estimate.of(0.0, Influence(f"orbit/{where}", "the orbit itself", u, "m", "B", "normal"))

    def sampler(deviations: Mapping[str, Array]) -> Array:
        placed = [e.sampled(deviations) for e in means]
        return _interpolated(placed, fixed[2:], list(parts)) + straight.sampled(deviations)

    return Estimate(_expected(means, fixed[2:], list(parts)), "m", merged([*terms[:2], (1.0, straight)]), sampler)


def _expected(means: Sequence[Estimate], orbit: Sequence[Array], orders: Sequence[float]) -> float:
    """Mean of D_max over mean places spread evenly, each axis by its u: its zero's certificate is nearly all of it."""
    even = math.sqrt(3) * ((np.arange(PLACES) + 0.5) * 2 / PLACES - 1)
    y, z = np.meshgrid(*(e.value + e.u * even for e in means), indexing="ij")
    return float(_farthest([y.ravel(), z.ravel(), *orbit], orders)[0].mean())


def _interpolated(placed: Sequence[Array], orbit: Sequence[Array], orders: Sequence[float]) -> Array:
    """D_max (s,) of an orbit about many mean places y, z (s,): between a grid's, to which it costs a hundredth."""
    edges = [np.linspace(x.min() - 1e-12, x.max() + 1e-12, GRID) for x in placed]
    y, z = np.meshgrid(*edges, indexing="ij")
    far = _farthest([y.ravel(), z.ravel(), *orbit], orders)[0].reshape(GRID, GRID)
    at = [(x - e[0]) / (e[1] - e[0]) for x, e in zip(placed, edges, strict=True)]
    i, j = (np.minimum(a.astype(np.intp), GRID - 2) for a in at)
    u, v = at[0] - i, at[1] - j
    low, high = far[i, j] * (1 - v) + far[i, j + 1] * v, far[i + 1, j] * (1 - v) + far[i + 1, j + 1] * v
    return np.asarray(low * (1 - u) + high * u)


def _farthest(values: Sequence[Array], orders: Sequence[float]) -> tuple[Array, list[Array]]:
    """Greatest distance (s,) of paths given by their mean y, z and re, im of y, z of each order, (s,) each; its slopes."""
    best, angle = np.zeros(len(values[0])), np.zeros(len(values[0]))

    def at(theta: Array | float) -> list[Array]:
        out = [values[0], values[1]]
        for j, n in enumerate(orders):
            c, s = np.cos(n * theta), np.sin(n * theta)
            out = [out[k] + values[2 + 4 * j + 2 * k] * c - values[3 + 4 * j + 2 * k] * s for k in range(2)]
        return out

    for theta in TURN:
        r = np.hypot(*at(float(theta)))
        angle = np.where(r > best, theta, angle)
        best = np.maximum(best, r)
    towards = [x / np.maximum(best, 1e-12) for x in at(angle)]
    slopes = list(towards)
    for n in orders:
        slopes += [f for k in range(2) for f in (towards[k] * np.cos(n * angle), -towards[k] * np.sin(n * angle))]
    return best, slopes
