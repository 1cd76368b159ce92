"""Force constants of the bearings, where nobody knows them: by the shaft that turns in them.

The balance of forces of `runout` at several speeds,

    (D_0(w) - A' K_x A) q = A' (K_p I_p + K_n I_n) + w^2 B' U,   q = A_s^-1 (M/g - R),

holds for one runout R, one unbalance U and, by T (2.4b), one beta of each axis: K_p, K_n and K_x are beta times what gap and
mean currents say. D_0 is of the mass and the inertias, which are weighed or drawn, so that beta alone gives the forces their
size. U and the inertial part of R go with w^2, K_x R stands still, and the loop's currents go with neither: three speeds, the
slow roll among them, determine all. Runs with other weights have unbalances of their own.

Least squares by Gauss and Newton. A force weighs by the displacement that it makes, of the inertia or the stiffness.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from bench.analysis.vectors import Vectors, estimates
from bench.errors import AnalysisError
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, propagate
from procedures.synchronous import bearings
from procedures.synchronous.bearings import Known
from procedures.synchronous.dwells import Dwell
from procedures.synchronous.runout import SCALE, Stand, arms, impedance, slopes, waves

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
FEWEST = 3  # speeds, the slow roll among them
ROUNDS, MORE = 40, 4  # steps from a guess, and from the solution beside
GUESSES = 10.0 ** np.arange(-1.5, 1.6, 0.25)
NEAR = 1e-7  # of beta: how far the last step goes


@dataclass(frozen=True)
class Reading:
    """A dwell by its `name`: speed rad/s, means (12,) and vectors (12,) of four probes and eight coils; `run`, its weights."""

    name: str
    speed: float
    means: Array
    vectors: Vectors
    run: int = 0


def of_dwells(dwells: Sequence[Dwell], rig: RigFile, known: Known) -> Known:
    """As `find_bearings`, by a slow roll and dwells."""
    return find_bearings([Reading(d.where, d.speed, d.means, d.both()) for d in dwells], rig, known)


def find_bearings(readings: Sequence[Reading], rig: RigFile, known: Known) -> Known:
    """The same knowledge with the force constants that the readings tell; as it is where they are known or cannot be told so.

    Raises:
        AnalysisError: the readings do not determine them.
    """
    if known.calibration is not None or bearings.has_model(rig) or len({round(r.speed, 1) for r in readings}) < FEWEST:
        return known
    inputs = bearings.collect_inputs(rig, known)
    at = {n: e.value for n, e in inputs.items()}
    beta = _guessed(Stand.of(at), readings)
    noise = _scatter(readings)

    def model(v: dict[str, float]) -> dict[str, float]:
        moved = [replace(r, vectors=_moved(r, n, v)) for n, r in enumerate(readings)]
        found, _ = _solved(replace(Stand.of(v), beta=beta), moved, MORE)
        return {f"beta_{k}": float(x) for k, x in enumerate(found)}

    out = propagate(model, {**inputs, **noise})
    return replace(known, found={n: Estimate(e.value, "N m^2/A^2", e.sensitivities) for n, e in out.items()})


def _scatter(readings: Sequence[Reading]) -> dict[str, Estimate]:
    """Parts of the vectors (24 each) with the scatter of their dwells."""
    out: dict[str, Estimate] = {}
    for n, r in enumerate(readings):
        v = r.vectors
        made = estimates(v.parts, v.covariance, f"scatter/bearings/{r.name}", "scatter of the dwells", "", v.dof)
        out |= {f"s{n}_{k}": e for k, e in enumerate(made)}
    return out


def _moved(r: Reading, n: int, v: Mapping[str, float]) -> Vectors:
    return replace(r.vectors, values=np.array([v[f"s{n}_{k}"] for k in range(24)]).view(complex))


def _guessed(s: Stand, readings: Sequence[Reading]) -> Array:
    """From a row of guesses that make the bearings as stiff as a loop of some 50 Hz would need, the best."""
    i = np.abs(np.mean([r.means[4:] for r in readings], axis=0)).reshape(4, 2).mean(axis=1)
    about = s.mass / 2 * (2 * np.pi * 50) ** 2 * s.gap**3 / (4 * np.maximum(i, 1e-3) ** 2)
    best: tuple[float, Array] | None = None
    for scale in GUESSES:
        try:
            beta, left = _solved(replace(s, beta=scale * about), readings, ROUNDS)
        except (np.linalg.LinAlgError, AnalysisError):
            continue
        if (beta > 0).all() and (best is None or left < best[0]):
            best = (left, beta)
    if best is None:
        raise AnalysisError(
            "the dwells do not tell the bearings' force constants: motion and currents fit no magnet. Give them: in the "
            "controller (capabilities.model) or by an adopted bearing-model; or take more speeds_rad_s, further apart, beside "
            "the slow roll"
        )
    return best[1]


def _solved(s: Stand, readings: Sequence[Reading], rounds: int) -> tuple[Array, float]:
    """beta (4,), and what the equations leave."""
    runout, left = np.zeros(4, complex), np.inf
    for _ in range(rounds):
        design, target = _system(s, readings, runout)
        scale = np.sqrt((design**2).sum(axis=0))
        if not scale.all():
            raise AnalysisError("the dwells do not tell the bearings' force constants: nothing moves")
        terms, _, rank, _ = np.linalg.lstsq(design / scale, target, rcond=1e-12)
        if rank < len(scale):
            raise AnalysisError("the dwells do not tell the bearings' force constants: too few speeds")
        left = float(np.linalg.norm(design / scale @ terms - target))
        terms = terms / scale
        step = terms[:4]
        runout = terms[4:12].view(complex)
        new = s.beta + np.clip(step, -0.5 * np.abs(s.beta), 0.5 * np.abs(s.beta))
        done = bool((np.abs(new - s.beta) < NEAR * np.abs(new)).all())
        s = replace(s, beta=new)
        if done:
            break
    return s.beta, left


def _system(s: Stand, readings: Sequence[Reading], runout: Complex) -> tuple[Array, Array]:
    """Linear equations of steps of beta (4), and of the runout (8) and each run's unbalance (4), re and im, about a beta and a
    runout; rows re and im."""
    runs = sorted({r.run for r in readings})
    rows, targets, back = [], [], np.linalg.inv(s.probes)
    for r in readings:
        w, (k_p, k_n, k_x) = r.speed, slopes(s, r.means)
        i, read = r.vectors.values[4:] / s.i_gain, r.vectors.values[:4] / s.gain
        control, at_axes = k_p * i[::2] + k_n * i[1::2], s.axes @ back
        weight = SCALE / (s.mass * w**2 + float(k_x.sum()))
        design = np.zeros((4, 8 + 2 * len(runs)), complex)
        design[:, :4] = s.axes.T * ((control + k_x * (at_axes @ (read - runout))) / s.beta)
        design[:, 4:8] = impedance(s, k_x, w, w) @ back
        own = 8 + 2 * runs.index(r.run)
        design[:, own : own + 2] = w**2 * arms(s.l_iu, s.l_ou).T @ waves(s)
        known = impedance(s, np.zeros(4), w, w) @ back @ read - s.axes.T @ (control + k_x * (at_axes @ read))
        rows.append(_parts(np.asarray(weight[:, None] * design, np.complex128)))
        targets.append(_stack(weight * known))
    return np.concatenate(rows), np.concatenate(targets)


def _parts(design: Complex) -> Array:
    """(4, 4 + n) complex, of 4 real unknowns and n complex ones, as (8, 4 + 2 n) real."""
    real, rest = design[:, :4], design[:, 4:]
    wide = np.empty((8, 4 + 2 * rest.shape[1]))
    wide[:4, :4], wide[4:, :4] = real.real, real.imag
    wide[:4, 4::2], wide[:4, 5::2] = rest.real, -rest.imag
    wide[4:, 4::2], wide[4:, 5::2] = rest.imag, rest.real
    return wide


def _stack(values: Complex) -> Array:
    return np.concatenate([values.real, values.imag])
