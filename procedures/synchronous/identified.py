"""Force constants of the bearings, where nobody knows them: by the shaft that turns in them.

The balance of forces of `runout` at several speeds,

    (D_0(w) - A' K_x A) q = A' (K_p I_p + K_n I_n) + w^2 B' U,   q = A_s^-1 (M/g - R),

holds for one runout R, one unbalance U and, by T (2.4b), one beta of each axis: K_p, K_n and K_x are beta times what gap and
mean currents say. D_0 is of the mass and the inertias, which are weighed or drawn, so that beta alone gives the forces their
size. U and the inertial part of R go with w^2, K_x R stands still, and the loop's currents go with neither: three speeds, the
slow roll among them, determine all. Runs with other weights have unbalances of their own.

Least squares by Gauss and Newton. A force weighs by the displacement that it makes, of the inertia or the stiffness. All
guesses, and all inputs that are moved for the uncertainty, are solved as one stack: n stands, r readings, arrays (n, r, ...).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from bench.analysis.vectors import Vectors, estimates
from bench.errors import AnalysisError
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, propagate_stacked
from procedures.synchronous import bearings
from procedures.synchronous.bearings import Known
from procedures.synchronous.dwells import Dwell
from procedures.synchronous.runout import SCALE, Stand, arms, impedance, slopes, times, waves

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
FEWEST = 3  # speeds, the slow roll among them
ROUNDS, MORE = 40, 4  # steps from a guess, and from the solution beside
GUESSES = 10.0 ** np.arange(-1.5, 1.6, 0.25)
NEAR = 1e-7  # of beta: how far the last step goes
SINGULAR = 1e-12  # of a column: what is left of it beside the others where they make it up


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
    beta = _guessed(Stand.of({n: e.value for n, e in inputs.items()}), readings)

    def model(v: dict[str, Array]) -> dict[str, Array]:
        stands = Stand.of({n: x[:, None] for n, x in v.items()})
        found, left = _solved(replace(stands, beta=beta[None, None]), readings, _moved(readings, v), MORE)
        if not np.isfinite(left).all():
            raise AnalysisError("the dwells do not tell the bearings' force constants: too few speeds")
        return {f"beta_{k}": x for k, x in enumerate(found.T)}

    out = propagate_stacked(model, {**inputs, **_scatter(readings)})
    return replace(known, found={n: Estimate(e.value, "N m^2/A^2", e.sensitivities) for n, e in out.items()})


def _scatter(readings: Sequence[Reading]) -> dict[str, Estimate]:
    """Parts of the vectors (24 each) with the scatter of their dwells."""
    out: dict[str, Estimate] = {}
    for n, r in enumerate(readings):
        v = r.vectors
        made = estimates(v.parts, v.covariance, f"scatter/bearings/{r.name}", "scatter of the dwells", "", v.dof)
        out |= {f"s{n}_{k}": e for k, e in enumerate(made)}
    return out


def _moved(readings: Sequence[Reading], v: dict[str, Array]) -> Complex:
    """Their vectors (n, r, 12) by the inputs of `_scatter`."""
    rows = [np.stack([v[f"s{n}_{k}"] for k in range(24)], axis=-1).view(complex) for n in range(len(readings))]
    return np.stack(rows, axis=-2)


def _guessed(s: Stand, readings: Sequence[Reading]) -> Array:
    """From a row of guesses that make the bearings as stiff as a loop of some 50 Hz would need, the best."""
    i = np.abs(np.mean([r.means[4:] for r in readings], axis=0)).reshape(4, 2).mean(axis=1)
    about = s.mass / 2 * (2 * np.pi * 50) ** 2 * s.gap**3 / (4 * np.maximum(i, 1e-3) ** 2)
    vectors = np.array([r.vectors.values for r in readings])
    beta, left = _solved(replace(s, beta=(GUESSES[:, None] * about)[:, None]), readings, vectors, ROUNDS)
    left = np.where((beta > 0).all(axis=-1), left, np.inf)
    if not np.isfinite(left).any():
        raise AnalysisError(
            "the dwells do not tell the bearings' force constants: motion and currents fit no magnet. Give them: in the "
            "controller (capabilities.model) or by an adopted bearing-model; or take more speeds_rad_s, further apart, beside "
            "the slow roll"
        )
    return np.asarray(beta[np.argmin(left)])


def _solved(s: Stand, readings: Sequence[Reading], vectors: Complex, rounds: int) -> tuple[Array, Array]:
    """beta (n, 4), and what the equations leave (n,): NaN where they do not determine it. The fields of `s` have an axis of one
    for the readings, `beta` is (n, 1, 4); their vectors are (r, 12) or (n, r, 12)."""
    runout, left = np.zeros((1, 4), complex), np.zeros(1)
    done: npt.NDArray[np.bool_] = np.zeros(1, bool)
    for _ in range(rounds):
        with np.errstate(invalid="ignore"):  # a guess that has run away is NaN and stays it
            terms, left = _least_squares(*_system(s, readings, vectors, runout))
        runout, old = terms[:, 4:12].view(complex), s.beta[:, 0]
        step = np.clip(terms[:, :4], -0.5 * np.abs(old), 0.5 * np.abs(old))
        new = np.where(done[:, None], old, old + step)
        done = np.asarray(~(np.abs(new - old) >= NEAR * np.abs(new)).any(axis=-1))  # nor does NaN become anything else
        s = replace(s, beta=new[:, None])
        if done.all():
            break
    return s.beta[:, 0], left


def _least_squares(design: Array, target: Array) -> tuple[Array, Array]:
    """Terms (n, k) of equations (n, m, k) for targets (n, m), by the QR factors of their columns over their size, and the norm
    of what they leave (n,): NaN where a column is nothing or is made up of the others."""
    size = np.sqrt((design**2).sum(axis=-2))
    size = np.where(size > 0, size, np.nan)
    scaled = design / size[:, None]
    q, r = np.linalg.qr(scaled)
    r[~(np.abs(np.diagonal(r, axis1=-2, axis2=-1)).min(axis=-1) > SINGULAR)] = np.nan
    terms = np.linalg.solve(r, times(q.mT, target)[..., None])[..., 0]
    return terms / size, np.linalg.norm(times(scaled, terms) - target, axis=-1)


def _system(s: Stand, readings: Sequence[Reading], vectors: Complex, runout: Complex) -> tuple[Array, Array]:
    """Linear equations of steps of beta (4), and of the runout (8) and each run's unbalance (4), re and im, about a beta and a
    runout (n, 4); rows re and im of all readings: (n, 8 r, 12 + 4 runs) and (n, 8 r)."""
    runs = sorted({r.run for r in readings})
    of_run = np.array([[r.run == run for run in runs] for r in readings])
    w, means = np.array([r.speed for r in readings]), np.array([r.means for r in readings])
    back = np.linalg.inv(s.probes)
    k_p, k_n, k_x = slopes(s, means)
    i, read = vectors[..., 4:] / s.i_gain, vectors[..., :4] / s.gain
    control, at_axes = k_p * i[..., ::2] + k_n * i[..., 1::2], s.axes @ back
    weight = SCALE / (s.mass * w**2 + k_x.sum(axis=-1))[..., None]
    moved = control + k_x * times(at_axes, read - runout[:, None])
    by_beta = s.axes.mT * (moved / s.beta)[..., None, :]
    by_runout = impedance(s, k_x, w, w) @ back
    pulls = np.square(w)[:, None, None] * (arms(s.l_iu, s.l_ou).mT @ waves(s))
    by_unbalance = np.concatenate([pulls * of_run[:, k, None, None] for k in range(len(runs))], axis=-1)
    known = times(impedance(s, np.zeros(4), w, w) @ back, read) - times(s.axes.mT, control + k_x * times(at_axes, read))
    shape = k_x.shape[:-1]
    parts = [np.broadcast_to(part, (*shape, *part.shape[-2:])) for part in (by_beta, by_runout, by_unbalance)]
    design, target = weight[..., None] * np.concatenate(parts, axis=-1), weight * known
    return _real(design.reshape(shape[0], -1, design.shape[-1])), _parts(target.reshape(shape[0], -1), -1)


def _real(design: Complex) -> Array:
    """(n, m, 4 + k) complex, of 4 real unknowns and k complex ones, as (n, 2 m, 4 + 2 k) real."""
    rest = design[..., 4:]
    both = np.stack([rest, 1j * rest], axis=-1).reshape(*rest.shape[:-1], -1)  # of re and im of an unknown
    return _parts(np.concatenate([design[..., :4], both], axis=-1), -2)


def _parts(values: Complex, axis: int) -> Array:
    return np.concatenate([values.real, values.imag], axis=axis)
