"""Orbits where two probes of a plane do not look along y and z: by both of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from bench.analysis.vectors import Vectors
from bench.uncertainty import Estimate
from bench.uncertainty.estimate import merged
from procedures.amb_rotor.stations import Stations
from procedures.synchronous.runout import Stand

Array = npt.NDArray[np.float64]


def squaring(s: Stand, pair: tuple[int, int]) -> Array | None:
    """(2, 2) by which displacements along two probes become such along y and z; None where the probes look so."""
    return _squaring(s.probes[list(pair), :2])


def seen(s: Stations, channels: Sequence[str], readings: Array) -> Array:
    """Readings (2, n) of two probes along y and z; as they are where the probes look so."""
    across = _squaring(np.array([s.probes[c].row[:2] for c in channels]))
    return readings if across is None else across @ readings


def _squaring(ways: Array) -> Array | None:
    return None if np.allclose(ways, np.eye(2), atol=1e-9) else np.asarray(np.linalg.inv(ways), np.float64)


def squared(found: Sequence[Estimate], across: Array | None) -> list[Estimate]:
    """Of two probes, as many numbers of the one as of the other after it."""
    if across is None:
        return list(found)
    half = len(found) // 2
    pairs = [(found[k], found[k + half]) for k in range(half)]
    return [
        Estimate(float(row @ [e.value for e in pair]), "m", merged(list(zip(map(float, row), pair, strict=True))))
        for row in across
        for pair in pairs
    ]


def as_orbit(vectors: Vectors, pair: tuple[int, int], at: Sequence[Estimate], across: Array | None) -> Vectors:
    """Of the shaft's centre where two probes stand, along y and z."""
    if across is not None:
        values = np.array([at[2 * k].value + 1j * at[2 * k + 1].value for k in (0, 1)])
        return Vectors(values, covariance(at), vectors.dof)
    y, z = pair
    chosen = [2 * y, 2 * y + 1, 2 * z, 2 * z + 1]
    return Vectors(vectors.values[[y, z]], vectors.covariance[np.ix_(chosen, chosen)], vectors.dof)


def covariance(parts: Sequence[Estimate]) -> Array:
    """Joint covariance of estimates by their shared influences."""
    each = [e.contributions for e in parts]
    ids = sorted({i for some in each for i in some})
    rows = np.array([[some.get(i, 0.0) for i in ids] for some in each])
    return np.asarray(rows @ rows.T)
