"""Where a smooth curve over frequency is greatest, of any machine's truths."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def greatest(
    size: Callable[[Array], Array], low: float, high: float, *, points: int, fine: int, rounds: int
) -> tuple[float, float]:
    """Greatest value of `size` at frequencies (m,) between `low` and `high` Hz, and where: looked for at `points`
    frequencies, then in so many `rounds` at `fine` ones about the greatest so far."""
    hz = np.geomspace(low, high, points)
    for _ in range(rounds):
        k = int(size(hz).argmax())
        hz = np.linspace(hz[max(k - 2, 0)], hz[min(k + 2, hz.size - 1)], fine)
    found = size(hz)
    return float(found.max()), float(hz[found.argmax()])
