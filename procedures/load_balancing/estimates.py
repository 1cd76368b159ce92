"""From turns to estimates with influences: sensors of the segments, adopted constants, scatter of the turns."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import numpy.typing as npt

from bench.recording import Recording
from bench.uncertainty import Estimate, Influence, propagate
from bench.uncertainty.estimate import Deviations, merged
from procedures.load_balancing import fit, inputs
from procedures.load_balancing.fit import Law
from procedures.load_balancing.plan import Plan
from procedures.load_balancing.steps import AFTER, BEFORE, FACTS_SEEN, LOADS_SEEN, Around, mean_currents, of_way
from procedures.shared.gradients import linearised

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Numbers = Mapping[str, float]
LINEAR = ("peak_i_y/before", "peak_i_y/after", "reduction", f"predicted/{LOADS_SEEN}", f"predicted/{FACTS_SEEN}")
RIPPLE = 0.025  # of the force with 16 times the angle, T (5.25)
ROUNDING = Influence(
    "resolution/gamma", "single precision of what is captured", 1e-8 / math.sqrt(3), "rad", "B", "rectangular"
)
"""All that is left of gamma at its bound. It takes a step of its slew up or down in each tick; a capture of every tenth tick
has the same means within a hundredth of a step, for noise decides which way."""
SAME_RAD, STOOD = 1e-7, 5  # means of bins in which gamma stood at a bound all the time, and how many of them show one
SENSORS = tuple(f"{what}_m{k}" for what in ("gain", "offset") for k in range(1, 5))


@dataclass(frozen=True)
class Turns:
    """Turns of one way that went alike: currents as read, before and with balancing, and paths (turns, bins), the phase angle
    and how it should be led. i_x has the sign that it has with i_y on this branch."""

    before: Complex
    after: Complex
    path_before: Complex
    path_after: Complex
    distance_before: Array
    distance_after: Array
    gamma: Array
    law: Law

    def without(self, turn: int) -> Turns:
        """All but one."""
        arrays = {f.name: np.delete(getattr(self, f.name), turn, axis=0) for f in fields(self) if f.name != "law"}
        return replace(self, **arrays)

    def __len__(self) -> int:
        return len(self.before)


@dataclass(frozen=True)
class Result:
    """Of one way round: the turns by branch, the estimates by quantity and place, what is predicted by gamma and current of
    the bins for the branch that most turns took, the load before."""

    way: str
    groups: tuple[Turns, ...]
    estimates: Mapping[str, Estimate]
    values: Numbers

    @property
    def main(self) -> Turns:
        """The branch that most turns took."""
        return max(self.groups, key=len)


def evaluate(recording: Recording[Plan], around: Sequence[Around]) -> tuple[dict[str, Result], dict[str, Estimate]]:
    """Results by way, and what they rest on."""
    given, plan = inputs.of_recording(recording), recording.plan
    p = {name: e.value for name, e in given.items()}
    out = {}
    for way, sign in plan.signs:
        groups = grouped(around, plan, way, sign)
        out[way] = Result(way, groups, _estimates(groups, plan, way, given, p), p)
    return out, given


def grouped(around: Sequence[Around], plan: Plan, way: str, sign: int) -> tuple[Turns, ...]:
    """Turns of a way, those of one branch together."""
    pairs = list(zip(of_way(around, way, BEFORE), of_way(around, way, AFTER), strict=True))
    out = []
    for branch in (1, -1):
        mine = [(b, a) for b, a in pairs if a.branch == branch]
        if mine:
            law = Law(sign * plan.circle_hz, plan.gamma_slew_rad_s, plan.gamma_max_rad, branch)
            before, after = (np.concatenate([mean_currents(x.segments) for x in of]) for of in zip(*mine, strict=True))
            paths = [np.concatenate([x.path for x in of]) for of in zip(*mine, strict=True)]
            far = [np.concatenate([x.distance for x in of]) for of in zip(*mine, strict=True)]
            gamma = np.concatenate([a.gamma for _, a in mine if a.gamma is not None])
            out.append(Turns(before, after, paths[0], paths[1], far[0], far[1], gamma, law))
    return tuple(out)


def _estimates(
    groups: Sequence[Turns], plan: Plan, way: str, given: Mapping[str, Estimate], p: Numbers
) -> dict[str, Estimate]:
    parts = [_of_group(g, plan, given) for g in groups]
    weights = [len(g) / sum(map(len, groups)) for g in groups]
    spread = jackknife(lambda some: statistics(some, plan, p), groups)
    out = {}
    for key in parts[0]:
        total = parts[0][key] * weights[0]
        for part, weight in zip(parts[1:], weights[1:], strict=True):
            total = total + part[key] * weight
        u, dof = spread[key]
        scatter = Influence(f"scatter/{key}/{way}", "scatter of the turns", u, "1", "A", "normal", dof)
        out[key] = total + Estimate.of(0.0, scatter)
    return out


def jackknife(of: Callable[[Turns], Numbers], groups: Sequence[Turns]) -> dict[str, tuple[float, float]]:
    """Standard uncertainty and degrees of freedom of each statistic, from turns without one of them each (Tukey), by groups: to
    which side a repeat went is known and no scatter. A turn alone scatters as those of the other group do."""
    whole = sum(map(len, groups))
    variances: list[dict[str, float]] = []
    for group in (g for g in groups if len(g) > 1):
        n = len(group)
        found = [of(group.without(turn)) for turn in range(n)]
        values = {key: np.array([f[key] for f in found]) for key in found[0]}
        # of one turn, so that a mean over n of them has an n-th of it
        variances.append({key: (n - 1) * float(((x - x.mean()) ** 2).sum()) for key, x in values.items()})
    if not variances:  # one turn to each side: what tells them apart is all there is
        alone = [of(g) for g in groups]
        return {
            key: (float(np.std([f[key] for f in alone], ddof=1)) / math.sqrt(whole), whole - 1.0) for key in alone[0]
        }
    freedoms = [len(g) - 1 for g in groups if len(g) > 1]
    dof = float(sum(freedoms))
    pooled = {key: sum(v[key] * f for v, f in zip(variances, freedoms, strict=True)) / dof for key in variances[0]}
    return {key: (math.sqrt(v / whole), dof) for key, v in pooled.items()}


def statistics(t: Turns, plan: Plan, p: Numbers) -> dict[str, float]:
    """Every quantity of some turns that went alike, by constants `p`."""
    out = of_currents(t, plan, p)
    before, after = (noise(fit.true(x, p)) for x in (t.before, t.after))
    for when, x, unsure in (("before", t.before, before), ("after", t.after, after)):
        i = fit.true(x.mean(axis=0), p)
        out[f"unbalance/{when}"] = fit.share(i.real, i.imag, unsure)
        out[f"peak_any/{when}"] = max(fit.peak(np.abs(i.real)), fit.peak(np.abs(i.imag)))
    out["unbalance_ratio"] = out["unbalance/after"] / out["unbalance/before"]
    out["error_radius/before"] = fit.off_circle(t.distance_before, plan.radius_m)
    out["error_radius/after"] = fit.off_circle(t.distance_after, plan.radius_m)
    out["gamma_extreme"] = extreme(t.gamma.mean(axis=0), t.law.limit)
    return out


def of_currents(t: Turns, plan: Plan, p: Numbers) -> dict[str, float]:
    """What bends little with the constants: peaks of |i_y| and what is predicted of them."""
    before, after = fit.true(t.before.mean(axis=0), p), fit.true(t.after.mean(axis=0), p)
    first, then = fit.peak(np.abs(before.imag)), fit.peak(np.abs(after.imag))
    out = {"peak_i_y/before": first, "peak_i_y/after": then, "reduction": then / first - 1}
    loads = loads_of(t, p)
    for name, (without, with_) in loads.items():
        i = -without / p["alpha_d"] / fit.factor(0.0, p)
        peak = fit.peak(np.abs(i.imag))
        out[f"predicted/{name}"] = fit.peak(np.abs(fit.balanced(with_, t.law, p).current.imag)) / peak - 1
    return out


def loads_of(t: Turns, p: Numbers) -> dict[str, tuple[Complex, Complex]]:
    """Loads (bins,) N without and with balancing: those that the currents show without it, and with it what the path has
    changed of them; or constant as these show, and with the path as the adopted stiffness has it."""
    k = p["alpha_x_prime"] * inputs.of_amb_plane(*(p[key] for key in inputs.LENGTHS))
    before, after = (
        x.real / p["gain_xo"] + 1j * x.imag / p["gain_yo"]
        for x in (t.path_before.mean(axis=0), t.path_after.mean(axis=0))
    )
    seen = fit.load(t.before.mean(axis=0), 0.0, p)
    constant = seen.mean() - k * before.mean()
    return {LOADS_SEEN: (seen, seen + k * (after - before)), FACTS_SEEN: (constant + k * before, constant + k * after)}


def noise(i: Complex) -> tuple[float, float]:
    """Mean squares that noise adds to |i_x| - |i_y| and to their sum in means over turns (turns, bins)."""
    if len(i) < 2:
        return 0.0, 0.0
    x, y = np.abs(i.real), np.abs(i.imag)
    apart, both = (float(z.var(axis=0, ddof=1).mean()) / len(i) for z in (x - y, x + y))
    return apart, both


def extreme(gamma: Array, limit: float) -> float:
    """Greatest |gamma| of (bins,): the bound where it stood there, be it the one that was asked for or another. A smooth top
    has hardly two bins alike within its noise, and a parabola through a flat one is too high by up to 1 %."""
    size = np.abs(gamma)
    stood = int((size > size.max() - SAME_RAD).sum()) >= STOOD
    return float(size.max()) if stood or size.max() > 0.995 * limit else fit.peak(size)


def _of_group(t: Turns, plan: Plan, given: Mapping[str, Estimate]) -> dict[str, Estimate]:
    out = linearised(lambda p: of_currents(t, plan, p), given)
    ripple = Estimate.of(0.0, _ripple(plan, given["pole_pairs"].value))
    for key in (f"predicted/{LOADS_SEEN}", f"predicted/{FACTS_SEEN}"):
        out[key] = out[key] + ripple * (1 + out[key].value)
    values = {name: e.value for name, e in given.items()}
    found = statistics(t, plan, values)
    pairs = paired(given)
    for when, read in (("before", t.before), ("after", t.after)):
        mean = read.mean(axis=0)
        out[f"peak_any/{when}"] = _greater(mean, pairs)
        out[f"unbalance/{when}"] = _share(mean, noise(fit.true(read, values)), pairs)
        scale = (1 / given["gain_xo"] + 1 / given["gain_yo"]) / 2
        out[f"error_radius/{when}"] = scale * Estimate.exact(found[f"error_radius/{when}"], "m")
    out["unbalance_ratio"] = out["unbalance/after"] / out["unbalance/before"]
    out["gamma_extreme"] = Estimate.of(found["gamma_extreme"], ROUNDING)
    return out


def _ripple(plan: Plan, pole_pairs: float) -> Influence:
    """T (5.25), alpha_3 sin(P theta): by it i_x gives a force upwards where the rotor does not stand at its home angle, but
    anywhere within a count of the encoder, which the constants know nothing of. As a share of i_y, which is as large; two
    rectangular ones in a product."""
    half = 2 * pole_pairs * plan.count_rad / 2 * RIPPLE
    return Influence("ripple/angle", "force ripple where the rotor stands", half / 3, "1", "B", "triangular",
                     source="T (5.25), 2.5 % of alpha_d, half a count")  # fmt: skip


def paired(given: Mapping[str, Estimate]) -> tuple[Estimate, ...]:
    """Factor and zero of i_x, then of i_y."""
    sensors = {name: given[name] for name in SENSORS}
    names = ("ax", "bx", "ay", "by")
    found = propagate(lambda p: dict(zip(names, fit.pairs(p), strict=True)), sensors)
    return tuple(replace(found[name], sampler=None) for name in names)  # gains are within 0.3 %: no bend


def _greater(mean: Complex, pairs: Sequence[Estimate]) -> Estimate:
    """Peak of either current, of means (bins,): the greater of two that are alike is greater than each is expected to be
    (Clark, Oper. Res. 9, 145 (1961), for what is normal)."""
    from scipy.special import ndtr

    ax, bx, ay, by = pairs
    kx, ky = (int(np.argmax(np.abs(z))) for z in (mean.real, mean.imag))
    tops = [(a * fit.peak(np.abs(z)) - b * float(np.sign(z[k])))
            for a, b, z, k in ((ax, bx, mean.real, kx), (ay, by, mean.imag, ky))]  # fmt: skip
    x, y = tops
    apart = x - y
    s = apart.value / apart.u if apart.u else math.inf * (apart.value or 1.0)
    part = float(ndtr(s))
    density = math.exp(-min(s * s / 2, 700.0)) / math.sqrt(2 * math.pi)
    value = x.value * part + y.value * (1 - part) + apart.u * density
    linear = x * part + y * (1 - part)

    def sampled(deviations: Deviations) -> Array:
        return np.maximum(x.sampled(deviations), y.sampled(deviations))

    return Estimate(value, "A", linear.sensitivities, sampled if abs(s) < 5 else None)


def _share(mean: Complex, unsure: tuple[float, float], pairs: Sequence[Estimate]) -> Estimate:
    """Unbalance of means (bins,), readings: rms of |a_x i_x - b_x| - |a_y i_y - b_y| over that of the sum. Both are quadratic
    in the sensors' factors and zeros, and their expectations are the value."""
    sx, sy = np.sign(mean.real), np.sign(mean.imag)
    x, y = np.array([np.abs(mean.real), -sx]), np.array([np.abs(mean.imag), -sy])
    forms = [np.concatenate([x, way * y]) for way in (-1.0, 1.0)]
    apart, both = (f @ f.T / f.shape[1] for f in forms)
    centre = np.array([e.value for e in pairs])

    def ratio(v: Array) -> Array:
        top = np.einsum("ki,ij,kj->k", v, apart, v) - unsure[0]
        out: Array = np.sqrt(np.maximum(top, 0.0) / (np.einsum("ki,ij,kj->k", v, both, v) - unsure[1]))
        return out

    def sampled(deviations: Deviations) -> Array:
        return ratio(np.stack([e.sampled(deviations) for e in pairs], axis=1))

    slopes: dict[Influence, float] = {}
    for influence in merged((1.0, e) for e in pairs):
        step = influence.u * np.array([e.sensitivities.get(influence, 0.0) for e in pairs])
        up, down = ratio(np.array([centre + step, centre - step]))
        slopes[influence] = float(up - down) / (2 * influence.u)
    spread = sum(float(s @ apart @ s) for s in (
        i.u * np.array([e.sensitivities.get(i, 0.0) for e in pairs]) for i in slopes))  # fmt: skip
    top = max(float(centre @ apart @ centre) - unsure[0], 0.0) + spread
    value = math.sqrt(top / (float(centre @ both @ centre) - unsure[1]))
    bent = spread > 0.01 * top
    return Estimate(value, "1", slopes, sampled if bent else None)
