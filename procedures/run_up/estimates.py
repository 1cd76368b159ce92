"""From a passage to estimates: vectors at the captures' speeds, critical speeds and amplification factors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.analysis import transient
from bench.analysis.criticals import Critical, moved
from bench.analysis.peaks import Smoother
from bench.analysis.vectors import complexes, estimates, parts
from bench.recording import Recording
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from bench.uncertainty.estimate import merged
from procedures.run_up import linear_model
from procedures.run_up.line import Line
from procedures.run_up.plan import Passing
from procedures.run_up.steps import Curve, Passage, curve, near
from procedures.synchronous import bearings, facts, identified
from procedures.synchronous import estimates as dwell_estimates
from procedures.synchronous.dwells import Dwell
from procedures.synchronous.estimates import Result, Results, Runout
from procedures.synchronous.runout import Stand

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
DAMPED = 2.5  # amplification factor under which API 617 sees no critical speed
UNITS = {"speed": "rad/s", "amplitude": "m", "factor": "1"}
LAG = "what is left of the lag of the response"
BEND = "what is left of the size of the orbit"
LEFT = {LAG: "lag", BEND: "bend"}
HARMONICS = "harmonics"
BENDING = (*(f"{name}_{k}" for name in ("beta", "offset", "zero", "gain") for k in range(4)), "gap", "mass", "inertia",
           "l_ia", "l_oa", "l_is", "l_os")  # fmt: skip
PLACED = (
    *BENDING[:16],
    "mass",
    "inertia",
    *(f"{name}_{k}" for name in ("gap", "at_axis", "at_probe") for k in range(4)),
)
"""What the bend of the forces rests on; what else there is of it changes it by less than a twentieth."""


@dataclass(frozen=True)
class Peak:
    """A greatest amplitude at a probe: `speed` rad/s, `factor` (None where half power lies outside the record), `amplitude` m
    0-pk, `margin` from the running speed; half-power speeds `low`, `high`; by how much
    the lag of the passage and the size of the orbit had moved the speed, `lagged` and `bent` rad/s, which is taken off."""

    axis: str
    number: int
    speed: Estimate
    amplitude: Estimate
    factor: Estimate | None
    margin: Estimate
    low: float
    high: float
    lagged: float
    bent: float

    @property
    def critical(self) -> bool:
        """API: an amplification factor of 2.5 or more; one that may be so counts."""
        return self.factor is not None and self.factor.value + 2 * self.factor.u >= DAMPED

    @property
    def where(self) -> str:
        """How it is named to the reader."""
        return f"{self.axis}, peak {self.number}"


@dataclass(frozen=True)
class Run:
    """A passage with its curve; `shaft` (4, b) vectors of the shaft's centre, lag taken off; `peaks` of all probes, and the
    speeds rad/s, by axis, of `bumps` that noise may have made; what the turns about the captures' speeds say, None where none
    was passed; what is `known` of the bearings."""

    passage: Passage
    curve: Curve
    shaft: Complex
    peaks: tuple[Peak, ...]
    near: Results | None
    slow: Dwell | None
    known: bearings.Known
    clearance: float = field(default=math.nan)
    bumps: Mapping[str, tuple[float, ...]] = field(default_factory=dict)


def run(passage: Passage, slow: Dwell | None, recording: Recording[Any], plan: Passing, known: bearings.Known) -> Run:
    """All estimates of a passage, with what is known of the bearings."""
    rig = recording.rig
    found = curve(passage, plan.blocks)
    passed = [n for s in sorted(plan.speeds_rad_s) if (n := near(passage, recording, s, plan.law)) is not None]
    clearance = facts.clearance(rig).value
    if not passed:
        return Run(passage, found, found.values[:4], (), None, slow, known, clearance)
    dwells, left = [], []
    models = [transient.local(found.speed, found.values[k], found.covariance[k]) for k in range(12)]
    for dwell, width in passed:
        still, rest = _still(found, models, dwell, width)
        dwells.append(still)
        left.append(rest)
    known = identified.of_dwells([*([] if slow is None else [slow]), *dwells], rig, known)
    results = dwell_estimates.results([*([] if slow is None else [slow]), *dwells], rig, known)
    results = replace(results, dwells=tuple(_with(r, rest) for r, rest in zip(results.dwells, left, strict=True)))
    inputs = bearings.collect_inputs(rig, known)
    large = _large(found, inputs, results.runouts, plan.law, gains(rig, plan))
    shaft, peaks, bumps = [], [], {}
    for k, axis in enumerate(passage.machine.axes):
        line = Line(found, k, axis, inputs[f"gain_{k}"].value, results.runouts[1.0])
        series = line.series()
        shaft.append(series[-1])
        told = line.criticals(series[-1] - large[""][k])
        certain = [c for c in told if c.certain]
        bumps[axis] = tuple(c.speed for c in told if not c.certain)
        peaks += _peaks(
            line, certain, series, {name: bent[k] for name, bent in large.items()}, inputs, plan.running_rad_s
        )
    return Run(passage, found, np.array(shaft), tuple(peaks), results, slow, known, clearance, bumps)


def bending(inputs: Mapping[str, Estimate]) -> tuple[str, ...]:
    """Names of what the bend of the forces rests on: lengths as the rig file tells them."""
    return BENDING if "gap" in inputs else PLACED


def gains(rig: RigFile, plan: Passing) -> dict[str, float]:
    """The controller's parameters while the speeds are passed, SI, by name."""
    return {name: p.default for name, p in rig.parameters.items()} | dict(plan.parameters)


def _large(
    c: Curve, inputs: Mapping[str, Estimate], runouts: Mapping[float, Runout], law: str, set_to: Mapping[str, float]
) -> dict[str, Complex]:
    """What large orbits add to the shaft's vectors (4, b) m, under ""; under the name of each of the `BENDING` inputs, if that
    is off by its standard uncertainty; under `HARMONICS`, without the second harmonics."""
    values, off = {name: e.value for name, e in inputs.items()}, {n: runouts[n].values for n in (1.0, 2.0)}
    changed = {"": values} | {name: values | {name: values[name] + inputs[name].u} for name in bending(inputs)}
    bends = {name: linear_model.bend(Stand.of(v), c, off, law, set_to) for name, v in changed.items()}
    once = replace(c, second=np.full_like(c.second, np.nan))
    return bends | {HARMONICS: linear_model.bend(Stand.of(values), once, off, law, set_to)}


def _peaks(
    line: Line,
    found: Sequence[Critical],
    series: Sequence[Complex],
    large: Mapping[str, Complex],
    inputs: Mapping[str, Estimate],
    running: float,
) -> list[Peak]:
    """What was found of small orbits, with the influences of the scatter, of the runout, of the probe's gain, of what the
    bearings' bend rests on, and of what is left of the lag and of that bend: no more than what the last term of the one and the
    second harmonics in the other change. The amplitude is that of the orbit as it was."""
    axis, gain, out = line.axis, inputs[f"gain_{line.k}"], []
    raw, once, best = (z - large[""] for z in series)
    runout = [
        (p, p.u * (1j if j else 1.0)) for j, p in enumerate(line.runout.parts[2 * line.k : 2 * line.k + 2]) if p.u
    ]
    parts_ = [p for p, _ in runout] + [inputs[name] for name in bending(inputs)]
    others = [series[-1], raw, once, series[-1] - large[HARMONICS]]
    others += [*(best - u for _, u in runout), *(series[-1] - large[name] for name in bending(inputs))]
    speeds = line.found.speed
    for number, c in enumerate(found, 1):
        where = f"{axis}/{number}"
        (as_it_was, before, lag, bend, *shifts) = moved(speeds, best, others, line.spread, c)[1]
        slopes = [(part, shift / part.u) for part, shift in zip(parts_, shifts, strict=True) if part.u]
        numbers = {"speed": c.speed, "amplitude": c.amplitude + float(as_it_was[1]), "factor": c.factor}
        made, scattered = {}, scatter_of(c, where, line.dof(c.speed))
        for j, (name, value) in enumerate(numbers.items()):
            of_bend = name != "amplitude"
            left = {LAG: float(lag[j]), BEND: float(bend[j]) if of_bend else 0.0}
            terms = [(part, float(m[j])) for part, m in (slopes if of_bend else slopes[: len(runout)])]
            made[name] = _number(where, name, value, scattered.get(name), left, terms)
        speed, amplitude = made["speed"], made["amplitude"]
        if speed is None or amplitude is None:
            continue
        amplitude = Estimate(amplitude.value, "m", merged([(1.0, amplitude), (-amplitude.value / gain.value, gain)]))
        margin = Estimate(
            abs(c.speed - running) / running, "1", merged([(math.copysign(1 / running, c.speed - running), speed)])
        )
        passed_by, bent_by = float(before[0]), float(as_it_was[0])
        out.append(Peak(axis, number, speed, amplitude, made["factor"], margin, c.low, c.high, passed_by, bent_by))
    return out


def scatter_of(c: Critical, where: str, dof: float) -> dict[str, Estimate]:
    """Zero, with the scatter of a critical's speed, amplitude and, where it has one, factor: one covariance, `dof` of it."""
    names = [name for name, v in zip(UNITS, np.diag(c.covariance), strict=False) if math.isfinite(v)]
    covariance = c.covariance[: len(names), : len(names)]
    made = estimates(np.zeros(len(names)), covariance, f"scatter/{where}", "scatter of the passage", "", dof)
    return dict(zip(names, made, strict=True))


def _number(
    where: str,
    name: str,
    value: float,
    scatter: Estimate | None,
    left: Mapping[str, float],
    moved: Sequence[tuple[Estimate, float]],
) -> Estimate | None:
    """A number of a critical with its influences; None where the record does not give it."""
    unit = UNITS[name]
    if scatter is None or not math.isfinite(value + sum(left.values())):
        return None
    rests = [
        Influence(f"{LEFT[what]}/{where}/{name}", what, abs(half) / math.sqrt(3), unit, "B", "rectangular")
        for what, half in left.items()
    ]
    terms = [(1.0, scatter), *((1.0, Estimate.of(0.0, influence)) for influence in rests)]
    terms += [(slope, part) for part, slope in moved if math.isfinite(slope)]
    return Estimate(value, unit, merged(terms))


def _still(c: Curve, models: Sequence[Smoother], dwell: Dwell, width: float) -> tuple[Dwell, Complex]:
    """The dwell's vectors as they would be if the speed stood, and what that leaves open (4,) m, of the probes."""
    shift = np.zeros(12, complex)
    left = np.zeros(4, complex)
    width_ = np.full(c.speed.size, width)
    for k in range(12):
        by = [sums - c.values[k] for sums in transient.series(models[k], c.speed, c.values[k], c.acceleration, width_)]
        shift[k] = _at(c.speed, by[2], dwell.speed)
        if k < 4:
            left[k] = _at(c.speed, by[1], dwell.speed) - shift[k]
    values = dwell.track.values.copy()
    values[0, :, 0] += shift
    return replace(dwell, track=replace(dwell.track, values=values)), left


def _at(speed: Array, values: Complex, where: float) -> complex:
    pairs = parts(values[:, None])
    return complex(complexes(np.array([np.interp(where, speed, p) for p in pairs.T]))[0])


def _with(r: Result, left: Complex) -> Result:
    """With what is left of the lag in the budget of the vectors and half axes."""
    out: dict[tuple[str, str], Estimate] = dict(r.estimates)
    for k, axis in enumerate(r.dwell.machine.axes):
        half = abs(left[k]) / math.sqrt(3)
        rest = Influence(f"lag/{r.dwell.where}/{axis}", LAG, half, "m", "B", "rectangular")
        for name in ("vector_cos", "vector_sin"):
            e = out[name, axis]
            out[name, axis] = Estimate(e.value, e.unit, merged([(1.0, e), (1.0, Estimate.of(0.0, rest))]), e.sampler)
    covariance = r.vectors.covariance + np.diag(np.repeat(np.abs(left) ** 2 / 3, 2))
    return replace(r, estimates=out, vectors=replace(r.vectors, covariance=covariance))


def asked_margin(peak: Peak, running: float) -> float:
    """Separation margin that API 617 asks for a critical of that factor, as a share of the running speed."""
    assert peak.factor is not None
    part = 0.17 * (1 - 1 / (max(peak.factor.value, DAMPED) - 1.5))
    return 0.1 + part if peak.speed.value > running else part
