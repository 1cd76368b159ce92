"""A probe's vectors over speed, with the lag of the passage taken off, and what noise makes of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from bench.analysis import transient
from bench.analysis.criticals import Critical, criticals
from bench.analysis.peaks import WINDOW, Smoother, noise, pooled_covariance
from bench.analysis.vectors import parts
from procedures.run_up.steps import Curve
from procedures.synchronous.estimates import Runout

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
DRAWS = 120
USUAL = 30  # of them say how far a curve of the known noise is off its models


@dataclass(frozen=True)
class Line:
    """The vectors over speed of the `k`-th probe, that of `axis`, less its runout."""

    found: Curve
    k: int
    axis: str
    gain: float
    runout: Runout

    def series(self) -> list[Complex]:
        """As measured, then with the lag taken off by one term and by two."""
        return self._settled(self._raw)

    def criticals(self, values: Complex) -> list[Critical]:
        """Of `values` (b,) m, the series with something taken off that has no noise."""
        return criticals(self.found.speed, values, self.spread, scatter=self.scatter)

    @cached_property
    def scatter(self) -> Complex:
        """Of the last of these, drawn (DRAWS, b): what takes the lag off adds to the noise, and makes neighbours alike.

        A block's own turns do not tell all of it: near a critical speed the noise rings on from turn to turn. Where blocks
        scatter more than their turns say, their scatter counts.
        """
        lines = self._smooth.at_lines(self._raw)
        off = noise(pooled_covariance(self._covariance), 0, DRAWS)
        off *= np.sqrt(np.maximum(self._smooth.excess(self._raw, lines + off[:USUAL]), 1.0))
        return np.asarray(self._settled(lines + off)[-1] - self._settled(lines)[-1])

    @cached_property
    def spread(self) -> Array:
        """Covariances (b, 2, 2) of that."""
        each = parts(self.scatter[..., None])
        return np.asarray(np.einsum("nbi,nbj->bij", each, each) / DRAWS)

    def dof(self, speed: float) -> float:
        """Of what the drawn noise says of a critical at `speed`: the model there takes a window of blocks, the covariance of
        each is the mean over a window of its own, and a block's is known by its batches (Welch-Satterthwaite); and it is found
        by so many draws."""
        away = np.abs(np.arange(self.found.speed.size) - int(np.argmin(np.abs(self.found.speed - speed))))
        weight = np.maximum(WINDOW - away, 0)
        known = float(weight.sum() ** 2 / (weight**2 / self.found.dof).sum())
        return 1 / (1 / known + 1 / (DRAWS - 1))

    def _settled(self, values: Complex) -> list[Complex]:
        c = self.found
        return transient.series(self._smooth, c.speed, values, c.acceleration, c.width)

    @cached_property
    def _raw(self) -> Complex:
        return np.asarray(self.found.values[self.k] / self.gain - self.runout.values[self.k], np.complex128)

    @cached_property
    def _smooth(self) -> Smoother:
        return transient.local(self.found.speed, self._raw, self._covariance)

    @property
    def _covariance(self) -> Array:
        return np.asarray(self.found.covariance[self.k] / self.gain**2)
