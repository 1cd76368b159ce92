"""Estimates that are uncertain together."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from bench.uncertainty import Estimate, Influence

Array = npt.NDArray[np.float64]


def parts(covariance: Array, identity: str, name: str, kind: Literal["A", "B"], dof: float) -> list[Estimate]:
    """Estimates of zero with this covariance, by as many independent influences as terms."""
    u = np.sqrt(np.diag(covariance))
    scale = np.where(u > 0, u, 1.0)
    root = np.linalg.cholesky(covariance / np.outer(scale, scale) + 1e-10 * np.eye(len(u)))
    one = [Influence(f"{identity}/{k + 1}", name, 1.0, "1", kind, "normal", dof) for k in range(len(u))]
    return [Estimate(0.0, "", {one[k]: float(root[row, k] * u[row]) for k in range(row + 1)}) for row in range(len(u))]
