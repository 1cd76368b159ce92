"""Values by rotor angle with their scatter: what a calibration over angles hands on to later procedures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from bench.uncertainty import Estimate, Influence
from procedures.amb_calibration.pulls import SERVOMOTOR
from procedures.amb_calibration.scatter import carried, outputs

Array = npt.NDArray[np.float64]


def scatter_terms(
    identity: str, covariance: Array, dof: int, where: str = "", after: int = 0, keys: tuple[str, ...] = SERVOMOTOR.keys
) -> dict[str, Estimate]:
    """Type A estimates of value zero for each of the axes' `outputs` (K, K2 and Kw of each of `keys`) that carry `covariance`
    (3 K, 3 K) between them, through independent influences `<identity>/1`, `<identity>/2` ... with common degrees of freedom;
    `where` stands in their names. The first `after` of the identities are left to others.

    With a `covariance` (4 K, 4 K) each of `carried` has one, too. They need no influences of their own: of F_0, K, K2 and Kw of
    an axis three say the fourth, so that the roots hold all that F_0 scatters by.
    """
    names = outputs(keys)
    count = len(names)
    of_outputs = covariance[:count, :count]
    root = np.linalg.cholesky(of_outputs + 1e-15 * np.diag(np.diag(of_outputs)))
    of_carried = np.linalg.solve(root, covariance[:count, count:]).T
    parts = [
        Influence(id=f"{identity}/{after + k + 1}", name=f"scatter of the hangings{where} ({k + 1})", u=1.0, unit="1", kind="A",
                  distribution="normal", dof=float(dof), source="residuals of the fits")
        for k in range(len(root))
    ]  # fmt: skip
    out = {
        name: Estimate(0.0, "", {part: float(root[row, k]) for k, part in enumerate(parts[: row + 1])})
        for row, name in enumerate(names)
    }
    for name, row in zip(carried(keys), of_carried, strict=False):
        out[name] = Estimate(0.0, "", {part: float(x) for part, x in zip(parts, row, strict=True)})
    return out


def with_scatter(
    estimates: Mapping[str, Estimate], spread: Array, dof: int, keys: tuple[str, ...] = SERVOMOTOR.keys,
    identity: str = "scatter",
) -> dict[str, Estimate]:  # fmt: skip
    """Values by angle (`name@k`) with the scatter of their angle, means over a turn with the mean of all; others as they are.

    `spread` (A, 3 K, 3 K) is the covariance at each angle, in the order of `outputs`; (A, 4 K, 4 K) with that of `carried`. All
    of them are one estimate with `dof` degrees of freedom, pooled over the angles, and so have one identity with running
    numbers: no mean over angles has more.
    """
    turn, names = len(spread), outputs(keys)
    terms = [
        scatter_terms(f"{identity}/angles", spread[k], dof, f" at {360 * k / turn:.0f}°", len(names) * k, keys)
        for k in range(turn)
    ]
    out: dict[str, Estimate] = {}
    for name, estimate in estimates.items():
        quantity, at, angle = name.partition("@")
        if at:
            out[name] = estimate + terms[int(angle)][quantity]
        elif name in names:
            out[name] = sum((term[quantity] * (1 / turn) for term in terms), estimate)
        else:
            out[name] = estimate
        if quantity not in names:
            out[name] = replace(out[name], unit="N")
    return out
