"""From captures to estimates: geometric means over the repeats, and ratios of two estimators paired by them.

What is measured is a size, and goes by the moment: rms positions after a switch are 1 to 28 um, skewed, their logarithms are
not. Means of ten had 0.92 of their intervals hold the truth, and five times as many errors beyond 3 U as Student's t has;
geometric means have 0.947, and tails as t.

Positions and velocities are captured as the sensor reads them. What is told in m, m s and m/s is the shaft's own motion: the
reading over the sensor's certified gain. Ratios and the velocity's error know no gain; that of the disturbance is the
controller's own number."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from bench.uncertainty import Estimate, Influence
from bench.uncertainty.estimate import Deviations
from procedures.estimator_compare import fit
from procedures.estimator_compare.plan import Plan
from procedures.estimator_compare.requires import ENGAGE, HANG
from procedures.estimator_compare.steps import Taken, of_kind

Array = npt.NDArray[np.float64]
SWITCHED, LOADED = ("velocity_error", "disturbance_error", "y_50_100"), ("peak", "integral", "quiet", "velocity_noise")
MOTIONS = ("y_50_100", *LOADED)  # of the shaft, which the sensor's gain scales
UNITS = {"velocity_error": "1", "disturbance_error": "N", "y_50_100": "m", "peak": "m", "integral": "m s", "quiet": "m",
         "velocity_noise": "m/s"}  # fmt: skip


@dataclass(frozen=True)
class Result:
    """By quantity and estimator the values (repeats,) as the sensor reads them, the estimates of the shaft's own motion, and
    ratios by quantity and pair."""

    values: Mapping[str, Mapping[str, Array]]
    estimates: Mapping[str, Mapping[str, Estimate]]
    ratios: Mapping[str, Mapping[str, Estimate]]
    taken: tuple[Taken, ...]


def evaluate(taken: Sequence[Taken], plan: Plan, harmonic_hz: float, gain: Estimate) -> Result:
    """Every estimate; `harmonic_hz` is what the controller takes for the exciter's frequency, `gain` the position sensor's.

    Raises:
        AnalysisError: a switch or a load cannot be found in its capture.
    """
    values: dict[str, dict[str, Array]] = {name: {} for name in (*SWITCHED, *LOADED)}
    at = {id(t): _switched_at(t, plan) for t in taken if t.kind == ENGAGE}
    hz = fit.exciter_hz([t.disturbance[: at[id(t)]] for t in taken if id(t) in at], harmonic_hz, taken[0].tick_s)
    for estimator in plan.engaged:
        found = np.array([_of_switch(t, at[id(t)], hz) for t in of_kind(taken, ENGAGE, estimator)])
        for name, column in zip(SWITCHED, found.T, strict=True):
            values[name][estimator] = column
    for estimator in plan.loaded:
        found = np.array([_of_load(t, plan) for t in of_kind(taken, HANG, estimator)])
        for name, column in zip(LOADED, found.T, strict=True):
            values[name][estimator] = column
    estimates = {name: {e: _told(name, e, x, gain) for e, x in by.items()} for name, by in values.items()}
    return Result(values, estimates, _ratios(values, plan), tuple(taken))


def _switched_at(t: Taken, plan: Plan) -> int:
    return fit.switched_at(t.current, t.y, t.v, t.disturbance, round(plan.lead_s / t.tick_s), t.tick_s)


def _of_switch(t: Taken, at: int, hz: float) -> tuple[float, ...]:
    wrong = fit.besides(t.disturbance[:at], hz, t.tick_s)
    return fit.velocity_error(t.y, t.v, at, t.tick_s), fit.rms(wrong), fit.later(t.y, at, t.tick_s)


def _of_load(t: Taken, plan: Plan) -> tuple[float, ...]:
    lead = round(plan.lead_s / t.tick_s)
    at = fit.moved_at(t.y, lead, t.tick_s)
    quiet = slice(0, min(at, lead))
    return (*fit.answer(t.y, at, t.tick_s), float(t.y[quiet].std()), fit.above(t.v[quiet], t.tick_s))


def _told(name: str, estimator: str, x: Array, gain: Estimate) -> Estimate:
    """A quantity of one estimator, of the shaft where the sensor's gain is in its values."""
    read = _typical(x, UNITS[name], f"{name}/{estimator}")
    return replace(read / gain, unit=UNITS[name]) if name in MOTIONS else read


def _typical(x: Array, unit: str, identity: str, name: str = "scatter of the repeats") -> Estimate:
    """Geometric mean of what is positive, with the scatter of its logarithms: an interval that is not symmetric."""
    logs = np.log(x)
    middle, u = float(logs.mean()), float(logs.std(ddof=1)) / math.sqrt(len(x))
    value = math.exp(middle)
    scatter = Influence(f"scatter/{identity}", f"{name}, relative", u, "1", "A", "normal", len(x) - 1)

    def sampled(deviations: Deviations) -> Array:
        return np.asarray(value * np.exp(deviations[scatter.id]))

    return Estimate(value, unit, {scatter: value}, sampled if u else None)


def _ratios(values: Mapping[str, Mapping[str, Array]], plan: Plan) -> dict[str, dict[str, Estimate]]:
    """Geometric means over the repeats, each of two estimators in the same repeat: the first over the last of those that are
    switched, each other over the first of those that are loaded."""
    pairs = {name: [(e, plan.engaged[-1]) for e in plan.engaged[:-1]] for name in SWITCHED}
    pairs |= {name: [(e, plan.loaded[0]) for e in plan.loaded[1:]] for name in LOADED}
    return {name: {f"{a} / {b}": _ratio(values[name][a], values[name][b], f"{name}/{a}/{b}") for a, b in of}
            for name, of in pairs.items()}  # fmt: skip


def _ratio(a: Array, b: Array, identity: str) -> Estimate:
    count = min(len(a), len(b))
    return _typical(a[:count] / b[:count], "1", f"ratio/{identity}", "scatter of the repeats, paired")
