"""Synchronous vectors: least squares on cosine and sine of the measured angle, over blocks of whole turns.

A block is cut into batches of whole turns. In each, x = c + d t + sum over n of Re(X_n exp(j n theta)) with a constant of its
own and, from three turns on, a drift (of one turn it would be half a sine), so that what wanders slowly is not taken for
vibration. What scatters is told by the block itself: each batch's part of the normal equations says by how much it alone
moves the vectors. Long batches are nearly independent of each other, so that coloured noise and vibration that is not
synchronous are in the covariance (the sandwich of cluster-robust least squares; GUM 4.2.7). s/sqrt(n) would not hold them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.analysis.sampling import Array, Complex, Sampling, increasing, rows
from bench.analysis.tachometer import TURN, Tachometer
from bench.analysis.vectors import Vectors, complexes, parts
from bench.errors import AnalysisError

BATCHES = 16
IN_TURN = 2.5  # samples, on the average: a turn is told up to 0.4 of their rate
IN_SHORT = 4  # samples of a turn, on the average, in a batch of fewer than IN_BATCH
IN_BATCH = 10


@dataclass(frozen=True)
class Track:
    """Synchronous vectors of b blocks, c channels, k orders.

    `t` (b,) s and `speed` (b,) rad/s of each block, its `turns`; `orders` (k,); `values` (b, c, k); `moves` (b, m, c, k), by
    how much each of m batches moves them, so scaled that the covariance is the sum over the batches of the products, with
    `dof` degrees of freedom; `means` (b, c) of the data.
    """

    t: Array
    speed: Array
    turns: int
    orders: tuple[float, ...]
    values: Complex
    moves: Complex
    dof: float
    means: Array

    def vectors(self, block: int, channels: Sequence[int] = (0,), order: float = 1.0) -> Vectors:
        """Of some channels in one block, with their joint covariance."""
        k = self._order(order)
        moved = parts(self.moves[block][:, list(channels), k])
        return Vectors(self.values[block, list(channels), k], moved.T @ moved, self.dof)

    def curve(self, channel: int = 0, order: float = 1.0) -> tuple[Complex, Array]:
        """Of one channel over the blocks: values (b,), covariances (b, 2, 2)."""
        k = self._order(order)
        moved = parts(self.moves[:, :, channel, k][..., None])
        return self.values[:, channel, k], np.einsum("bmi,bmj->bij", moved, moved)

    def _order(self, order: float) -> int:
        if order not in self.orders:
            raise AnalysisError(f"order {order} was not tracked, only {self.orders}")
        return self.orders.index(order)


def synchronous(
    t: npt.ArrayLike,
    x: npt.ArrayLike,
    tacho: Tachometer,
    sampling: Sampling,
    *,
    orders: Sequence[float] = (1.0, 2.0),
    turns: int | None = None,
    batches: int = BATCHES,
) -> Track:
    """Vectors of `x` (c, n) at times `t` (n,) s, block by block of `turns` turns; by default one block of all whole turns.

    A mean of readings is put right: its angle is the one at the middle of the readings, its amplitude is divided by what the
    mean leaves of it at the block's speed. A trend over a block (run-up) is taken out of the scatter.

    Raises:
        AnalysisError: fewer than one block of turns, four batches or four samples per turn within the record.
    """
    at, data = increasing(t, "synchronous vectors"), rows(x, np.size(t))
    angle = tacho.angle(at - sampling.late)
    cuts, batches = _cuts(angle, turns, batches)
    gram, right = _cells(_design(angle, at, orders), data, cuts)
    drifts = 2 if _length(angle, turns) >= 3 * batches else 1
    values, moves = _solved(*_without(gram, right, drifts))
    means = right[:, :, 0].sum(axis=1) / gram[:, :, 0, 0].sum(axis=1)[:, None]
    edge = tacho.time(TURN * _whole(angle, turns))
    speed = TURN * _length(angle, turns) / np.diff(edge)
    left = sampling.gain(np.outer(speed, orders))
    if (np.abs(left) < 0.3).any():
        raise AnalysisError(
            "synchronous vectors: the mean of readings leaves under 0.3 of the amplitude; record faster"
        )
    return Track(
        (edge[1:] + edge[:-1]) / 2,
        speed,
        _length(angle, turns),
        tuple(float(n) for n in orders),
        values / left[:, None, :],
        moves / left[:, None, None, :],
        float(batches - 2),
        means,
    )


def _span(angle: Array) -> tuple[int, int]:
    """First and last whole turn within the record."""
    inside = angle[np.isfinite(angle)] / TURN
    if inside.size < 2:
        raise AnalysisError("synchronous vectors: the record has no time between pulses")
    return math.ceil(inside[0] - 1e-9), math.floor(inside[-1] + 1e-9)


def _length(angle: Array, turns: int | None) -> int:
    first, last = _span(angle)
    return turns or last - first


def _whole(angle: Array, turns: int | None) -> Array:
    """Turn numbers of the blocks' edges, (b + 1,)."""
    first, last = _span(angle)
    length = turns or last - first
    blocks = (last - first) // length if length > 0 else 0
    if blocks < 1 or length < 4:
        raise AnalysisError(f"synchronous vectors: found {last - first} whole turns; expected {max(length, 4)} or more")
    return first + length * np.arange(blocks + 1, dtype=np.float64)


def _cuts(angle: Array, turns: int | None, batches: int) -> tuple[npt.NDArray[np.intp], int]:
    """Sample indices (b, m + 1) of the batches' edges in each block, and m."""
    edges = _whole(angle, turns)
    length = int(edges[1] - edges[0])
    m = min(batches, length)
    inner = np.floor(np.linspace(0, length, m + 1))
    valid = np.flatnonzero(np.isfinite(angle))
    low, high = valid[0], valid[-1] + 1
    cuts = low + np.searchsorted(angle[low:high], TURN * (edges[:-1, None] + inner))
    samples, turned = np.diff(cuts, axis=1), np.diff(inner)
    if (samples < np.maximum(IN_TURN * turned, np.minimum(IN_SHORT * turned, IN_BATCH))).any():
        found = f"fewer than {IN_TURN:g} samples in a turn, or too few turns"
        raise AnalysisError(f"synchronous vectors: {found}; record faster, or longer")
    return cuts, m


def _design(angle: Array, t: Array, orders: Sequence[float]) -> Array:
    """(n, 2 + 2 k): 1, time, then cos and -sin of each order."""
    out = np.empty((angle.size, 2 + 2 * len(orders)))
    out[:, 0], out[:, 1] = 1.0, t - t[0]
    for k, order in enumerate(orders):
        np.cos(order * angle, out=out[:, 2 + 2 * k])
        np.sin(-order * angle, out=out[:, 3 + 2 * k])
    return out


def _cells(design: Array, data: Array, cuts: npt.NDArray[np.intp]) -> tuple[Array, Array]:
    """Normal equations batch by batch: (b, m, p, p) and (b, m, p, c)."""
    b, m, p = cuts.shape[0], cuts.shape[1] - 1, design.shape[1]
    gram, right = np.empty((b, m, p, p)), np.empty((b, m, p, len(data)))
    for i in range(b):
        for j in range(m):
            part = design[cuts[i, j] : cuts[i, j + 1]]
            gram[i, j] = part.T @ part
            right[i, j] = (data[:, cuts[i, j] : cuts[i, j + 1]] @ part).T
    return gram, right


def _without(gram: Array, right: Array, drifts: int) -> tuple[Array, Array]:
    """The batches' normal equations of the orders alone, constant and drift eliminated in each (Frisch and Waugh)."""
    own = gram[..., 2:, :drifts]
    back = np.linalg.solve(gram[..., :drifts, :drifts], np.swapaxes(own, -1, -2))
    return gram[..., 2:, 2:] - own @ back, right[..., 2:, :] - np.swapaxes(back, -1, -2) @ right[..., :drifts, :]


def _solved(gram: Array, right: Array) -> tuple[Complex, Complex]:
    """Values (b, c, k), and the batches' moves (b, m, c, k) without a trend over the block."""
    m = gram.shape[1]
    total = gram.sum(axis=1)
    terms = np.linalg.solve(total, right.sum(axis=1))
    moves = np.linalg.solve(total[:, None], right - gram @ terms[:, None])
    ramp = np.linspace(-1, 1, m)
    slope = np.einsum("m,bmpc->bpc", ramp, moves) / (ramp @ ramp)
    moves -= ramp[None, :, None, None] * slope[:, None]
    moves *= math.sqrt(m / (m - 2))
    return complexes(np.swapaxes(terms, -1, -2)), complexes(np.swapaxes(moves, -1, -2))


@dataclass(frozen=True)
class SlowRoll:
    """Runout at a speed so low that nothing else moves the shaft: the vector, the speed in rad/s, when (ISO 8601)."""

    vectors: Vectors
    speed: float
    date: str


def compensated(vectors: Vectors, slow: SlowRoll) -> Vectors:
    """Vectors less the runout, each channel its own."""
    if slow.vectors.values.shape != vectors.values.shape:
        raise AnalysisError(
            f"slow roll: found {slow.vectors.values.shape} vectors; expected {vectors.values.shape}, channel by channel"
        )
    return vectors.minus(slow.vectors)
