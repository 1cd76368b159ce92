"""Influence coefficients and unbalance with influences: trial weights, scatter, runout as the unbalance it is taken for.

At one speed the probes read X = A (U + U_R). Trial weights give A = (X_trial - X_before)/u, controller and bearings with it.
U_R is what the runout R of the slow roll is taken for (`runout.as_unbalance`), of the shaft's own masses alone. Weights sit
on scales that are told from one zero, whose angle from the once-per-turn mark nobody needs to know; the forces of the trial
weights tell it. A, U and u are from that zero, R and U_R are turned to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from procedures.balance.planes import Planes
from procedures.balance.steps import Run, Weight
from procedures.synchronous import runout
from procedures.synchronous.runout import Stand, Turning

Complex = npt.NDArray[np.complex128]
Trial = tuple[complex, Sequence[Turning], Sequence[Turning]]


@dataclass(frozen=True)
class Trials:
    """Base run, and by plane the runs before and with its trial weight and that weight; the `planes`."""

    base: Run
    before: tuple[Run, Run]
    having: tuple[Run, Run]
    weights: tuple[Weight, Weight]
    planes: Planes

    def unbalance(self, plane: int) -> complex:
        """Of a plane's trial weight, kg m from the mark."""
        p = self.planes[plane]
        return p.turned(self.weights[plane].unbalance(p.radius.value))


@dataclass(frozen=True)
class Solved:
    """By speed `influence` (s, 4, 2) m/(kg m), probes over their gain, and `taken` (s, 2) kg m, the unbalance on the scale that
    the runout is taken for; `placed` (2, 2), what the forces say at the highest speed of each trial weight (row) in each
    plane, over what it should be; `mark` rad, from the scale's zero to the mark; `runout` (4,) m from the mark."""

    influence: Complex
    placed: Complex
    mark: float
    runout: Complex
    taken: Complex

    @property
    def condition(self) -> float:
        """Of the influence coefficients, columns scaled to one."""
        a = self.influence.reshape(-1, 2)
        return float(np.linalg.cond(a / np.linalg.norm(a, axis=0)))

    def unbalance(self, readings: Complex) -> Complex:
        """Unbalance (2,) kg m on the scale, from readings (s, 4) m over gain."""
        a = self.influence.reshape(-1, 2)
        clean = readings - np.einsum("spq,sq->sp", self.influence, self.taken)
        return np.asarray(np.linalg.lstsq(a, clean.reshape(-1), rcond=None)[0])


def solve(s: Stand, slow: Turning | None, trials: Sequence[Trial], base: Sequence[Turning]) -> Solved:
    """Influence coefficients and what they need, of one set of numbers. `trials` by plane: weight kg m on the scale, readings
    by speed before it was fixed and with it. The
    mark's angle is that of the highest speed, where masses rule and not the bearings."""
    found = np.zeros(4, complex) if slow is None else runout.find_runout(s, {1.0: slow}, base[-1]).runout[1.0]
    count = len(base)
    influence, moved = np.zeros((count, 4, 2), complex), np.zeros((2, 2), complex)
    for p, (u, before, having) in enumerate(trials):
        for k, (a, b) in enumerate(zip(before, having, strict=True)):
            influence[k, :, p] = (b.vectors - a.vectors)[:4] / s.gain / u
            if k == count - 1:
                none = np.zeros(4, complex)
                moved[p] = (runout.unbalances(s, b, none)[0] - runout.unbalances(s, a, none)[0]) / u
    mark = float(np.angle(moved[0, 0] + moved[1, 1]))
    return Solved(influence, moved * np.exp(-1j * mark), mark, found, runout_as_unbalance(s, base, found, mark))


def runout_as_unbalance(s: Stand, base: Sequence[Turning], off: Complex, mark: float) -> Complex:
    """The unbalance by speed (s, 2) kg m on the scale that a runout `off` (4,) m is taken for."""
    back = np.exp(-1j * mark)
    out: Complex = np.array([runout.as_unbalance(s, t.means, off, t.speed) * back for t in base])
    return out
