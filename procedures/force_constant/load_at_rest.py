"""What the AMBs carry while the motor gives no force, against what they carried at their calibration at the same angles.

F0 of the calibration has the shaft alone as its zero (`amb_calibration.fit.carried`), so that at rest at the sensors' zero

    r = F0 + K u + K2 v = 0        at each AMB, at every angle

whatever the rotor weighs, the motor pulls and wherever the journal stands. Gains, offsets, spans and masses that both runs
share cancel, as their currents are all but the same. What moves r has happened since:

- a coil's current sensor, by dr = 2 A i_p^2 or -2 B i_n^2 for a unit of its gain: of that AMB alone
- all of the coils' sensors alike (one reference, one temperature), in the ratio of what the AMBs carry
- a position sensor's zero: the rotor stands elsewhere in both magnets and in the motor, and r moves at both AMBs
- another load: the hanger, which may still be on, is known and taken off

One of the first two that explains both AMBs' r alone says by how much a gain has moved, and what that does to the force
constant. If none does, moved zeros do: a micrometre is a newton at the outboard AMB, and moves the force constant by a fifth or
less of what a coil's gain does per newton.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.uncertainty import Estimate, propagate
from procedures.force_constant import estimates, fit
from procedures.force_constant.fit import DIRECT, Constants, Ramps
from procedures.force_constant.steps import planes
from procedures.servomotor.conventions import conventions

Array = npt.NDArray[np.float64]
Values = Mapping[str, float]
AT_REST = [f"F0_{b}" for b in "io"]
HANGER = ("hanger_i", "hanger_o")
FIVE = 5.0  # standard uncertainties: no sound rig
STEP, STEP_M = 1e-4, 1e-8  # of the numerical slopes: gain, zero
ALL = "all"


@dataclass(frozen=True)
class Cause:
    """What would explain the loads, alone: `sensors`, each changed by `amounts` since the calibration (a gain relative, a zero
    in m); `shift` N/A is how far the force constant of this run is off by it."""

    sensors: tuple[str, ...]
    amounts: tuple[float, ...]
    shift: float


@dataclass(frozen=True)
class Rest:
    """Per bearing (2,), 0 inboard: `moved` N, what the currents carry beyond the calibration's load, and its `u`; `causes` if
    one has moved: changes of current sensors, or of zeros where no change of those explains both."""

    moved: Array
    u: Array
    causes: tuple[Cause, ...] = ()

    @property
    def beyond(self) -> npt.NDArray[np.bool_]:
        """Which bearings (2,) carry another load."""
        return np.abs(self.moved) > FIVE * self.u


def compared(r: Ramps, inputs: Mapping[str, Estimate], facts: Mapping[str, Estimate], rig: RigFile, weight: float,
             bias_A: float) -> Rest | None:  # fmt: skip
    """The comparison for the vertical ramps; None if the calibration handed on no F0. `inputs` of the fit (`estimates`),
    `weight` of the force row in its result."""
    count = len(r.angles)
    names = (*(f"{name}@{k}" for name in AT_REST for k in range(count)), *HANGER)
    if not all(name in facts for name in names):
        return None
    known = {**inputs, **{name: facts[name] for name in names}}
    values = {name: e.value for name, e in known.items()}

    def model(p: dict[str, float]) -> dict[str, float]:
        return dict(zip(AT_REST, loads(r, p, bias_A), strict=True))

    outputs = propagate(model, known)
    found = [outputs[name] for name in AT_REST]
    covariance = estimates.covariance(found) + _scatter(r, values, bias_A)
    rest = Rest(np.array([e.value for e in found]), np.sqrt(np.diag(covariance)))
    hung = Rest(rest.moved - [values[name] for name in HANGER], rest.u)
    if rest.beyond.all() and not hung.beyond.all():
        rest = hung
    if not rest.beyond.any():
        return rest
    causes = _sensors(r, values, rig, weight, bias_A, rest) or (_zeros(r, values, rig, weight, bias_A, rest),)
    return replace(rest, causes=causes)


def forces(r: Ramps, p: Values, bias_A: float, off: Array | None = None) -> Array:
    """F0 + K u + K2 v (2, A, P) in N, referred to the sensors' zero as in the calibration. `off` (3,) m: by how much the rotor
    really stands higher at both AMBs and at the motor than at the calibration, while the sensors read the same."""
    c = fit.vertical(p, len(r.angles))
    at, motor_m = r.positions, r.motor_m
    u, v = fit.coil_terms(r, p, bias_A)
    now = c if off is None else displaced(c, off[:2], p["amb_gap"], bias_A)
    stiffness = c.k.mean(axis=1) * bias_A / p["amb_gap"]
    f0 = np.array([[p[f"{name}@{k}"] for k in range(len(r.angles))] for name in AT_REST])
    force = f0[..., None] + now.k[..., None] * u + now.k2[..., None] * v + stiffness[:, None, None] * at
    force += ((now.k2 - c.k2) * bias_A**2)[..., None]  # F is A i_p^2 - B i_n^2 = K u + K2 (v + b^2)
    pull = p["motor_stiffness"] * (motor_m if off is None else motor_m + off[2])
    lever = p["motor_to_outboard_amb"] / p["amb_span"]
    out: Array = force + np.stack([-lever * pull, (1 + lever) * pull])
    return out


def displaced(c: Constants, off: Array, gap: float, bias_A: float) -> Constants:
    """The constants where the journals stand `off` (2,) m nearer to the upper coils: A ~ 1/(1 - e)^2, B ~ 1/(1 + e)^2 (T 2.4),
    with K2/K = e/(b (1 + e^2))."""
    t = np.clip(bias_A * c.k2 / c.k, -0.45, 0.45)
    e = 2 * t / (1 + np.sqrt(1 - 4 * t**2))
    then = e + off[:, None] / gap
    a = (c.k / (4 * bias_A) + c.k2 / 2) * ((1 - e) / (1 - then)) ** 2
    b = (c.k / (4 * bias_A) - c.k2 / 2) * ((1 + e) / (1 + then)) ** 2
    return Constants(2 * bias_A * (a + b), a - b)


def loads(r: Ramps, p: Values, bias_A: float, off: Array | None = None, *, turning: float = 1.0) -> Array:
    """r of both AMBs (2,) N: what `forces` are without a current in the motor, mean over the angles."""
    solver = np.linalg.pinv(_design(r, turning))[:, 0]
    out: Array = np.einsum("ap,bap->ba", solver, forces(r, p, bias_A, off)).mean(axis=1)
    return out


def _design(r: Ramps, turning: float = 1.0) -> Array:
    """(A, P, 5), by the motor's currents as its sensors read them: so that their zero is the calibration's."""
    own, other = fit.PAIRS[r.axis]
    i = {k: r.segments[k - 1] for k in (1, 2, 3, 4)}
    branch = r.branch * np.where(r.turning > 0, turning, 1.0)
    currents = ((i[own[0]] - i[own[1]]) / 2, (i[other[0]] - i[other[1]]) / 2)
    return np.stack([np.ones_like(branch), *currents, branch, r.time], axis=-1)


def _scatter(r: Ramps, p: Values, bias_A: float) -> Array:
    """Covariance (2, 2) N^2 that this run's steps add: residuals, pooled over the angles, and play at the turning points."""
    design, given = _design(r), forces(r, p, bias_A)
    solvers = np.linalg.pinv(design)
    left = given - np.einsum("apf,baf->bap", design, np.einsum("afp,bap->baf", solvers, given))
    angles, points, terms = design.shape
    steps = np.einsum("bap,cap->bc", left, left) / (angles * (points - terms))
    play = loads(r, p, bias_A, turning=0.0) - loads(r, p, bias_A)
    out: Array = steps * (solvers[:, 0] ** 2).sum() / angles**2 + np.outer(play, play) / 3
    return out


def _constant(r: Ramps, p: Values, c: Constants, weight: float, bias_A: float) -> float:
    """The force constant by both rows, N/A."""
    terms = fit.fit(r, p, c, bias_A).terms[:, :, DIRECT].mean(axis=1)
    return float(terms @ [weight, 1 - weight])


def _sensors(r: Ramps, p: Values, rig: RigFile, weight: float, bias_A: float, rest: Rest) -> tuple[Cause, ...]:
    """Every coil's sensor, and all of them, whose change alone leaves neither AMB another load."""
    c = fit.vertical(p, len(r.angles))
    before, alpha = loads(r, p, bias_A), _constant(r, p, c, weight, bias_A)
    coils = conventions(rig).coils_along("y")
    out = []
    for name, changed in [*((coil, (place,)) for place, coil in coils.items()), (ALL, tuple(coils))]:
        other = {**p, **{f"gain_y{x}": p[f"gain_y{x}"] * (1 + STEP) for x in changed}}
        slope = (loads(r, other, bias_A) - before) / STEP
        scaled, seen = slope / rest.u, rest.moved / rest.u
        amount = -float(scaled @ seen) / float(scaled @ scaled)
        if np.abs(seen + amount * scaled).max() < FIVE:
            shift = -amount * (_constant(r, other, c, weight, bias_A) - alpha) / STEP
            out.append(Cause((name,), (amount,), shift))
    return tuple(out)


def _zeros(r: Ramps, p: Values, rig: RigFile, weight: float, bias_A: float, rest: Rest) -> Cause:
    """The zeros of both vertical position sensors, moved by what leaves neither AMB another load."""
    c = fit.vertical(p, len(r.angles))
    before, alpha = loads(r, p, bias_A), _constant(r, p, c, weight, bias_A)
    slopes, effects = [], []
    for sensor in np.eye(2):
        ambs, motor = planes(rig, *(np.array(x) for x in sensor))
        off = np.array([*ambs, motor]) * STEP_M
        slopes.append((loads(r, p, bias_A, off) - before) / STEP_M)
        at = displaced(c, off[:2], p["amb_gap"], bias_A)
        effects.append((_constant(r, p, at, weight, bias_A) - alpha) / STEP_M)
    amounts = -np.linalg.solve(np.array(slopes).T, rest.moved)
    return Cause(conventions(rig).positions_of("yi", "yo"), tuple(map(float, amounts)), -float(amounts @ effects))
