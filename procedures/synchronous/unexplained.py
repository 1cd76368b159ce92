"""How much of the forces two unbalances may leave over on a sound machine: a fixed share, or what scatter and certificates
make of them where that is more (few samples a turn, a small unbalance)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.analysis.vectors import estimates
from bench.uncertainty import Estimate, propagate_stacked
from procedures.synchronous.dwells import Dwell
from procedures.synchronous.runout import Stand, Turning, left_over

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
UNEXPLAINED = 0.1  # share of the forces that two unbalances leave over: a channel is not what its name says
TIMES_U = 3.0  # of the share's own standard uncertainty: what a sound machine leaves over


def allowed(misfit: float, d: Dwell, inputs: Mapping[str, Estimate], runout: Sequence[Estimate]) -> float:
    """The share that is allowed beside a `misfit` of `d`, by what is known of the stand (`inputs` of `Stand.of`) and of the
    runout, parts re, im of the four probes (8,) m. A misfit below the fixed share needs no more."""
    return UNEXPLAINED if misfit <= UNEXPLAINED else max(UNEXPLAINED, TIMES_U * share_u(d, inputs, runout))


def share_u(d: Dwell, inputs: Mapping[str, Estimate], runout: Sequence[Estimate]) -> float:
    """Standard uncertainty of the share: the root of the sum of variances of the parts of what is left over,
    beside the size of the forces as it was found."""
    read = d.both()
    scatter = estimates(read.parts, read.covariance, f"scatter/{d.where}/1", "scatter of the dwell", "", read.dof)
    drawn = {f"read_{k}": e for k, e in enumerate(scatter)} | {f"runout_{k}": e for k, e in enumerate(runout)}

    def at(v: Mapping[str, Any]) -> tuple[Complex, Any]:
        vectors = np.stack([v[f"read_{k}"] for k in range(24)], axis=-1).view(complex)
        off = np.stack([v[f"runout_{k}"] for k in range(8)], axis=-1).view(complex)
        return left_over(Stand.of(v), Turning(d.speed, d.means, vectors), off)[1:]

    def model(v: dict[str, Array]) -> dict[str, Array]:
        return {str(k): x for k, x in enumerate(at(v)[0].view(float).T)}

    known = {**inputs, **drawn}
    _, whole = at({name: e.value for name, e in known.items()})
    return float(math.sqrt(sum(e.u**2 for e in propagate_stacked(model, known).values())) / whole)
