"""Force constants and offsets with their influences, from positions and certificates, and the comparison of T Table 2.2."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.recording import Recording
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence, correlation_matrix
from procedures.estimators import bearing
from procedures.estimators.bearing import AXES, COILS, AxisFit, Positions, Statics
from procedures.estimators.bearing_data import Held
from procedures.estimators.chainrule import linearised
from procedures.estimators.inputs import certified
from procedures.estimators.typea import scatter

Array = npt.NDArray[np.float64]
BEARINGS = {"i": "inboard", "o": "outboard"}
LENGTHS = {"l_is": "com_to_inboard_sensor", "l_os": "com_to_outboard_sensor", "l_oa": "com_to_outboard_amb",
           "amb_span": "amb_span", "l_c": "com_to_coupling", "gap": "amb_gap"}  # fmt: skip


@dataclass(frozen=True)
class Analysis:
    """Everything the measurements, findings and figures are made of.

    `noise_N` is the standard deviation of a sample's and of a batch's force within its step, by axis; `gaps` what each
    axis alone asks for, `drawing` what the certificate says, `gap` all together (m); `samples` how many there are.
    """

    held: Held
    statics: Statics
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
    """Fits with their influences; `estimates` by quantity and axis."""
    inputs = fit_inputs(recording.rig, recording.plan.coupled)
    means, parts, samples = held.means(), held.parts(), held.samples()
    drawing = inputs["gap"]
    gaps = gap_estimates(means, inputs)
    inputs["gap"] = together([drawing, *gaps.values()])
    values = {name: e.value for name, e in inputs.items()}

    def model(p: dict[str, float]) -> dict[str, float]:
        return outputs(means, parts, samples, p)

    s = bearing.statics(means, values)
    fits = {a: bearing.axis_fit(s, k, values["gap"]) for k, a in enumerate(AXES)}
    estimates = linearised(model, inputs)
    count = len(held.of_step)
    noise = {a: _noise(held, values, k, fits[a]) for k, a in enumerate(AXES)}
    for a, f in fits.items():
        extra = scatter(honest(f, noise[a][1], held.batches["pos_yi"].shape[1]),
                        {f"beta_{a}": [1, 0], f"offset_{a}": [0, 1]}, f"bearing-model/{a}",
                        f"scatter of the positions, {a}")  # fmt: skip
        extra |= scatter(f.linear, {f"k_linear_{a}": [1, 0], f"stiffness_linear_{a}": [0, 1]}, f"bearing-model/linear/{a}",
                         f"scatter of the linear fit, {a}")  # fmt: skip
        extra |= of_sums(a, estimates, noise[a], held)
        estimates |= {name: estimates[name] + e for name, e in extra.items()}
    estimates |= by_bearing(estimates)
    return Analysis(held, s, fits, values, estimates, noise, gaps, drawing, inputs["gap"], recording.plan.bias_A, count)


def by_bearing(e: dict[str, Estimate]) -> dict[str, Estimate]:
    """The comparison with the linear model by AMB, as T Table 2.2: its slopes' means over both axes, sums of squares of
    both."""
    out = {}
    for b, where in BEARINGS.items():
        y, z = f"y{b}", f"z{b}"
        for k in ("k_linear", "stiffness_linear"):
            out[f"{k}_{where}"] = (e[f"{k}_{y}"] + e[f"{k}_{z}"]) * 0.5
        total = {k: e[f"{k}_{y}"] + e[f"{k}_{z}"] for k in ("misfit", "misfit_linear", "quiet", "quiet_linear")}
        out |= {f"{k}_{where}": total[k] for k in ("misfit", "misfit_linear")}
        out[f"misfit_ratio_{where}"] = total["misfit_linear"] / total["misfit"]
        out[f"misfit_ratio_means_{where}"] = total["quiet_linear"] / total["quiet"]
    return out


def gap_estimates(means: Positions, inputs: dict[str, Estimate]) -> dict[str, Estimate]:
    """The gap that each axis alone asks for beside its beta and offset, with every influence; the drawing's is no input."""
    nominal = inputs["gap"].value
    given = inputs | {"gap": Estimate.exact(nominal)}
    first = bearing.statics(means, {k: e.value for k, e in given.items()})
    starts = [bearing.axis_fit(first, k, nominal).fit.terms for k in range(4)]

    def model(p: dict[str, float]) -> dict[str, float]:
        s = bearing.statics(means, p)
        return {a: float(bearing.with_gap(s, k, starts[k], nominal).terms[2]) for k, a in enumerate(AXES)}

    found = linearised(model, given)
    for k, a in enumerate(AXES):
        fit = bearing.with_gap(first, k, starts[k], nominal)
        found[a] = found[a] + scatter(fit, {a: [0, 0, 1]}, f"bearing-model/gap/{a}", f"scatter of the gap, {a}")[a]
    return found


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


def outputs(means: Positions, parts: Positions, samples: Positions, p: dict[str, float]) -> dict[str, float]:
    """Every value by quantity and axis: terms from the steps' means, sums of squares over all samples as in T Table 2.2,
    and their ratio over batch means too."""
    s, b, quiet = (bearing.statics(x, p) for x in (means, samples, parts))
    out: dict[str, float] = {}
    for k, a in enumerate(AXES):
        f = bearing.axis_fit(s, k, p["gap"])
        one, two = (float(x @ x) for x in residuals(b, k, f, p["gap"]))
        low, high = (float(x @ x) for x in residuals(quiet, k, f, p["gap"]))
        out |= {
            f"beta_{a}": f.beta,
            f"offset_{a}": f.offset,
            f"k_linear_{a}": float(f.linear.terms[0]),
            f"stiffness_linear_{a}": float(f.linear.terms[1]),
            f"misfit_{a}": one,
            f"misfit_linear_{a}": two,
            f"misfit_ratio_{a}": two / one,
            f"misfit_ratio_means_{a}": high / low,
            f"quiet_{a}": low,
            f"quiet_linear_{a}": high,
        }
    return out


def residuals(b: Statics, k: int, f: AxisFit, gap: float) -> tuple[Array, Array]:
    """What each model gives more than the force that carries, N."""
    r, p, n = b.r[k], b.p[k], b.n[k]
    one = bearing.magnet(f.beta, f.offset, gap, r, p, n) - b.force[k]
    two = f.linear.terms[0] * (p - n) / 2 + f.linear.terms[1] * r - b.force[k]
    return one, two


def _noise(held: Held, values: dict[str, float], k: int, f: AxisFit) -> tuple[float, float]:
    """Standard deviations of a sample's and of a batch's residual force about its step's mean, N."""
    one = residuals(bearing.statics(held.samples(), values), k, f, values["gap"])[0]
    mean = np.bincount(held.of_step, one) / np.bincount(held.of_step)
    sample = math.sqrt(float(((one - mean[held.of_step]) ** 2).sum()) / (len(one) - len(held)))
    batch = residuals(bearing.statics(held.parts(), values), k, f, values["gap"])[0].reshape(len(held), -1)
    return sample, float(np.sqrt(batch.var(axis=1, ddof=1).mean()))


def honest(f: AxisFit, noise_N: float, batches: int) -> Any:
    """The fit with a covariance that is at least what the batches say."""
    residual = math.sqrt(f.fit.chi2 / f.fit.dof)
    more = max(1.0, noise_N / math.sqrt(batches) / max(residual, 1e-12))
    return replace(f.fit, covariance=f.fit.covariance * more**2)


def of_sums(a: str, e: dict[str, Estimate], noise_N: tuple[float, float], held: Held) -> dict[str, Estimate]:
    """What noise does to sums of squares S over n samples in batches of b, whose means scatter by s_b and samples by s:
    u^2 = 4 b s_b^2 (S - n s^2) + 2 n b s_b^2 s^2."""
    (sample, batch), n = noise_N, len(held.of_step)
    each = n / held.batches["pos_yi"].size

    def spread(total: float) -> float:
        return math.sqrt(each * batch**2 * (4 * max(total - n * sample**2, 0) + 2 * n * sample**2))

    values = {k: e[f"{k}_{a}"].value for k in ("misfit", "misfit_linear", "misfit_ratio")}
    u = {k: spread(values[k]) for k in ("misfit", "misfit_linear")}
    u["misfit_ratio"] = values["misfit_ratio"] * math.hypot(*(x / values[k] for k, x in u.items()))

    def noise(k: str) -> Influence:
        return Influence(
            f"scatter/bearing-model/{k}/{a}",
            f"noise of the samples, {a}",
            u[k],
            "1",
            "A",
            "normal",
            source="batch means",
        )

    u["misfit_ratio_means"] = e[f"misfit_ratio_means_{a}"].value * math.sqrt(2 / held.batches["pos_yi"].size)
    return {f"{k}_{a}": Estimate.of(0.0, noise(k)) for k in u}


def fit_inputs(rig: RigFile, coupled: bool) -> dict[str, Estimate]:
    """What the fits need besides the positions: certificates of the rig file as influences by identity."""
    g, m = rig.geometry, rig.machine
    inputs = {"mass": certified("machine/mass", m["mass"], "mass of the shaft"),
              "axes": certified("machine/radial_axes", m["radial_axes"], "angle of the axes to the vertical"),
              "gravity": certified("site/gravity", rig.site.gravity, "gravity")}  # fmt: skip
    inputs |= {key: certified(f"geometry/{name}", g[name], name.replace("_", " ")) for key, name in LENGTHS.items()}
    spring = certified("geometry/coupling_stiffness", g["coupling_stiffness"], "stiffness of the coupling")
    inputs["coupling"] = spring if coupled else Estimate.exact(0.0)
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
