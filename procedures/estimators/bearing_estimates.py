"""Force constants and offsets with their influences, from positions and certificates."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording import Recording
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, correlation_matrix
from procedures.estimators import bearing, bearing_compared
from procedures.estimators.bearing import AXES, COILS, AxisFit, Positions, Statics
from procedures.estimators.bearing_compared import Sums
from procedures.estimators.bearing_data import Held
from procedures.estimators.chainrule import linearised
from procedures.estimators.inputs import certified
from procedures.estimators.leastsquares import Fit
from procedures.estimators.typea import scatter

Array = npt.NDArray[np.float64]
LENGTHS = {"l_is": "com_to_inboard_sensor", "l_os": "com_to_outboard_sensor", "l_oa": "com_to_outboard_amb",
           "amb_span": "amb_span", "l_c": "com_to_coupling", "gap": "amb_gap"}  # fmt: skip
WORTH = 3.0  # times the drawing's uncertainty; a gap that is known worse says nothing


@dataclass(frozen=True)
class Analysis:
    """Everything the measurements, findings and figures are made of.

    `statics` of all positions and `compared` of those at `bias_A`, which both models are compared on; `noise_N` is the
    standard deviation of a sample's and of a batch's force within its step, by axis; `gaps` what an axis alone asks for,
    `drawing` what the certificate says, `gap` all together (m); `samples` how many there are in the comparison.
    """

    held: Held
    statics: Statics
    compared: Statics
    fits: dict[str, AxisFit]
    values: dict[str, float]
    estimates: dict[str, Estimate]
    noise_N: dict[str, tuple[float, float]]
    gaps: dict[str, Estimate]
    drawing: Estimate
    gap: Estimate
    bias_A: float
    samples: int


def evaluate(recording: Recording[Any], held: Held) -> Analysis:
    """Fits with their influences; `estimates` by quantity and axis, of the comparison by quantity and AMB."""
    bias = recording.plan.biases_A[0]
    chosen = held.chosen(held.labels["bias_A"] == bias)
    inputs = fit_inputs(recording.rig, recording.plan.coupled)
    means, part = held.means(), chosen.means()
    drawing = inputs["gap"]
    gaps = gap_estimates(means, inputs)
    inputs["gap"] = together([drawing, *gaps.values()])
    values = {name: e.value for name, e in inputs.items()}
    s, compared = bearing.statics(means, values), bearing.statics(part, values)
    fits = {a: bearing.axis_fit(s, compared, k, values["gap"]) for k, a in enumerate(AXES)}

    def model(p: dict[str, float]) -> dict[str, float]:
        return outputs(means, part, fits, p)

    estimates = linearised(model, inputs)
    sums = {a: Sums.of(chosen, values, k, fits[a]) for k, a in enumerate(AXES)}
    for a, f in fits.items():
        estimates |= {name: estimates[name] + e for name, e in type_a(a, f, sums[a].noise_N[1], held).items()}
        estimates |= sums[a].estimates(a)
    estimates |= bearing_compared.by_bearing(estimates)
    noise = {a: sums[a].noise_N for a in AXES}
    count = len(chosen.of_step)
    return Analysis(held, s, compared, fits, values, estimates, noise, gaps, drawing, inputs["gap"], bias, count)


def type_a(a: str, f: AxisFit, noise_N: float, held: Held) -> dict[str, Estimate]:
    """What scatter does to each value of axis `a`, to be added; `noise_N` of a batch."""
    fit = honest(f, noise_N, held.batches["pos_yi"].shape[1])
    terms = {f"beta_{a}": [1, 0], f"offset_{a}": [0, 1]}
    slopes = {f"k_linear_{a}": [1, 0], f"stiffness_linear_{a}": [0, 1]}
    return {
        **scatter(fit, terms, f"bearing-model/{a}", f"scatter of the positions, {a}"),
        **scatter(f.linear, slopes, f"bearing-model/linear/{a}", f"scatter of the linear fit, {a}"),
    }


def gap_estimates(means: Positions, inputs: dict[str, Estimate]) -> dict[str, Estimate]:
    """The gap that an axis alone asks for beside its beta and offset, with every influence; the drawing's is no input.

    At some bias the three act alike and nothing is told of the gap; an axis that says less than WORTH is left out.
    """
    drawing = inputs["gap"]
    given = inputs | {"gap": Estimate.exact(drawing.value)}
    first = bearing.statics(means, {k: e.value for k, e in given.items()})
    fits = {k: fit for k in range(len(AXES)) if (fit := _with_gap(first, k, drawing.value))}

    def model(p: dict[str, float]) -> dict[str, float]:
        s = bearing.statics(means, p)
        return {AXES[k]: float(bearing.nearby(s, k, fit.terms, drawing.value)[2]) for k, fit in fits.items()}

    found = linearised(model, given)
    for k, fit in fits.items():
        a = AXES[k]
        found[a] = found[a] + scatter(fit, {a: [0, 0, 1]}, f"bearing-model/gap/{a}", f"scatter of the gap, {a}")[a]
    return {a: e for a, e in found.items() if e.u < WORTH * drawing.u}


def _with_gap(s: Statics, k: int, nominal: float) -> Fit | None:
    try:
        return bearing.with_gap(s, k, bearing.nonlinear(s.r[k], s.p[k], s.n[k], s.force[k], nominal).terms, nominal)
    except AnalysisError:
        return None


def together(estimates: list[Estimate]) -> Estimate:
    """The combination of least variance of estimates of one number, what they share considered; each has a weight of at least
    zero, so that a strong correlation does not take the result outside of them."""
    u = np.array([e.u for e in estimates])
    covariance = np.array(correlation_matrix(estimates)) * np.outer(u, u)
    use = np.ones(len(u), bool)
    while True:
        weights = np.zeros(len(u))
        solved = np.linalg.solve(covariance[np.ix_(use, use)], np.ones(int(use.sum())))
        weights[use] = solved / solved.sum()
        if (weights >= 0).all():
            break
        use &= weights > 0
    total = Estimate.exact(0.0)
    for w, e in zip(weights, estimates, strict=True):
        if w > 0:
            total = total + e * float(w)
    return total


def outputs(means: Positions, part: Positions, fits: dict[str, AxisFit], p: dict[str, float]) -> dict[str, float]:
    """The terms of both models by quantity and axis, near the `fits`; `part` is what the linear model is fitted to."""
    s, compared = bearing.statics(means, p), bearing.statics(part, p)
    out: dict[str, float] = {}
    for k, a in enumerate(AXES):
        terms = bearing.nearby(s, k, fits[a].fit.terms, p["gap"])
        slopes = bearing.linear_terms(compared.r[k], compared.p[k], compared.n[k], compared.force[k])
        out |= {f"beta_{a}": float(terms[0]), f"offset_{a}": float(terms[1])}
        out |= {f"k_linear_{a}": float(slopes[0]), f"stiffness_linear_{a}": float(slopes[1])}
    return out


def honest(f: AxisFit, noise_N: float, batches: int) -> Any:
    """The fit with a covariance that is at least what the batches say."""
    residual = math.sqrt(f.fit.chi2 / f.fit.dof)
    more = max(1.0, noise_N / math.sqrt(batches) / max(residual, 1e-12))
    return replace(f.fit, covariance=f.fit.covariance * more**2)


def fit_inputs(rig: RigFile, coupled: bool) -> dict[str, Estimate]:
    """What the fits need besides the positions: certificates of the rig file as influences by identity."""
    g, m = rig.geometry, rig.machine
    inputs = {"mass": certified("machine/mass", m["mass"], "mass of the shaft"),
              "axes": certified("machine/radial_axes", m["radial_axes"], "angle of the axes to the vertical"),
              "gravity": certified("site/gravity", rig.site.gravity, "gravity")}  # fmt: skip
    inputs |= {key: certified(f"geometry/{name}", g[name], name.replace("_", " ")) for key, name in LENGTHS.items()}
    spring = certified("geometry/coupling_stiffness", g["coupling_stiffness"], "stiffness of the coupling")
    inputs["coupling"] = spring if coupled else Estimate.exact(0.0)
    for d in "yz":
        name = f"machine/coupling_offset/{d}"
        inputs[f"relaxed_{d}"] = certified(name, m["coupling_offset"], f"where the coupling is relaxed, {d}")
    for a in AXES:
        sensor, name = rig.sensors[f"pos_{a}"], f"sensors/pos_{a}"
        inputs[f"gain_{a}"] = certified(f"{name}/gain", sensor.gain, f"gain of pos_{a}")
        inputs[f"zero_{a}"] = certified(f"{name}/offset", sensor.offset, f"zero of pos_{a}")
        inputs[f"runout_{a}"] = certified(
            f"machine/runout/{a}", m["runout"], f"runout of pos_{a} where the shaft rests"
        )
    for c in COILS:
        sensor, name = rig.sensors[f"i_{c}"], f"sensors/i_{c}"
        inputs[f"gain_{c}"] = certified(f"{name}/gain", sensor.gain, f"gain of i_{c}")
        inputs[f"offset_{c}"] = certified(f"{name}/offset", sensor.offset, f"offset of i_{c}")
    return inputs
