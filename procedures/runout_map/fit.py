"""The bare model: what turns with a shaft that is held by its readings, by its harmonics over a slow turn.

A plane stands at X = x + jy, its target reads X + R, magnets pull it by K (X + M). Slowly turned, K_B I + K (X + M) is
constant, and the loops hold the reading E = X + R near zero: what turns is

    K_B I = K (R - M - E)

so that R - M, of the target and of the magnets, comes from current and reading; neither of both alone does. What turns with
the shaft goes as exp(j s angle), s the sense in which the angle counts; what a gain that differs from x to y makes turns the
other way, too.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from procedures.shared.leastsquares import linear

Array = npt.NDArray[np.float64]
ORDERS = (1, 2, 3, 4)  # a turn; what is higher, such as offsets of coils' sensors, is not looked at


def vectors(angle: Array, x: Array, y: Array, sense: int, phase: int) -> tuple[complex, complex]:
    """Of readings (n,) over a turn: what goes with the shaft, pointing so at angle zero, and what goes the other way. `phase`:
    turns of the currents' phase a turn, at which offsets of their sensors are."""
    orders = np.array(sorted({*ORDERS, phase, 2 * phase}))
    turns = np.outer(angle, orders)
    basis = np.column_stack([np.ones_like(angle), np.cos(turns), np.sin(turns)])
    n = orders.size
    parts = []
    for values in (x, y):
        terms = linear(basis, values).terms
        parts.append(complex(terms[1], -terms[1 + n]))  # of Re(c exp(j angle))
    forward = (parts[0] + 1j * parts[1]) / 2
    backward = (parts[0].conjugate() + 1j * parts[1].conjugate()) / 2
    return (forward, backward) if sense > 0 else (backward, forward)
