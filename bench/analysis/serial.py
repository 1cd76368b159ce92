"""By how much a mean scatters more than its batches say, since they follow each other: a resonance rings on from turn to turn.

A block's batches of one turn or more, less their mean and their trend, r = P e (P the projection), have the sums of products
q_l = sum over j of r_j conj(r_(j+l)). Of a series with covariances g_k at lags up to a few, E q_l = sum over k of
g_k tr(P S_l P T_k), with S_l the symmetric shift and T_k the sum of both shifts (T_0 = S_0 = 1): the mean and the trend take
much of short blocks, and this gives it back. The sum of the batches has the variance m g_0 + 2 sum of (m - k) g_k.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from bench.analysis.sampling import Array, Complex

LAGS = 2
LEAST = 6  # batches that tell anything about their likeness
AROUND = 9  # blocks whose products are taken together: of one alone they scatter too much
FLOOR = 0.5  # of the variance: what chance may take from it


def variances(moves: Complex) -> tuple[Array, Array]:
    """Of b blocks, c channels by how much m batches move each, (b, m, c), scaled as in `orders.Track`: variances (b, c) as if
    the batches were independent, and with their covariances."""
    m = moves.shape[1]
    lags = min(LAGS, m - LEAST + 1) if m >= LEAST else 0
    free = moves * np.sqrt((m - 2) / m)
    products = [np.real((free[:, : m - k] * free[:, k:].conj()).sum(axis=1)) for k in range(lags + 1)]
    g = np.einsum("kl,lbc->kbc", np.linalg.inv(_expected(m, lags)), np.array(products))
    counts = np.array([m, *(2 * (m - k) for k in range(1, lags + 1))], dtype=np.float64)
    return np.asarray((np.abs(moves) ** 2).sum(axis=1)), np.einsum("k,kbc->bc", counts, g)


def inflation(alone: Array, whole: Array) -> Array:
    """The ratio (b,) of `whole` to `alone` (b, c), of channels that see the same motion, over the blocks about each in their
    order."""
    from scipy.ndimage import uniform_filter1d

    above, below = (uniform_filter1d(v.sum(axis=1), min(AROUND, len(v)), mode="nearest") for v in (whole, alone))
    return np.asarray(np.maximum(above / np.maximum(below, 1e-300), FLOOR))


@cache
def _expected(m: int, lags: int) -> Array:
    """(lags + 1, lags + 1): E q_l of g_k = 1."""
    ramp = np.linspace(-1, 1, m)
    project = np.eye(m) - 1 / m - np.outer(ramp, ramp) / (ramp @ ramp)
    both = [np.eye(m), *(np.eye(m, k=k) + np.eye(m, k=-k) for k in range(1, lags + 1))]
    half = [both[0], *(b / 2 for b in both[1:])]
    return np.array([[np.trace(project @ s @ project @ t) for t in both] for s in half])
