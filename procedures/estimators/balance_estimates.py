"""Influence coefficients and unbalance with influences: trial weights, scatter, runout as the unbalance it is taken for.

At one speed the probes read X = A (U + U_R). Trial weights give A = (X_trial - X_before)/u, controller and bearings with it.
U_R is what the runout R of the slow roll is taken for (`runout.as_unbalance`), of the shaft's own masses alone. Weights sit
on a scale whose angle from the once-per-turn mark nobody knows; the forces of the trial weights tell it. A, U and u are on
the scale, R and U_R are turned to it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from bench.analysis.balance import allocated, permissible
from bench.analysis.vectors import Vectors, estimates
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence, propagate, welch_satterthwaite
from procedures.estimators import runout, unbalance_estimates
from procedures.estimators.balance_data import SIDES, Read, Run, Weight
from procedures.estimators.inputs import certified
from procedures.estimators.runout import Stand, Turning
from procedures.estimators.unbalance_data import AXES

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
WORST_CONDITION = 50.0  # of the influence coefficients


class Settings(Protocol):
    """The part of a plan that the estimates need."""

    @property
    def beta_share(self) -> float: ...
    @property
    def offset_u_m(self) -> float: ...
    @property
    def grade_m_s(self) -> float: ...
    @property
    def service_rad_s(self) -> float: ...


@dataclass(frozen=True)
class Trials:
    """Base run, and by plane the runs before and with its trial weight and that weight."""

    base: Run
    before: tuple[Run, Run]
    having: tuple[Run, Run]
    weights: tuple[Weight, Weight]


@dataclass(frozen=True)
class Solved:
    """By speed: `influence` (s, 4, 2) m/(kg m), probes over their gain; `placed` (s, 2, 2), what the forces say of each trial
    weight (row) in each plane, over what it should be and turned to the scale; `mark` rad, from the mark to the scale's zero;
    `runout` (4,) m from the mark; `taken` (s, 2) kg m, the unbalance that it is taken for, on the scale."""

    influence: Complex
    placed: Complex
    mark: float
    runout: Complex
    taken: Complex

    @property
    def condition(self) -> float:
        """Of the influence coefficients, columns scaled to one."""
        a = self.influence.reshape(-1, 2)
        return float(np.linalg.cond(a / np.linalg.norm(a, axis=0)))

    def unbalance(self, readings: Complex) -> Complex:
        """Unbalance (2,) kg m on the scale, from readings (s, 4) m over gain."""
        a = self.influence.reshape(-1, 2)
        clean = readings - np.einsum("spq,sq->sp", self.influence, self.taken)
        return np.asarray(np.linalg.lstsq(a, clean.reshape(-1), rcond=None)[0])


def solved(s: Stand, slow: Turning | None, trials: Sequence[tuple[complex, Sequence[Turning], Sequence[Turning]]],
           base: Sequence[Turning]) -> Solved:  # fmt: skip
    """Influence coefficients and what they need, of one set of numbers. `trials` by plane: weight kg m on the scale, readings
    by speed before it was fixed and with it."""
    found = np.zeros(4, complex) if slow is None else runout.found(s, slow, base[-1])[0]
    count = len(base)
    influence, moved = np.zeros((count, 4, 2), complex), np.zeros((count, 2, 2), complex)
    for p, (u, before, having) in enumerate(trials):
        for k, (a, b) in enumerate(zip(before, having, strict=True)):
            influence[k, :, p] = (b.vectors[:4] - a.vectors[:4]) / s.gain / u
            moved[k, p] = (runout.unbalances(s, b, found)[0] - runout.unbalances(s, a, found)[0]) / u
    mark = float(np.angle(moved[:, 0, 0].sum() + moved[:, 1, 1].sum()))
    back = np.exp(-1j * mark)
    taken = np.array([runout.as_unbalance(s, t.means, found, t.speed) * back for t in base])
    return Solved(influence, moved * back, mark, found, taken)


@dataclass(frozen=True)
class Balanced:
    """Nominal solution; of each run the unbalance by plane as `vectors` (2,) kg m on the scale and its `parts` re, im by plane
    (4,); U_per of each plane, kg m."""

    trials: Trials
    solved: Solved
    unbalance: Mapping[str, Vectors]
    parts: Mapping[str, tuple[Estimate, ...]]
    permissible: tuple[Estimate, Estimate]
    radius: float

    def added(self, name: str, since: Run, runs: Sequence[Run]) -> Complex:
        """What was mounted in a run beyond another one's weights, (2,) kg m."""
        run = next(r for r in runs if r.name == name)
        return fixed(run.weights, self.radius) - fixed(since.weights, self.radius)


def fixed(weights: Sequence[Weight], radius: float) -> Complex:
    """Sum of weights by plane, (2,) kg m."""
    out = np.zeros(2, complex)
    for w in weights:
        out[w.plane] += w.unbalance(radius)
    return out


def balanced(slow: Read | None, runs: Sequence[Run], trials: Trials, rig: RigFile, plan: Settings) -> Balanced:
    """Unbalance of every run in `runs`, with influences shared by their identity."""
    inputs, radius = unbalance_estimates.stated(rig, plan), rig.geometry["balance_radius"]
    known = {**inputs, **_weights(trials, rig)}
    if slow is not None:
        known |= _scatter("slow", slow, 12)
    else:
        u = rig.machine["runout"].standard_uncertainty
        for part in ("re0", "im0", "re2", "im2"):
            known[f"unknown_{part}"] = Estimate.of(0.0, Influence(f"runout/{part}", "runout, no slow roll", u, "m", "B", "normal"))
    involved = {r.name: r for r in (*trials.before, *trials.having, *runs)}
    for run in involved.values():
        for k, read in enumerate(run.reads):
            known |= _scatter(f"{run.name}/{k}", read, 4)

    def at(v: Mapping[str, float], run: Run) -> list[Turning]:
        return [_turning(v, f"{run.name}/{k}", read, 4) for k, read in enumerate(run.reads)]

    def solve(v: Mapping[str, float]) -> Solved:
        s = Stand.of(v)
        weights = [(complex(v[f"kg_{p}"] * v["radius"] * np.exp(1j * v[f"angle_{p}"])), at(v, trials.before[p]),
                    at(v, trials.having[p])) for p in (0, 1)]  # fmt: skip
        return solved(s, None if slow is None else _turning(v, "slow", slow, 12), weights, at(v, trials.base))

    def model(v: dict[str, float]) -> dict[str, float]:
        s, found = Stand.of(v), solve(v)
        lost = _unknown(v, s, trials.base, found.mark) if slow is None else np.zeros((len(trials.base.reads), 2))
        out: dict[str, float] = {}
        for run in runs:
            readings = np.array([t.vectors[:4] / s.gain for t in at(v, run)])
            u = Solved(found.influence, found.placed, found.mark, found.runout, found.taken + lost).unbalance(readings)
            out |= {f"{run.name}/{k}": float(x) for k, x in enumerate(u.view(np.float64))}
        return out

    out = propagate(model, known)
    parts = {r.name: tuple(_linear(out[f"{r.name}/{k}"]) for k in range(4)) for r in runs}
    nominal = solve({name: e.value for name, e in known.items()})
    return Balanced(
        trials, nominal, {name: _vectors(p) for name, p in parts.items()}, parts, permitted(rig, plan), radius.value
    )


def _unknown(v: Mapping[str, float], s: Stand, base: Run, mark: float) -> Complex:
    """What a runout that nobody measured would be taken for; both probes of a plane see the same journal."""
    i, o = (v[f"unknown_re{k}"] + 1j * v[f"unknown_im{k}"] for k in (0, 2))
    off = np.array([i, -1j * i, o, -1j * o])
    return np.array([runout.as_unbalance(s, r.means, off, r.speed) for r in base.reads]) * np.exp(-1j * mark)


def _weights(trials: Trials, rig: RigFile) -> dict[str, Estimate]:
    """Trial weights as the balance says and the scale shows; all sit at one radius."""
    out = {"radius": certified("geometry/balance_radius", rig.geometry["balance_radius"], "radius of the weights")}
    for p, w in enumerate(trials.weights):
        for name, key, value in (("kg", "weight_mass", w.kg), ("angle", "weight_angle", w.angle)):
            t = rig.machine[key]
            off = Influence(f"weight/{w.number}/{name}", f"{name} of the trial weight, {SIDES[p]}",
                            t.standard_uncertainty, t.unit, "B", t.distribution, source=t.source)  # fmt: skip
            out[f"{name}_{p}"] = Estimate.of(value, off)
    return out


def _scatter(name: str, read: Read, count: int) -> dict[str, Estimate]:
    """Parts of the first vectors of a dwell, with their joint covariance."""
    k = 2 * count
    some = estimates(read.vectors.parts[:k], read.vectors.covariance[:k, :k], f"scatter/{name}", f"scatter, {name}", "",
                     read.vectors.dof)  # fmt: skip
    return {f"{name}/{j}": e for j, e in enumerate(some)}


def _turning(v: Mapping[str, float], name: str, read: Read, count: int) -> Turning:
    vectors = read.vectors.values.copy()
    for j in range(count):
        vectors[j] = v[f"{name}/{2 * j}"] + 1j * v[f"{name}/{2 * j + 1}"]
    return Turning(read.speed, read.means, vectors)


def _linear(e: Estimate) -> Estimate:
    return Estimate(e.value, "kg m", e.sensitivities)


def _vectors(parts: Sequence[Estimate]) -> Vectors:
    values = np.array([parts[2 * k].value + 1j * parts[2 * k + 1].value for k in range(len(parts) // 2)])
    return Vectors(values, unbalance_estimates.covariance(parts), min(welch_satterthwaite(e) for e in parts))


def permitted(rig: RigFile, plan: Settings) -> tuple[Estimate, Estimate]:
    """U_per of each plane (ISO 21940-11), kg m, uncertain by the rotor's mass and the planes' places."""
    inputs = {"mass": certified("machine/mass", rig.machine["mass"]),
              "left": certified("geometry/com_to_inboard_balance", rig.geometry["com_to_inboard_balance"]),
              "right": certified("geometry/com_to_outboard_balance", rig.geometry["com_to_outboard_balance"])}  # fmt: skip

    def model(v: dict[str, float]) -> dict[str, float]:
        i, o = allocated(permissible(plan.grade_m_s, v["mass"], plan.service_rad_s), v["left"], v["right"])
        return {"i": i, "o": o}

    out = propagate(model, inputs)
    return _linear(out["i"]), _linear(out["o"])


def share(balance: Balanced, name: str, plane: int) -> Estimate:
    """Amount of a run's unbalance in a plane over U_per. Its two components enter as one pair with their covariance, which
    Monte Carlo draws where the amount is near zero."""
    one = balance.unbalance[name].one(plane)
    pair = estimates(one.parts, one.covariance, f"unbalance/{name}/{plane}", "components of the unbalance", "kg m", one.dof)
    inputs = {"x": pair[0], "y": pair[1], "per": balance.permissible[plane]}
    out = propagate(lambda v: math.hypot(v["x"], v["y"]) / v["per"], inputs)
    return Estimate(out.value, "1", out.sensitivities, out.sampler)


def influences(balance: Balanced, rig: RigFile) -> dict[tuple[str, str], tuple[Estimate, Estimate]]:
    """Influence coefficients at the highest speed by probe and plane, cosine and sine, m/(kg m): scatter of both runs, the
    trial weight, and the probe's gain."""
    out = {}
    radius = certified("geometry/balance_radius", rig.geometry["balance_radius"], "radius of the weights")
    known = _weights(balance.trials, rig)
    for p, side in enumerate(SIDES):
        before, having = balance.trials.before[p], balance.trials.having[p]
        names = [f"{r.name}/{len(r.reads) - 1}" for r in (before, having)]
        scatter = [_scatter(name, r.fastest, 4) for name, r in zip(names, (before, having), strict=True)]
        for k, axis in enumerate(AXES):
            parts = [scatter[n][f"{names[n]}/{2 * k + j}"] for n in (0, 1) for j in (0, 1)]
            inputs = {"a": parts[0], "b": parts[1], "c": parts[2], "d": parts[3], "kg": known[f"kg_{p}"],
                      "angle": known[f"angle_{p}"], "radius": radius,
                      "gain": certified(f"sensors/pos_{axis}/gain", rig.sensors[f"pos_{axis}"].gain)}  # fmt: skip

            def model(v: dict[str, float]) -> dict[str, float]:
                u = v["kg"] * v["radius"] * v["gain"] * np.exp(1j * v["angle"])
                z = complex((v["c"] - v["a"] + 1j * (v["d"] - v["b"])) / u)
                return {"cos": z.real, "sin": -z.imag}

            found = propagate(model, inputs)
            out[axis, side] = tuple(Estimate(found[n].value, "m/(kg m)", found[n].sensitivities) for n in ("cos", "sin"))
    return out  # type: ignore[return-value]


@dataclass(frozen=True)
class Forces:
    """Of a dwell, what `unbalance_checks` looks at: share of the forces left over, share of the weight carried (4,)."""

    misfit: float
    carried: Array
    unbalance: Complex


def forces(read: Read, off: Complex, rig: RigFile, plan: Settings) -> Forces:
    """The balance of forces of one dwell, with a runout (4,) m."""
    s = Stand.of({name: e.value for name, e in unbalance_estimates.stated(rig, plan).items()})
    u, misfit = runout.unbalances(s, read.turning, off)
    return Forces(misfit, runout.carried(s, read.means) / unbalance_estimates.shares(rig, s), u)


__all__ = ["AXES", "Balanced", "Forces", "Solved", "Trials", "balanced", "fixed", "forces", "permitted", "share", "solved"]
