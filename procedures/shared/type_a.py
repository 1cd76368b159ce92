"""From a fit's covariance to influences: Type A estimates that carry the correlation between the outputs of one fit."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from bench.uncertainty import Estimate, Influence
from procedures.shared.leastsquares import Fit


def scatter(fit: Fit, gradients: Mapping[str, npt.ArrayLike], identity: str, name: str) -> dict[str, Estimate]:
    """Estimates of value zero, one per output, that carry the scatter of the fit's residuals to it.

    `gradients` are d output / d terms (p,), by output. As many independent influences as outputs, `scatter/<identity>/k`,
    because the first output needs one, the second two (Cholesky); only one is `scatter/<identity>`.
    """
    g = np.array([np.asarray(x, np.float64) for x in gradients.values()])
    covariance = g @ fit.covariance @ g.T
    u = np.sqrt(np.diag(covariance))
    scale = np.where(u > 0, u, 1.0)
    root = np.linalg.cholesky(covariance / np.outer(scale, scale) + 1e-12 * np.eye(len(u)))  # outputs differ in unit
    parts = [
        Influence(id=f"scatter/{identity}" + (f"/{k + 1}" if len(u) > 1 else ""), name=name, u=1.0, unit="1", kind="A",
                  distribution="normal", dof=float(max(fit.dof, 1)), source="residuals of the fit")
        for k in range(len(u))
    ]  # fmt: skip
    out = {}
    for row, key in enumerate(gradients):
        total = Estimate.exact(0.0)
        for k in range(row + 1):
            total = total + Estimate.of(0.0, parts[k]) * float(root[row, k] * u[row])
        out[key] = total
    return out
