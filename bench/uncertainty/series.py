"""The mean of a time series whose samples are not independent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError


@dataclass(frozen=True, slots=True)
class SeriesMean:
    """Mean, its standard uncertainty and degrees of freedom."""

    value: float
    u: float
    dof: float


def batch_means(series: npt.ArrayLike, batches: int = 16) -> SeriesMean:
    """Mean of an autocorrelated, stationary series (n,), with u from the scatter of the means of adjacent batches.

    s/sqrt(n) would be far too small: neighbouring samples repeat each other. Means of batches much longer than the
    correlation time are nearly independent (Law and Kelton, Simulation Modeling and Analysis, 9.5.3; GUM 4.2.7 asks
    for such a method). The samples left over by the division are the first ones; they count in the mean only.

    Raises:
        AnalysisError: fewer than two samples per batch or two batches, or a sample is not finite.
    """
    x = np.asarray(series, dtype=np.float64)
    if x.ndim != 1 or batches < 2 or x.size < 2 * batches:
        raise AnalysisError(f"batch means: found shape {x.shape}, {batches} batches; expected two samples per batch")
    if not np.isfinite(x).all():
        raise AnalysisError("batch means: found samples that are not finite; expected numbers only")
    length = x.size // batches
    means = x[x.size - length * batches :].reshape(batches, length).mean(axis=1)
    return SeriesMean(float(x.mean()), float(means.std(ddof=1) / np.sqrt(batches)), float(batches - 1))
