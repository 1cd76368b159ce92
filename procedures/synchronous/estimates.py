"""From dwells to estimates with influences: probes' certificates, runout by the slow roll, scatter, tachometer."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.analysis.orbits import Ellipse, ellipse
from bench.analysis.vectors import Vectors, estimates
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence, propagate, propagate_stacked, welch_satterthwaite
from bench.uncertainty.estimate import merged
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.machine import AmbRotor
from procedures.synchronous import coil_peaks, facts, mark, runout
from procedures.synchronous.bearings import Known, collect_inputs
from procedures.synchronous.carrying import carried
from procedures.synchronous.d_max import farthest
from procedures.synchronous.dwells import ORDERS, SLOW, Dwell
from procedures.synchronous.nonsynchronous import beside_orders, folds
from procedures.synchronous.orbit_frame import as_orbit, covariance, squared, squaring
from procedures.synchronous.runout import Stand, Turning
from procedures.synchronous.unexplained import allowed

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class Runout:
    """Of one order: `parts` re, im of the four probes as Estimates (8,), `values` (4,) m, what the shaft did at slow roll
    `shaft` (4,), what the probes read there `reading` (4,); `known` by a slow roll."""

    parts: tuple[Estimate, ...]
    values: Complex
    shaft: Complex
    reading: Complex
    known: bool


@dataclass(frozen=True)
class ForceBalance:
    """Of a `dwell`: `misfit`, the share of the forces that two unbalances do not explain, and what is `allowed` of it;
    `carried` (4,), of what each axis should carry of the weight."""

    dwell: Dwell
    misfit: float
    allowed: float
    carried: Array


@dataclass(frozen=True)
class Result:
    """A dwell's estimates by name and place; `vectors` of the shaft's centre with their joint covariance; orbits by plane;
    `forces`, what their balance says;
    `beside` (2,) m, by plane what does not turn with the shaft; `folded`, the order that shows as order 1, and how much (4,) m.
    """

    dwell: Dwell
    vectors: Vectors
    orbits: Mapping[str, Ellipse]
    centres: Mapping[str, tuple[float, float]]
    forces: ForceBalance
    unbalance: Complex
    beside: Array
    folded: tuple[int, Array]
    estimates: Mapping[tuple[str, str], Estimate] = field(repr=False)


@dataclass(frozen=True)
class Results:
    """All dwells; runout by order; slow roll, None where there was none; the clearance m."""

    dwells: tuple[Result, ...]
    runouts: Mapping[float, Runout]
    slow: Dwell | None
    clearance: Estimate

    def of(self, variant: str) -> list[Result]:
        """Dwells with one setting, the slowest first, no repeats."""
        some = [r for r in self.dwells if r.dwell.variant == variant and not r.dwell.again]
        return sorted(some, key=lambda r: r.dwell.speed)

    @property
    def variants(self) -> list[str]:
        """In the order in which they were done."""
        return list(dict.fromkeys(r.dwell.variant for r in self.dwells))

    @property
    def machine(self) -> AmbRotor:
        """Whose dwells they are."""
        return self.dwells[0].dwell.machine


def results(dwells: Sequence[Dwell], rig: RigFile, known: Known) -> Results:
    """Estimates of every dwell, with what is known of the bearings."""
    slow = next((d for d in dwells if d.kind == SLOW), None)
    turning = [d for d in dwells if d.kind != SLOW]
    fast = max((d for d in turning if d.variant == turning[0].variant), key=lambda d: d.speed)
    inputs = collect_inputs(rig, known)
    nominal = Stand.of({name: e.value for name, e in inputs.items()})
    runouts = _runouts(inputs, rig, slow, fast)
    clearance = facts.clearance(rig)
    done = tuple(_result(d, inputs, nominal, runouts, clearance, rig) for d in turning)
    return Results(done, runouts, slow, clearance)


def _runouts(inputs: Mapping[str, Estimate], rig: RigFile, slow: Dwell | None, fast: Dwell) -> dict[float, Runout]:
    """By the slow roll and the forces; without one, nothing but what the rig file says of it."""
    orders = [n for n in ORDERS if slow is not None and n in slow.track.orders]
    lacking = {n: _unknown(rig, n) for n in ORDERS if n not in orders}
    if slow is None or not orders:
        return lacking
    high = Turning(fast.speed, fast.means, fast.both().values)
    read = {n: slow.both(n) for n in orders}
    scatter = {
        f"s{n:g}_{k}": e
        for n, v in read.items()
        for k, e in enumerate(
            estimates(v.parts, v.covariance, f"scatter/slow/{n:g}", "scatter at slow roll", "", v.dof)
        )
    }

    def at(v: Mapping[str, Any]) -> dict[float, Turning]:
        rows = {n: np.stack([v[f"s{n:g}_{k}"] for k in range(24)], axis=-1).view(complex) for n in orders}
        return {n: Turning(slow.speed, slow.means, row) for n, row in rows.items()}

    values = {name: e.value for name, e in {**inputs, **scatter}.items()}
    others = {n: Turning(fast.speed, fast.means, fast.both(n).values) for n in orders if n in fast.track.orders}
    more = runout.mixed_forces(
        Stand.of(values), at(values), others
    )  # so small that what is not known of it does not count

    names = _parts(conventions(rig))

    def model(v: dict[str, Array]) -> dict[str, Array]:
        made = runout.find_runout(Stand.of(v), at(v), high, more)
        return {f"{n:g}{p}": x for n in orders for p, x in zip(names, made.runout[n].view(float).T, strict=True)}

    out = propagate_stacked(model, {**inputs, **scatter})
    made = runout.find_runout(Stand.of(values), at(values), high, more)

    def of(n: float) -> Runout:
        parts = tuple(Estimate(out[f"{n:g}{p}"].value, "m", out[f"{n:g}{p}"].sensitivities) for p in names)
        return Runout(parts, made.runout[n], made.shaft[n], read[n].values[:4], known=True)

    return {**lacking, **{n: of(n) for n in orders}}


def _parts(machine: AmbRotor) -> list[str]:
    """Names of the components of the four probes' vectors."""
    return [f"{axis}{part}" for axis in machine.axes for part in ("re", "im")]


def _unknown(rig: RigFile, order: float) -> Runout:
    u, nothing = facts.runout_u(rig), np.zeros(4, complex)
    names = _parts(conventions(rig))
    some = [Influence(f"runout/{order:g}/{p}", "runout, no slow roll", u, "m", "B", "normal") for p in names]
    return Runout(tuple(Estimate.of(0.0, i) for i in some), nothing, nothing, nothing, known=False)


def _result(
    d: Dwell,
    inputs: Mapping[str, Estimate],
    nominal: Stand,
    runouts: Mapping[float, Runout],
    clearance: Estimate,
    rig: RigFile,
) -> Result:
    parts = {n: _shaft(d, inputs, runouts[n], n, rig) for n in d.track.orders if n in runouts}
    beside, folded = beside_orders(d), folds(d)
    parts[1.0] = _folded(d, parts[1.0], folded[1])
    values = np.array([parts[1.0][2 * k].value + 1j * parts[1.0][2 * k + 1].value for k in range(4)])
    vectors = Vectors(values, covariance(parts[1.0]), min(welch_satterthwaite(e) for e in parts[1.0]))
    u, misfit = runout.unbalances(nominal, Turning(d.speed, d.means, d.both().values), runouts[1.0].values)
    out: dict[tuple[str, str], Estimate] = {}
    orbits, centres = {}, {}
    for k, a in enumerate(d.machine.axes):
        out["vector_cos", a] = parts[1.0][2 * k]
        out["vector_sin", a] = -parts[1.0][2 * k + 1]
    for more, (plane, (y, z)) in zip(beside, d.machine.planes.items(), strict=True):
        chosen = [2 * y, 2 * y + 1, 2 * z, 2 * z + 1]
        across = squaring(nominal, (y, z))
        at = {n: squared([p[k] for k in chosen], across) for n, p in parts.items()}
        orbits[plane] = ellipse(as_orbit(vectors, (y, z), at[1.0], across), nominal.hand > 0)
        out["major_half_axis", plane] = _major(at[1.0])
        means = squared([_mean(d, inputs, k) for k in (y, z)], across)
        centres[plane] = (means[0].value, means[1].value)
        far = farthest(means, at, f"{d.where}/{plane}")
        far = _with_rest(far, float(more), f"{d.where}/{plane}")
        out["d_max", plane] = far
        out["d_max_share", plane] = _unit(far / clearance, "1")
        out |= coil_peaks.peaks(d, inputs, plane, rig)
    out["reading", ""] = _reading(d, inputs)
    may = allowed(misfit, d, inputs, runouts[1.0].parts)
    forces = ForceBalance(d, misfit, may, carried(rig, inputs, d.means))
    return Result(d, vectors, orbits, centres, forces, u, beside, folded, out)


def _shaft(d: Dwell, inputs: Mapping[str, Estimate], off: Runout, order: float, rig: RigFile) -> list[Estimate]:
    """Parts of the shaft's vectors (8,): reading over gain, less the runout; turned by what the angle may be off."""
    read = d.readings(order)
    scatter = estimates(
        read.parts, read.covariance, f"scatter/{d.where}/{order:g}", "scatter of the dwell", "m", read.dof
    )
    by = "tachometer/angle" if mark.by_angle(rig) else f"tachometer/{d.where}"
    angle = Estimate.of(0.0, Influence(by, "resolution of the angle", mark.angle_u(rig, d.speed), "rad", "B",
                                       "rectangular"))  # fmt: skip
    out = []
    for k in range(8):
        gain = inputs[f"gain_{k // 2}"]
        across = -read.parts[k + 1] if k % 2 == 0 else read.parts[k - 1]
        value = scatter[k].value / gain.value - off.parts[k].value
        terms = ((1 / gain.value, scatter[k]), (-scatter[k].value / gain.value**2, gain), (-1.0, off.parts[k]),
                 (order * across, angle))  # fmt: skip
        out.append(Estimate(value, "m", merged(terms)))
    return out


def _folded(d: Dwell, parts: Sequence[Estimate], off: Array) -> list[Estimate]:
    """With what a higher order that the telemetry takes for order 1 may add to each part, at an unknown phase."""
    out = []
    for k, e in enumerate(parts):
        size = float(off[k // 2])
        i = Influence(f"folded/{d.where}/{d.machine.axes[k // 2]}/{'ri'[k % 2]}", "higher order that shows as order 1",
                      size / math.sqrt(2), "m", "B", "arcsine")  # fmt: skip
        out.append(Estimate(e.value, "m", merged([(1.0, e), (1.0, Estimate.of(0.0, i))])) if size else e)
    return out


def _with_rest(far: Estimate, beside: float, where: str) -> Estimate:
    """D_max with the motion that does not turn with the shaft, m: it may add all of itself, or nothing."""
    if not beside:
        return far
    half = Influence(f"beside/{where}", "motion that does not turn with the shaft", beside / (2 * math.sqrt(3)), "m", "B",
                     "rectangular")  # fmt: skip
    return far + Estimate.of(beside / 2, half)


def _major(parts: Sequence[Estimate]) -> Estimate:
    def model(v: dict[str, float]) -> float:
        y, z = v["0"] + 1j * v["1"], v["2"] + 1j * v["3"]
        return abs(y + 1j * z) / 2 + abs(y - 1j * z) / 2

    return _unit(propagate(model, {str(k): e for k, e in enumerate(parts)}), "m")


def _mean(d: Dwell, inputs: Mapping[str, Estimate], k: int) -> Estimate:
    """Where the shaft is on the average, from the clearance's centre."""
    return _unit((inputs[f"zero_{k}"] * -1.0 + float(d.means[k])) / inputs[f"gain_{k}"], "m")


def _reading(d: Dwell, inputs: Mapping[str, Estimate]) -> Estimate:
    """Root mean square of the four probes' amplitudes, runout included."""
    read = d.readings()
    scatter = estimates(read.parts, read.covariance, f"scatter/{d.where}/1", "scatter of the dwell", "m", read.dof)
    size = math.sqrt(float((np.abs(read.values) ** 2).mean()))
    terms = [(float(p) / (4 * size), e) for p, e in zip(read.parts, scatter, strict=True)]
    terms += [(-float(abs(v) ** 2) / (4 * size), inputs[f"gain_{k}"]) for k, v in enumerate(read.values)]
    return Estimate(size, "m", merged(terms))


def _unit(e: Estimate, unit: str) -> Estimate:
    return Estimate(e.value, unit, e.sensitivities, e.sampler)
