"""Scatter of the dwells in an unbalance, through the linear part of the influence method.

With P = (A^H A)^-1 A^H over all speeds, U = P (X - A U_R): dU = P (dX - dA (U + U_R) - A dU_R). What scatter does to the
angle of the mark and to the residual of the fit is of second order and left out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from bench.analysis.vectors import estimates
from bench.uncertainty import Estimate, Influence
from procedures.balance.planes import Planes
from procedures.balance.solution import Solved, Trials, runout_as_unbalance
from procedures.balance.steps import Read, Run
from procedures.synchronous.runout import Stand, Turning, find_runout

Complex = npt.NDArray[np.complex128]
Terms = list[tuple[float, Estimate]]


def of_read(name: str, read: Read, count: int) -> list[Estimate]:
    """Parts of the first `count` vectors of a dwell (2 count,), with their joint covariance."""
    k, v = 2 * count, read.vectors
    return estimates(v.parts[:k], v.covariance[:k, :k], f"scatter/{name}", f"scatter, {name}", "", v.dof)


def of_run(
    s: Stand, solution: Solved, slow: Read | None, run: Run, trials: Trials, refit_u: float = 0.0
) -> list[Terms]:  # fmt: skip
    """What scatters in the parts re, im by plane (4,) of a run's unbalance, deviations as weighted Estimates; `refit_u` kg m is
    how far the unbalance may be another one each time a trial weight has been fixed."""
    a = solution.influence
    p: Complex = np.asarray(
        np.linalg.pinv(a.reshape(-1, 2)).reshape(2, *a.shape[:2]), np.complex128
    )  # plane, speed, probe
    readings: Complex = np.array([r.vectors.values[:4] for r in run.reads])
    u = solution.unbalance(readings / s.gain)
    out: list[Terms] = [[] for _ in range(4)]
    factors: dict[tuple[str, int], Complex] = {}
    reads: dict[tuple[str, int], Read] = {}

    def add(of: Run, by: Complex) -> None:
        """dU += sum over speeds and probes of by (2, s, 4) times the readings' deviations."""
        for k, read in enumerate(of.reads):
            key = (of.name, k)
            reads[key] = read
            factors[key] = factors.get(key, np.zeros((2, 4), complex)) + by[:, k] / s.gain

    add(run, p)
    for j in (0, 1):
        weight = trials.unbalance(j)
        by: Complex = np.asarray(p * ((u + solution.taken)[:, j] / weight)[None, :, None], np.complex128)
        add(trials.having[j], -by)
        add(trials.before[j], by)
        if refit_u > 0:
            _append(
                out,
                trials.planes,
                -np.eye(2) * (u + solution.taken[-1])[j] / weight,
                _refitted(trials.having[j], refit_u),
            )
    for (name, k), factor in factors.items():
        _append(out, trials.planes, factor, of_read(f"{name}/{k}", reads[name, k], 4))
    for k, read in enumerate(run.reads):
        if any(read.folds):
            _append(out, trials.planes, p[:, k] / s.gain, _folded(read, f"{run.name}/{k}"))
    if slow is not None:
        slowly = -np.einsum("jsp,spq,sqn->jn", p, a, _slow(s, solution, slow, trials))
        _append(out, trials.planes, slowly, of_read("slow", slow, 12))
    return out


def _folded(read: Read, name: str) -> list[Estimate]:
    """What a higher order that shows as order 1 may add to the probes' vectors (8,): the runout's does so in every run alike,
    and takes no part in the influence coefficients."""
    what, sizes = "higher order that shows as order 1", np.repeat(read.folds, 2) / np.sqrt(2)
    return [
        Estimate.of(0.0, Influence(f"folded/{name}/{n}", what, float(u), "m", "B", "arcsine"))
        for n, u in enumerate(sizes)
    ]


def _refitted(run: Run, u: float) -> list[Estimate]:
    """Change of the unbalance by plane, re and im (4,), from fixing a weight."""
    return [
        Estimate.of(0.0, Influence(f"refit/{run.name}/{k}", f"refitting, {run.name}", u, "kg m", "B", "normal"))
        for k in range(4)
    ]


def _append(out: list[Terms], planes: Planes, by: Complex, scatter: Sequence[Estimate]) -> None:
    """Terms of dU = by (2, n) z on the planes' scales, z complex by its parts (2n,), deviations alone."""
    for plane in (0, 1):
        for n, z in enumerate(by[plane]):
            for part, e in ((1.0 + 0j, scatter[2 * n]), (1j, scatter[2 * n + 1])):
                deviation = Estimate(0.0, e.unit, e.sensitivities)
                moved = planes[plane].told(complex(z * part))
                out[2 * plane].append((float(moved.real), deviation))
                out[2 * plane + 1].append((float(moved.imag), deviation))


def _slow(s: Stand, solution: Solved, slow: Read, trials: Trials) -> Complex:
    """Derivatives (speed, plane, 12) of U_R by the slow roll's vectors; the balance of forces is linear in them."""
    base = [r.turning for r in trials.base.reads]

    def at(vectors: Complex) -> Complex:
        return runout_as_unbalance(
            s,
            base,
            find_runout(s, {1.0: Turning(slow.speed, slow.means, vectors)}, base[-1]).runout[1.0],
            solution.mark,
        )

    start, size = at(slow.vectors.values), 1e-6
    return np.moveaxis((at(slow.vectors.values + size * np.eye(12)) - start) / size, 0, -1)
