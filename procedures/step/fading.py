"""What fades after a swing, as a fast integrator leaves it; and where a search for the swing beside it begins.

What a slow integrator takes away is a straight line while the shaft swings. A fast one, with a time constant of less than
FAST_S, is no line: it is then fitted beside the oscillations, with its time constant, over as long as it takes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from procedures.step.oscillation import FAST_HZ, FROM_S, HARD, SLOW_HZ, UNTIL_S, Array, One

FAST_S, SHORT_S = 0.2, 0.012  # time constants of an integrator that is no straight line
LASTS = 3.0  # times its time constant that it is fitted
LATEST_S = 1.0  # until which it is looked for
PLAIN, TOLD = 10.0, 5e-3  # over its standard uncertainty, and at the beginning as a share of the step, at least
ROWS, STATES = 12, 4  # of where the search begins: rows of a Hankel matrix, and its states


def fading_s(steps: Sequence[One]) -> float:
    """Time constant, s, of what fades after the swing, where it is shorter than FAST_S and plain beside the noise; 0 where it
    is not, and a straight line does."""
    t, y = _mean(steps, UNTIL_S, LATEST_S)
    if len(t) < 20:
        return 0.0
    constants = np.geomspace(SHORT_S, 10 * FAST_S, 80)
    fits = [np.linalg.lstsq(np.column_stack([np.ones_like(t), np.exp(-t / c)]), y[0], rcond=None) for c in constants]
    left = np.array(
        [float(((y[0] - f[0][0] - f[0][1] * np.exp(-t / c)) ** 2).sum()) for f, c in zip(fits, constants, strict=True)]
    )
    k = int(left.argmin())
    explained = float(((y[0] - y[0].mean()) ** 2).sum()) - left[k]
    plain = explained > PLAIN**2 * left[k] / (len(t) - 3) and abs(float(fits[k][0][1])) > TOLD
    return float(constants[k]) if plain and k > 0 and constants[k] < FAST_S else 0.0


def _mean(steps: Sequence[One], since: float, until: float) -> tuple[Array, Array]:
    """Times (n,) and mean of position and tilt (2, n) by their weights, as long as every step has samples."""
    near = [np.flatnonzero((s.t > since) & (s.t < until)) for s in steps]
    many = min(map(len, near))
    weights = np.array([s.weight**2 for s in steps])
    both = np.average([s.both[:, k[:many]] for s, k in zip(steps, near, strict=True)], axis=0, weights=weights)
    return np.average([s.t[k[:many]] for s, k in zip(steps, near, strict=True)], axis=0, weights=weights), both


def first_pole(steps: Sequence[One]) -> complex | None:
    """Where the search begins beside something that fades: of the mean response's realisation (Juang and Pappa, 1985) with a
    level, what fades and one oscillation. None where that has none."""
    t, both = _mean(steps, FROM_S, UNTIL_S)
    period = float(t[1] - t[0])
    y, columns = both, both.shape[1] - ROWS
    if columns < 2 * STATES:
        return None
    hankel = np.concatenate([y[:, k : k + columns] for k in range(ROWS)])
    u, size, v = np.linalg.svd(hankel[:, :-1], full_matrices=False)
    root = np.sqrt(size[:STATES])
    values = np.linalg.eigvals((u[:, :STATES].T @ hankel[:, 1:] @ v[:STATES].T) / np.outer(root, root))
    found = np.log(np.where(values == 0, 1e-9, values).astype(complex)) / period
    parts = np.linalg.lstsq(np.exp(np.outer(t - t[0], found)), y[0].astype(complex), rcond=None)[0]
    size = np.abs(found) / (2 * np.pi)
    swings = (found.imag > 0) & (size > SLOW_HZ) & (size < FAST_HZ) & (-found.real < HARD * np.abs(found))
    if not swings.any():
        return None
    return complex(found[np.argmax(np.where(swings, np.abs(parts), 0.0))])
