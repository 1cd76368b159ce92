"""Unbalance of the shaft on the scale of its planes, with influences: from trial weights, slow roll and certificates."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.analysis.balance import allocated, permissible
from bench.analysis.vectors import Vectors
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence, propagate, propagate_stacked, welch_satterthwaite
from bench.uncertainty.estimate import merged
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.lengths import lengths_by_name
from procedures.balance import scatter as balance_scatter
from procedures.balance.apart import parts_of, said, share_of
from procedures.balance.plan import Plan
from procedures.balance.planes import Planes, all_told, names_of, planes_of
from procedures.balance.solution import Solved, Trials, runout_as_unbalance, runout_beside, solve
from procedures.balance.steps import Read, Recorded, Run, Weight, read_dwell
from procedures.balance.vector_length import amount
from procedures.shared.certificates import certified
from procedures.synchronous import bearings, facts, runout
from procedures.synchronous.bearings import Known
from procedures.synchronous.carrying import carried
from procedures.synchronous.dwells import Dwell
from procedures.synchronous.estimates import ForceBalance
from procedures.synchronous.orbit_frame import covariance
from procedures.synchronous.runout import Stand, Turning
from procedures.synchronous.unexplained import allowed

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
BENDING = 0.1  # of (omega/omega_1)^2: docs/reference/balance.md, Uncertainty, as the next
NONLINEAR = 3.0  # of (X/gap)^2


@dataclass(frozen=True)
class Balanced:
    """Nominal solution; of each run the unbalance by plane as `vectors` (2,) kg m on the planes' scales and its `parts` re, im
    by plane (4,); U_per of each plane, kg m; the `planes`; `gain` (4,) of the probes. By part of the base run how far it moves
    the unbalance from what all readings say, and its share of it (`apart`)."""

    trials: Trials
    solved: Solved
    unbalance: Mapping[str, Vectors]
    parts: Mapping[str, tuple[Estimate, ...]]
    permissible: tuple[Estimate, Estimate]
    planes: Planes
    gain: Array
    apart: Mapping[str, tuple[Vectors, float]]


@dataclass(frozen=True)
class Result:
    """A balancing: the settings, the solution, the runs as recorded, the `last` run's name, influences by probe and plane."""

    plan: Plan
    rig: RigFile
    balance: Balanced
    recorded: Recorded
    last: str
    influences: Mapping[tuple[str, str], tuple[Estimate, Estimate]]


def sum_weights(weights: Sequence[Weight], planes: Planes) -> Complex:
    """Sum of weights by plane, (2,) kg m on the planes' scales."""
    out = np.zeros(2, complex)
    for w in weights:
        out[w.plane] += w.unbalance(planes[w.plane].radius.value)
    return out


def solve_runs(
    slow: Read | None, runs: Sequence[Run], trials: Trials, rig: RigFile, plan: Plan, known: Known
) -> Balanced:  # fmt: skip
    """Unbalance of every run in `runs`, with influences shared by their identity; `known` is what is known of the bearings.

    Certificates and the bearings' model go through the whole model, scatter through its linear part.
    """
    planes = trials.planes
    inputs = {
        **bearings.collect_inputs(rig, known),
        **_weights(trials),
        **_bending(),
        **_nonlinear(trials, rig),
        **(_unmeasured(rig) if slow is None else {}),
    }

    speeds = np.array([r.speed for r in trials.base.reads])
    near = (speeds / (2 * math.pi * plan.bending_hz)) ** 2 if plan.bending_hz else 0 * speeds
    stand, nominal = _solve_with({name: e.value for name, e in inputs.items()}, slow, trials, near)
    groups = parts_of([r.speed for r in trials.base.reads])

    def parted(v: dict[str, Array]) -> dict[str, Array]:
        s, found = _solve_with(v, slow, trials, near)
        bent = np.stack([v[f"nonlinear_re_{p}"] + 1j * v[f"nonlinear_im_{p}"] for p in (0, 1)], axis=-1)
        out: dict[str, Array] = {}
        for run in runs:
            read = readings(run) / s.gain[:, None]
            whole = found.unbalance(read)
            u = whole + replace(found, taken=0 * found.taken).unbalance(read) * bent
            of = {run.name: u}
            if run.name == trials.base.name:
                of |= {
                    name: share_of(nominal, part) * (said(found, read, part) - whole) for name, part in groups.items()
                }
            for name, x in of.items():
                told = all_told(planes, x, (v["scale_0"], v["scale_1"]))
                out |= {f"{name}/{k}": y for k, y in enumerate(told.view(np.float64).T)}
        return out

    out = propagate_stacked(parted, inputs)
    parts, apart = {}, {}
    for run in runs:
        scatter = balance_scatter.of_run(stand, nominal, slow, run, trials, plan.refit_u_kg_m)
        parts[run.name] = tuple(
            Estimate(e.value, "kg m", merged(((1.0, e), *more)))
            for e, more in zip((out[f"{run.name}/{k}"] for k in range(4)), scatter, strict=True)
        )
        if run.name == trials.base.name:
            noise = covariance([Estimate(0.0, "kg m", merged(more)) for more in scatter])
            apart = {name: (_moved([out[f"{name}/{k}"] for k in range(4)], noise), share_of(nominal, part))
                     for name, part in groups.items()}  # fmt: skip
    unbalance = {name: _vectors(p) for name, p in parts.items()}
    return Balanced(trials, nominal, unbalance, parts, permissible_of_planes(rig, plan), planes, stand.gain, apart)


def _moved(parts: Sequence[Estimate], noise: Array) -> Vectors:
    """How far a part of the readings moves the unbalance; noise is as much as that of all, at most."""
    values = np.array([complex(parts[k].value, parts[k + 1].value) for k in (0, 2)])
    return Vectors(values, covariance(parts) + noise)


def _solve_with(v: Mapping[str, Any], slow: Read | None, trials: Trials, near: Array) -> tuple[Stand, Solved]:
    """The stand and the solution with these inputs, or a stack of them; `near` (s,), each speed over the first bending mode's,
    squared."""
    s = Stand.of(v)
    some = [(_fixed(v, trials.planes, p), _turnings(trials.before[p]), _turnings(trials.having[p])) for p in (0, 1)]
    found = solve(s, None if slow is None else slow.turning, some, _turnings(trials.base))
    if slow is None:
        lost = (s, _turnings(trials.base), _unknown(v), found.mark)
        beside = found.beside + runout_beside(*lost, found.influence)
        found = replace(found, taken=found.taken + runout_as_unbalance(*lost), beside=beside)
    bent = runout.matrix([[v[f"bending_{j}{k}"] for k in (0, 1)] for j in (0, 1)])
    return s, replace(found, taken=found.taken + near[:, None] * (found.taken @ bent.mT))


def _fixed(v: Mapping[str, Any], planes: Planes, p: int) -> Any:
    """A plane's trial weight, kg m from the mark."""
    return v[f"kg_{p}"] * v[f"radius_{p}"] * np.exp(1j * planes[p].from_mark(v[f"angle_{p}"], v[f"scale_{p}"]))


def _turnings(run: Run) -> list[Turning]:
    return [r.turning for r in run.reads]


def readings(run: Run) -> Complex:
    return np.array([r.vectors.values[:4] for r in run.reads])


def _unmeasured(rig: RigFile) -> dict[str, Estimate]:
    """Runout that nobody measured, by what the rig file says of it; both probes of a plane see the same journal."""
    u = facts.runout_u(rig)
    names = [f"{part}_{b}" for b in "io" for part in ("re", "im")]
    return {f"unknown_{n}": Estimate.of(0.0, Influence(f"runout/{n}", "runout, no slow roll", u, "m", "B", "normal"))
            for n in names}  # fmt: skip


def _unknown(v: Mapping[str, Any]) -> Complex:
    i, o = (v[f"unknown_re_{b}"] + 1j * v[f"unknown_im_{b}"] for b in "io")
    return np.stack([i, -1j * i, o, -1j * o], axis=-1)


def _bending() -> dict[str, Estimate]:
    """By how much the shaft's bending changes the unbalance that a runout is taken for, over (omega/omega_1)^2, plane by plane:
    what the modes add to the rigid shaft's response, over that response, changes with their shapes at probes and planes,
    which nobody states."""
    names = [f"{j}{k}" for j in (0, 1) for k in (0, 1)]
    return {f"bending_{n}": Estimate.of(0.0, Influence(f"bending/{n}", "bending of the shaft", BENDING, "1", "B", "normal"))
            for n in names}  # fmt: skip


def _nonlinear(trials: Trials, rig: RigFile) -> dict[str, Estimate]:
    """How far influence coefficients may be those of another amplitude: forces go as 1/gap^2, so that what the runs with trial
    weights say of the slope differs from that of a shaft at rest by some (X/gap)^2, X the greatest amplitude in them."""
    far = max(float(np.abs(readings(r)).max()) for r in (*trials.before, *trials.having))
    u = NONLINEAR * (far / facts.least_gap(rig)) ** 2
    return {
        f"nonlinear_{part}_{p}": Estimate.of(
            0.0, Influence(f"nonlinear/{side}/{part}", f"response not linear, {side}", u, "1", "B", "normal"))
        for p, side in enumerate(names_of(rig)) for part in ("re", "im")
    }  # fmt: skip


def _weights(trials: Trials) -> dict[str, Estimate]:
    """Trial weights as the balance says and the scale shows, at the planes' radii; where the scales begin."""
    out = {f"radius_{p}": plane.radius for p, plane in enumerate(trials.planes)}
    for p, w in enumerate(trials.weights):
        for name, key, value, what in (
            ("kg", "weight_mass", w.kg, "mass"), ("angle", "weight_angle", w.angle, "angle")
        ):  # fmt: skip
            t = getattr(trials.planes[p], key)
            off = Influence(f"weight/{w.number}/{name}", f"{what} of the trial weight, {trials.planes[p].name}",
                            t.standard_uncertainty, t.unit, "B", t.distribution, source=t.source)  # fmt: skip
            out[f"{name}_{p}"] = Estimate.of(value, off)
    return out | {f"scale_{p}": plane.zero for p, plane in enumerate(trials.planes)}


def _linear(e: Estimate) -> Estimate:
    return Estimate(e.value, "kg m", e.sensitivities)


def _vectors(parts: Sequence[Estimate]) -> Vectors:
    values = np.array([parts[2 * k].value + 1j * parts[2 * k + 1].value for k in range(len(parts) // 2)])
    return Vectors(values, covariance(parts), min(welch_satterthwaite(e) for e in parts))


def permissible_of_planes(rig: RigFile, plan: Plan) -> tuple[Estimate, Estimate]:
    """U_per of each plane (ISO 21940-11), kg m, uncertain by the rotor's mass and the planes' places."""
    if facts.stated(rig):
        left, right = (lengths_by_name(rig)[name] for name in ("l_iu", "l_ou"))
        inputs = {
            "mass": certified("machine/mass", rig.machine["mass"]),
            "left": certified(left.identity, left.number),
            "right": certified(right.identity, right.number),
        }
    else:
        one, other = planes_of(rig)
        inputs = {"mass": facts.shaft_number(rig, "mass"), "left": one.at, "right": other.at}

    def model(v: dict[str, float]) -> dict[str, float]:
        i, o = allocated(permissible(plan.grade_m_s, v["mass"], plan.service_rad_s), v["left"], v["right"])
        return {"i": i, "o": o}

    out = propagate(model, inputs)
    return _linear(out["i"]), _linear(out["o"])


def share(balance: Balanced, name: str, plane: int) -> Estimate:
    """Amount of a run's unbalance in a plane over U_per, with all influences of both."""
    ratio = amount(*balance.parts[name][2 * plane : 2 * plane + 2]) / balance.permissible[plane]
    return Estimate(ratio.value, "1", ratio.sensitivities, ratio.sampler)


def influences(balance: Balanced, rig: RigFile) -> dict[tuple[str, str], tuple[Estimate, Estimate]]:
    """Influence coefficients at the highest speed by probe and plane, cosine and sine, m/(kg m): scatter of both runs, the
    trial weight, and the probe's gain."""
    out, machine = {}, conventions(rig)
    known = _weights(balance.trials)
    for p, plane in enumerate(balance.planes):
        side, sense = plane.name, plane.sense
        before, having = balance.trials.before[p], balance.trials.having[p]
        scatter = [balance_scatter.of_read(f"{r.name}/{len(r.reads) - 1}", r.fastest, 4) for r in (before, having)]
        for k, axis in enumerate(machine.axes):
            parts, name = [scatter[n][2 * k + j] for n in (0, 1) for j in (0, 1)], machine.position(axis)
            inputs = {"a": parts[0], "b": parts[1], "c": parts[2], "d": parts[3], "kg": known[f"kg_{p}"],
                      "angle": known[f"angle_{p}"], "radius": plane.radius,
                      "gain": certified(f"sensors/{name}/gain", rig.sensors[name].gain, f"gain of {name}")}  # fmt: skip

            def model(v: dict[str, float], by: int = sense) -> dict[str, float]:
                u = v["kg"] * v["radius"] * v["gain"] * np.exp(1j * by * v["angle"])
                z = complex((v["c"] - v["a"] + 1j * (v["d"] - v["b"])) / u)
                return {"cos": z.real, "sin": -z.imag}

            found = propagate(model, inputs)
            out[axis, side] = tuple(
                Estimate(found[n].value, "m/(kg m)", found[n].sensitivities) for n in ("cos", "sin")
            )
    return out  # type: ignore[return-value]


def balance_forces(d: Dwell, off: Complex, rig: RigFile, known: Known) -> ForceBalance:
    """The balance of forces of one dwell, with a runout (4,) m and what is known of the bearings."""
    read, inputs = read_dwell(d), bearings.collect_inputs(rig, known)
    s = Stand.of({name: e.value for name, e in inputs.items()})
    _, misfit = runout.unbalances(s, read.turning, off)
    may = allowed(misfit, d, inputs, [Estimate.exact(float(x), "m") for x in off.view(float)])
    return ForceBalance(d, misfit, may, carried(rig, inputs, read.means))
