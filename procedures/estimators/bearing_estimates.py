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


@dataclass(frozen=True)
class Sums:
    """Residual sums of one axis, N^2, apart from what the steps' means leave: over single samples and over batch means, each of
    the nonlinear and the linear model. `count` (N,) samples and `batches` a step; `noise_N` as in `Analysis`.

    Only the means answer to a wrong gain or length by an amount that counts; so what is within the steps is summed once.
    """

    within: tuple[float, float]
    within_batches: tuple[float, float]
    count: Array
    batches: int
    noise_N: tuple[float, float]

    @staticmethod
    def of(held: Held, values: dict[str, float], k: int, f: AxisFit) -> Sums:
        """Of axis `k`."""
        gap, steps = values["gap"], len(held)
        means = residuals(bearing.statics(held.means(), values), k, f, gap)
        singles = residuals(bearing.statics(held.samples(), values), k, f, gap)
        batches = residuals(bearing.statics(held.parts(), values), k, f, gap)
        count = np.bincount(held.of_step).astype(float)
        each = held.batches["pos_yi"].shape[1]
        own = np.bincount(held.of_step, singles[0]) / count
        sample = math.sqrt(float(((singles[0] - own[held.of_step]) ** 2).sum()) / (len(singles[0]) - steps))
        batch = float(np.sqrt(batches[0].reshape(steps, each).var(axis=1, ddof=1).mean()))
        one, two = (float(x @ x - count @ m**2) for x, m in zip(singles, means, strict=True))
        low, high = (float(x @ x - each * (m @ m)) for x, m in zip(batches, means, strict=True))
        return Sums((one, two), (low, high), count, each, (sample, batch))


def evaluate(recording: Recording[Any], held: Held) -> Analysis:
    """Fits with their influences; `estimates` by quantity and axis."""
    inputs = fit_inputs(recording.rig, recording.plan.coupled)
    means = held.means()
    drawing = inputs["gap"]
    gaps = gap_estimates(means, inputs)
    inputs["gap"] = together([drawing, *gaps.values()])
    values = {name: e.value for name, e in inputs.items()}
    s = bearing.statics(means, values)
    fits = {a: bearing.axis_fit(s, k, values["gap"]) for k, a in enumerate(AXES)}
    sums = {a: Sums.of(held, values, k, fits[a]) for k, a in enumerate(AXES)}

    def model(p: dict[str, float]) -> dict[str, float]:
        return outputs(means, fits, sums, p)

    estimates = linearised(model, inputs)
    for a, f in fits.items():
        estimates |= {name: estimates[name] + e for name, e in type_a(a, f, sums[a], estimates, held).items()}
    estimates |= by_bearing(estimates)
    noise = {a: sums[a].noise_N for a in AXES}
    count = len(held.of_step)
    return Analysis(held, s, fits, values, estimates, noise, gaps, drawing, inputs["gap"], recording.plan.bias_A, count)


def type_a(a: str, f: AxisFit, sums: Sums, estimates: dict[str, Estimate], held: Held) -> dict[str, Estimate]:
    """What scatter does to each value of axis `a`; to be added."""
    fit = honest(f, sums.noise_N[1], held.batches["pos_yi"].shape[1])
    terms = {f"beta_{a}": [1, 0], f"offset_{a}": [0, 1]}
    slopes = {f"k_linear_{a}": [1, 0], f"stiffness_linear_{a}": [0, 1]}
    return {
        **scatter(fit, terms, f"bearing-model/{a}", f"scatter of the positions, {a}"),
        **scatter(f.linear, slopes, f"bearing-model/linear/{a}", f"scatter of the linear fit, {a}"),
        **of_sums(a, estimates, sums.noise_N, held),
    }


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
    fits = [bearing.with_gap(first, k, starts[k], nominal) for k in range(4)]

    def model(p: dict[str, float]) -> dict[str, float]:
        s = bearing.statics(means, p)
        return {a: float(bearing.nearby(s, k, fits[k].terms, nominal)[2]) for k, a in enumerate(AXES)}

    found = linearised(model, given)
    for k, a in enumerate(AXES):
        found[a] = found[a] + scatter(fits[k], {a: [0, 0, 1]}, f"bearing-model/gap/{a}", f"scatter of the gap, {a}")[a]
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


def outputs(means: Positions, fits: dict[str, AxisFit], sums: dict[str, Sums], p: dict[str, float]) -> dict[str, float]:
    """Every value by quantity and axis, near the `fits`: terms from the steps' means, sums of squares over all samples as in
    T Table 2.2, and their ratio over batch means too."""
    s = bearing.statics(means, p)
    out: dict[str, float] = {}
    for k, a in enumerate(AXES):
        w, beta_offset = sums[a], bearing.nearby(s, k, fits[a].fit.terms, p["gap"])
        slopes = bearing.linear_terms(s.r[k], s.p[k], s.n[k], s.force[k])
        left = _left(s, k, beta_offset, slopes, p["gap"])
        one, two = (float(w.count @ x**2) + own for x, own in zip(left, w.within, strict=True))
        low, high = (w.batches * float(x @ x) + own for x, own in zip(left, w.within_batches, strict=True))
        out |= {
            f"beta_{a}": float(beta_offset[0]),
            f"offset_{a}": float(beta_offset[1]),
            f"k_linear_{a}": float(slopes[0]),
            f"stiffness_linear_{a}": float(slopes[1]),
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
    return _left(b, k, f.fit.terms, f.linear.terms, gap)


def _left(b: Statics, k: int, beta_offset: Array, slopes: Array, gap: float) -> tuple[Array, Array]:
    r, p, n = b.r[k], b.p[k], b.n[k]
    one = bearing.magnet(beta_offset[0], beta_offset[1], gap, r, p, n) - b.force[k]
    return one, slopes[0] * (p - n) / 2 + slopes[1] * r - b.force[k]


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
