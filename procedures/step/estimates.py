"""From set-point steps to estimates with influences: scatter of the repeats, sampling, size of the steps, sensors' gains."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.shared.certificates import certified
from procedures.step import response, settling
from procedures.step import steps as step_steps
from procedures.step.acting import START_S
from procedures.step.coupled import Tilting, hardly_swings
from procedures.step.fit import shape, swing
from procedures.step.influences import bound, doubted, lag_estimate, settling_estimate
from procedures.step.likeness import astray
from procedures.step.oscillation import One, Swing
from procedures.step.position import leans, shares, tilting_of
from procedures.step.rising import rises
from procedures.step.scatter import jackknifed, left_out, pooled, repeated, weighed
from procedures.step.settling import Curve, Settling
from procedures.step.steps import Case, Done
from procedures.step.whirling import whirls

Array = npt.NDArray[np.float64]
# Of the bandwidth b: what the sampling rate r folds onto it from r - b. From a tenth of r - b on it falls as the cube of
# b/(r - b): response and mean together lose three orders there (0.0007 at 0.061 without noise, 0.001 at 0.07).
ALIAS, FOLDED = 3e-3, 0.1
# Of the directions' difference of overshoot, times the square of what half a swing leaves of the swing: the second harmonic at
# the top, which oscillations leave out. Without noise 0.07 to 0.45 (`harmonic_left`).
HARMONIC = 0.45
# Second-order effect of a step's size over the square of its first-order effect: damping either way; frequency from none to
# less by this much, since what bearings have of quadratic and cubic forces softens them (Landau, Mechanics, section 28).
SIZE_DAMPING, SIZE_FREQUENCY = (-2.0, 2.0), (-4.0, 0.0)
TAIL_S = 0.2
ALONE = np.array([[1.0], [0.0]])  # of position and tilt, the position


@dataclass(frozen=True)
class Result:
    """The steps of one case, what was fitted to their mean (None: no oscillation), and each quantity with its influences; no
    settling time where the position does not settle. `shared`: y and z swing together, and what one oscillation would tell is
    not told; nor where the steps do not follow it (`follows`)."""

    case: Case
    ones: tuple[One, ...]
    swing: Swing | None
    settled: Settling
    error: float
    estimates: Mapping[str, Estimate]
    shared: bool = False
    follows: bool = True


def by_case(steps: list[Done], rig: RigFile, band: float) -> dict[Case, Result]:
    """Every case's result.

    Raises:
        AnalysisError: a step does not get to nine tenths of its size.
    """
    done, tilting = step_steps.by_case(steps), tilting_of(rig)
    ones = {case: tuple(_one(d) for d in d_all) for case, d_all in done.items()}
    together = {g: leans(rig, of[0].case.axis) or whirls(of) for g, of in step_steps.by_group(steps).items()}
    shared = {case: together[case.group] for case in ones}
    fits = {case: [] if shared[case] else _fits(o, tilting) for case, o in ones.items()}
    strayed = astray(fits, ones)
    fits |= {case: [] for case in strayed}
    rising, left = rises(ones, {case.group for case, of in done.items() if of[0].late_s})
    seen = {
        "rise_time": rising,
        "steady_error": repeated("m", 0, ones, lambda case, o: case.way * case.size * (_late(o) - 1)),
        "overshoot": jackknifed("1", fits, ones, lambda s, _: s.peak - 1),
        "bandwidth": jackknifed("Hz", fits, ones, lambda s, o: response.bandwidth(o, s)),
    }
    curves = {group: _curve(of, tilting) for group, of in step_steps.by_group(steps).items()}
    out = {}
    for case, all_of in done.items():
        settled = settling.settling(curves[case.group], case, all_of, band)
        found = {name: pooled(name, case, s) for name, s in seen.items() if case in s.values}
        if math.isfinite(settled.time) and not shared[case]:
            found["settling_time"] = settling_estimate(case, settled, all_of[0].late_s, all_of[0].start_s)
            if (lag := lag_estimate(rig)) is not None:
                found["settling_time"] += lag
        period = float(all_of[0].t[1] - all_of[0].t[0])
        found["rise_time"] += bound(f"sampling/rise/{case.where}", "sampling", left[case], "s")
        found["steady_error"] += _gained(case, rig)
        other = seen["overshoot"].values.get(replace(case, way=-case.way))
        if "overshoot" in found and other is not None:
            half = harmonic_left(found["overshoot"].value - other, fits[case][0])
            found["overshoot"] += bound(f"harmonic/{case.where}", "second harmonic of the swing", half, "1")
        if "bandwidth" in found:
            folded = aliased(found["bandwidth"].value, period)
            found["bandwidth"] += bound(f"aliasing/{case.where}", "above half the sampling rate", folded, "Hz")
        error = float(np.mean([_late(o) - 1 for o in ones[case]]))
        fitted = fits[case][0] if fits[case] else None
        out[case] = Result(case, ones[case], fitted, settled, error, found, shared[case], case not in strayed)
    return out


def aliased(bandwidth: float, period: float) -> float:
    """Half width of what sampling every `period` s folds onto a bandwidth, Hz; all of ALIAS where the rate is not above it."""
    above = 1 / period - bandwidth
    return ALIAS * bandwidth * min(1.0, (bandwidth / above / FOLDED) ** 3 if above > 0 else 1.0)


def harmonic_left(difference: float, swing: Swing) -> float:
    """Half width of what a fit leaves out of an overshoot by which the directions differ so much.

    Quadratic forces of a loaded bearing make the directions differ by another stiffness where they end, which each direction's
    own poles have, and by a second harmonic, which they have not: it goes with the square of the swing at its top, half a swing
    after the step: e^(2 pi Re p/Im p)."""
    return HARMONIC * math.exp(2 * math.pi * swing.pole.real / swing.pole.imag) * abs(difference)


def _one(d: Done) -> One:
    return One(d.t, np.array([d.y, d.tilt]) / d.case.size, d.case.size, d.begin)


def _late(o: One) -> float:
    return float(o.both[0, o.t > o.t[-1] - min(TAIL_S, 0.25 * o.t[-1])].mean())


def _fits(ones: Sequence[One], tilting: Tilting) -> list[Swing]:
    """Of all steps of a case, then without each in turn; nothing where one does not fit."""
    try:
        whole = swing(ones, tilting=tilting)
        return [
            whole,
            *(swing([o for j, o in enumerate(ones) if j != k], whole, tilting) for k in range(len(ones))),
        ]
    except AnalysisError:
        return []


def _curve(done: Sequence[Done], tilting: Tilting) -> Curve:
    """Where nothing swings, of what fits best: what dies away too fast to swing is not what slow integrators leave. Where the
    search for two oscillations goes astray, with one of the position alone."""
    ones = [_one(d) for d in done]
    try:
        found = shape(ones, tilting=tilting)
    except AnalysisError:
        try:
            found = shape([replace(o, both=o.both * ALONE) for o in ones])
        except AnalysisError:
            return settling.fit(done, np.zeros(0, complex))
    constant = max(found.constant, 0.0)
    if found.dies_away:
        return settling.fit(done, found.poles, found.pole, constant, found.unlike)
    return settling.fit(done, settling.fading(found.poles), None, constant, found.unlike)


def by_group(steps: list[Done], results: Mapping[Case, Result], rig: RigFile) -> dict[str, dict[str, Estimate]]:
    """Of each setting, axis and speed: the oscillation, and how far size and direction matter."""
    out: dict[str, dict[str, Estimate]] = {}
    for group, done in step_steps.by_group(steps).items():
        of = [r for c, r in results.items() if c.group == group]
        out[group] = _oscillation(group, of, rig, done[0].start_s) | _linearity(of)
    return out


def _oscillation(group: str, results: Sequence[Result], rig: RigFile, start: float) -> dict[str, Estimate]:
    """Damping and natural frequency from all steps together, those of large ones weighing more; uncertainty by leaving out
    one step after the other, among those of its kind. Nothing where there is no oscillation.

    What is taken for granted of a second oscillation beside what fades fast moves both (`coupled`)."""
    if any(r.shared or not r.follows for r in results):
        return {}
    ones, tilting = [o for r in results for o in r.ones], tilting_of(rig)
    kinds, n = [(r.case, o.begin) for r in results for o in r.ones], len(ones)
    try:
        whole = swing(ones, tilting=tilting)
        if hardly_swings(whole) or whole.doubts is None or not all(np.isfinite(s.pole) for s in whole.doubts):
            return {}  # `untold` says which
        left = [swing(ones[:k] + ones[k + 1 :], whole, tilting) for k in range(n)]
    except AnalysisError:
        return {}
    first, lag = _first_order(results), lag_estimate(rig)
    shares = np.array([o.weight**2 for o in ones])
    shares /= shares.sum()
    out = {}
    made: tuple[tuple[str, str, Callable[[Swing], float], tuple[float, float]], ...] = (
        ("damping", "1", lambda s: s.damping, SIZE_DAMPING),
        ("natural_frequency", "Hz", lambda s: s.frequency, SIZE_FREQUENCY),
    )
    for name, unit, of, (low, high) in made:
        value = of(whole)
        u = math.sqrt(left_out(kinds, np.array([of(s) for s in left]), shares))
        jackknife = Influence(
            id=f"scatter/{name}/{group}",
            name="scatter of the steps",
            u=u,
            unit=unit,
            kind="A",
            distribution="normal",
            dof=weighed(kinds),
            source=f"{n} steps, left out in turn",
        )
        moved = max(abs(of(whole.later(by)) - value) for by in (start, -start))
        out[name] = Estimate.of(value * (1 - (low + high) / 2 * first**2), jackknife)
        out[name] += bound(f"start/{name}/{group}", "start of the step", moved, unit)
        out[name] += bound(f"size/{name}/{group}", "size of the steps", (high - low) / 2 * first**2 * value, unit)
        if whole.doubts:
            out[name] += doubted(f"second/{name}/{group}", [of(s) - value for s in whole.doubts], unit)
        if lag is not None:
            slope = (of(whole.later(-START_S)) - of(whole.later(START_S))) / (2 * START_S)
            out[name] += replace(lag * slope, unit=unit)
    return out


def one_group(group: str, results: Mapping[Case, Result]) -> list[One]:
    """All steps of a setting, an axis and a speed; none where y and z share two oscillations."""
    return [o for c, r in results.items() if c.group == group and not r.shared for o in r.ones]


def _first_order(results: Sequence[Result]) -> float:
    """By how much the frequency of the largest steps differs between the directions: 0 in a linear loop."""
    largest = max(r.case.size for r in results)
    both = {
        r.case.way: r.swing.frequency
        for r in results
        if r.case.size == largest and r.swing is not None and r.swing.dies_away
    }
    return both[1] / both[-1] - 1 if len(both) == 2 else 0.0


def _linearity(results: Sequence[Result]) -> dict[str, Estimate]:
    sizes = sorted({r.case.size for r in results})
    of = {(r.case.size, r.case.way): r.estimates["overshoot"] for r in results if "overshoot" in r.estimates}
    if any((s, w) not in of for s in (sizes[0], sizes[-1]) for w in (1, -1)):
        return {}
    top = [of[sizes[-1], w] for w in (1, -1)]
    out = {"way_effect": top[0] - top[1]}
    if len(sizes) > 1:
        out["size_effect"] = (top[0] + top[1] - of[sizes[0], 1] - of[sizes[0], -1]) * 0.5
    return out


def _gained(case: Case, rig: RigFile) -> Estimate:
    """Zero m, with what the gains of the position sensors make of the step's length."""
    out = Estimate.exact(0.0, "m")
    for channel, share in shares(rig, case.axis).items():
        gain = certified(f"sensors/{channel}/gain", rig.sensors[channel].gain, f"gain of {channel}")
        out = out + (gain - gain.value) * (-case.way * case.size * share / gain.value)
    return replace(out, unit="m")
