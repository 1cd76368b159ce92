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

from procedures.balance.loop import beside_unbalance
from procedures.balance.planes import Planes
from procedures.balance.steps import Run, Weight
from procedures.synchronous import runout
from procedures.synchronous.runout import Number, Stand, Turning, times

Complex = npt.NDArray[np.complex128]
Trial = tuple[Number, Sequence[Turning], Sequence[Turning]]


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
    the runout is taken for, and what the probes read of it `beside` that (s, 4) m; `placed` (2, 2), what the forces say at the
    highest speed of each trial weight (row) in each plane, over what it should be; `mark` rad, from the scale's zero to the
    mark; `runout` (4,) m from the mark."""

    influence: Complex
    placed: Complex
    mark: Number
    runout: Complex
    taken: Complex
    beside: Complex

    @property
    def condition(self) -> float:
        """Of the influence coefficients, columns scaled to one."""
        a = self.influence.reshape(-1, 2)
        return float(np.linalg.cond(a / np.linalg.norm(a, axis=0)))

    def clean(self, readings: Complex) -> Complex:
        """What unbalance makes of readings (s, 4) m over gain."""
        return np.asarray(readings - self.beside - np.einsum("...spq,...sq->...sp", self.influence, self.taken))

    def unbalance(self, readings: Complex) -> Complex:
        """Unbalance (2,) kg m on the scale, from readings (s, 4) m over gain."""
        a = self.influence
        every = (*a.shape[:-3], -1)  # speed and probe
        return np.asarray(times(np.linalg.pinv(a.reshape(*every, 2)), self.clean(readings).reshape(every)))


def solve(s: Stand, slow: Turning | None, trials: Sequence[Trial], base: Sequence[Turning]) -> Solved:
    """Influence coefficients and what they need, of one set of numbers or of a stack. `trials` by plane: weight kg m on the
    scale, readings by speed before it was fixed and with it. The
    mark's angle is that of the highest speed, where masses rule and not the bearings."""
    none = np.zeros(4, complex)
    found = none if slow is None else runout.find_runout(s, {1.0: slow}, base[-1]).runout[1.0]
    influence, moved = [], []
    for weight, before, having in trials:
        u = np.asarray(weight)[..., None]
        changes = [(b.vectors - a.vectors)[:4] / s.gain / u for a, b in zip(before, having, strict=True)]
        influence.append(np.stack(changes, axis=-2))
        one, other = (runout.unbalances(s, of[-1], none)[0] for of in (before, having))
        moved.append((other - one) / u)
    by_weight: Complex = np.stack(moved, axis=-2)
    mark = np.angle(np.trace(by_weight, axis1=-2, axis2=-1))
    placed = by_weight * np.exp(-1j * mark)[..., None, None]
    a = np.stack(influence, axis=-1)
    taken, beside = runout_as_unbalance(s, base, found, mark), runout_beside(s, base, found, mark, a)
    return Solved(a, placed, mark, found, taken, beside)


def runout_as_unbalance(s: Stand, base: Sequence[Turning], off: Complex, mark: Number) -> Complex:
    """The unbalance by speed (s, 2) kg m on the scale that a runout `off` (4,) m is taken for."""
    back = np.exp(-1j * mark)[..., None]
    return np.stack([runout.as_unbalance(s, t.means, off, t.speed) * back for t in base], axis=-2)


def runout_beside(s: Stand, base: Sequence[Turning], off: Complex, mark: Number, influence: Complex) -> Complex:
    """What the probes read beside that by speed (s, 4) m, `influence` (s, 4, 2) m/(kg m) on the scale."""
    a = influence * np.exp(-1j * mark)[..., None, None, None]
    return np.stack([beside_unbalance(s, t, off, a[..., k, :, :]) for k, t in enumerate(base)], axis=-2)
