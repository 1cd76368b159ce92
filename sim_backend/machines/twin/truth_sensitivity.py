"""The truth of a sensitivity test of a rig's twin at rest: its linear loop, tick by tick (`linear.matrix`), with the sample of
delay, the amplifiers and the filters.

What is injected into an axis adds to the reference that acts next: of the state's step x+ = A x + B e the reference that the
law gives is the row of A for it, so that S = after/inject = 1 + C (z - A)^-1 B.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from sim_backend.controller.controls import in_force
from sim_backend.machine import Truth
from sim_backend.machines.twin import linear
from sim_backend.machines.twin.layout import layout_of
from sim_backend.machines.twin.quantities import loop_of, offsets

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


AT_ONCE = 500  # frequencies


@dataclass(frozen=True)
class Closed:
    """A tick of the closed loop (n, n); which states are the references of the axes that are asked for, None of one that is no
    radial axis; s from tick to tick."""

    tick: Array
    references: tuple[int | None, ...]
    tick_s: float

    def sensitivity(self, hz: npt.ArrayLike) -> Complex:
        """S_jj at `hz` (m,) of the axes, (m, axes): NaN of one that is no radial axis, whose loop has no linear model."""
        at = np.atleast_1d(np.asarray(hz, np.float64))
        return np.concatenate([self._some(part) for part in np.array_split(at, -(-at.size // AT_ONCE))])

    def _some(self, hz: Array) -> Complex:
        z, many = np.exp(2j * np.pi * hz * self.tick_s), len(self.tick)
        chosen = [k or 0 for k in self.references]
        into = np.eye(many, dtype=complex)[:, chosen]
        x = np.linalg.solve(z[:, None, None] * np.eye(many) - self.tick, np.broadcast_to(into, (z.size, *into.shape)))
        out = 1 + np.einsum("jn,mnj->mj", self.tick[chosen], x)
        out[:, [k is None for k in self.references]] = np.nan
        return np.asarray(out)

    def peak(self, axis: int, low: float, high: float) -> tuple[float, float]:
        """Greatest abs(S_jj) between two frequencies in Hz, and where."""
        hz = np.geomspace(low, high, 1000)
        for _ in range(5):
            size = np.abs(self.sensitivity(hz)[:, axis])
            k = int(size.argmax())
            hz = np.linspace(hz[max(k - 2, 0)], hz[min(k + 2, hz.size - 1)], 100)
        size = np.abs(self.sensitivity(hz)[:, axis])
        return float(size.max()), float(hz[size.argmax()])


def loop(rig: RigFile, drawn: Truth, settings: Mapping[str, float], axes: Sequence[str]) -> Closed:
    """Of `axes` by name, under every parameter in `settings`."""
    p, radial = drawn.plant, [a.name for a in layout_of(rig).radial]
    used = in_force(rig, drawn.machine, settings)
    made = linear.matrix(p, loop_of(rig, p, used, offsets(p)))
    first = (
        2 * linear.free_motions(p).shape[1] + p.radial
    )  # motions and rates, currents, then the references that act next
    return Closed(made, tuple(first + radial.index(a) if a in radial else None for a in axes), p.tick)
