"""What can be wrong with a comparison, and what its data say of the thesis' claims."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from bench.findings import Effect, Finding
from bench.rigfile.roles import Status
from bench.uncertainty import Estimate
from procedures.estimator_compare.estimates import Result
from procedures.estimator_compare.plan import Plan
from procedures.estimator_compare.requires import ENGAGE, HANG
from procedures.estimator_compare.steps import Taken
from procedures.one_axis.bank import Array, aligned

OVERLAPPING, FEW, MISMATCH = "overlapping", 4, 1e-4  # which is held against its weights, in so many captures
APART = (  # those whose errors and noise differ on any machine; a difference's noise may be that of the overlapping filters
    {"single", "overlapping"}, {"single", "observer"}, {"overlapping", "observer"}, {"difference", "observer"},
)  # fmt: skip
SAME = 1e-6  # of the rms of two estimators' velocities in the same repeat: they are one


def of_signals(taken: Sequence[Taken], plan: Plan) -> Iterator[Finding]:
    """Lost samples, contact, currents at their limit, channels that stand still, repeats that are missing."""
    for t in taken:
        if t.lost / max(t.expected, 1) > plan.max_lost:
            share = t.lost / max(t.expected, 1)
            text = (
                f"{share:.2%} of the samples of a step are missing ({plan.max_lost:.2%} is allowed). Look at the link."
            )
            yield Finding("missing-samples", text, t.where, Effect.INDETERMINATE)
        if t.status & (Status.CONTACT_NEAR | Status.CONTACT_FAR):
            yield Finding("contact", "the body touched its ring during a capture.", t.where, Effect.INDETERMINATE)
        if t.status & Status.CURRENT_LIMIT:
            text = "a coil's current was at the end of its range during a capture."
            yield Finding("current-saturated", text, t.where, Effect.NOTE if t.kind == ENGAGE else Effect.INDETERMINATE)
        if np.ptp(t.y) == 0 or np.ptp(t.v) == 0:
            yield Finding(
                "stuck-channel", "position or velocity does not move at all during a capture.", t.where, Effect.ERROR
            )
    for kind, of in ((ENGAGE, plan.engaged), (HANG, plan.loaded)):
        for estimator in of:
            count = sum((t.kind, t.estimator) == (kind, estimator) for t in taken)
            if count < plan.repeats:
                text = f"found {count} repeats; expected {plan.repeats} (was the run stopped early?)"
                yield Finding("too-few-repeats", text, estimator, Effect.ERROR)


def of_result(result: Result, plan: Plan, predicted: float | None) -> Iterator[Finding]:
    """Estimators that are one and the same; the ratio that the observers' poles predict; the noise claim."""
    yield from _same(result, plan)
    found = result.ratios["integral"].get("observer / overlapping")
    if found is not None and predicted is not None:
        text = (
            f"the integral's ratio is {found.value:.3f}; by the poles of both observers, m h1 (l2 + kv l1)/l3, it is "
            f"{predicted:.3f}: it goes by how much the observers weigh a disturbance, not by how the velocity is estimated."
        )
        yield Finding("predicted-ratio", text, "observer / overlapping")
    noise = result.ratios["velocity_noise"].get("observer / overlapping")
    if noise is not None and noise.value < 1:
        text = (f"the algebraic estimate is {1 / noise.value:.2f} times as noisy as the full-order observer's: that it rejects "
                "noise better (T 4.4) is not confirmed.")  # fmt: skip
        yield Finding("noise-not-less", text, "observer / overlapping")


def of_weights(taken: Sequence[Taken], rows: Array) -> Iterator[Finding]:
    """Whether the overlapping estimate is what its weights make of the captured position, and none of the others is."""
    by: dict[str, list[Taken]] = {}
    for t in taken:
        by.setdefault(t.estimator, []).append(t)
    off = {name: [aligned(rows, t.y, t.v)[1] for t in each[:FEW]] for name, each in by.items()}
    worst = max(off.pop(OVERLAPPING, ()), default=0.0)
    if worst > MISMATCH:
        text = (f"the velocity is not what the controller's degree, spacing and rule make of the captured position: off by "
                f"{worst:.2%} of its rms ({MISMATCH:.2%} allowed). Look at it with `derivative`.")  # fmt: skip
        yield Finding("not-this-estimator", text, OVERLAPPING, Effect.INDETERMINATE)
    for name in (name for name, each in off.items() if min(each) < MISMATCH):
        text = (f"the velocity of {name} is what the two overlapping filters make of the captured position, to "
                f"{min(off[name]):.1g} of its rms: the controller runs them for it.")  # fmt: skip
        yield Finding("estimators-alike", text, name, Effect.INDETERMINATE)


def _same(result: Result, plan: Plan) -> Iterator[Finding]:
    """By the scatter alone: the sensor's gain is common to two of one machine."""
    for name, pair in (("velocity_error", plan.engaged), ("velocity_noise", plan.loaded)):
        for k, a in enumerate(pair):
            for b in (b for b in pair[k + 1 :] if {a, b} in APART):
                x, y = (result.estimates[name][e] for e in (a, b))
                scatter = max(_scatter(x), _scatter(y), SAME * x.value)
                if abs(x.value - y.value) < 2 * scatter:
                    what = name.replace("_", " ")
                    text = f"{a} and {b} have the same {what}: the controller may run one for the other."
                    yield Finding("estimators-alike", text, f"{a}, {b}", Effect.INDETERMINATE)


def _scatter(x: Estimate) -> float:
    return math.hypot(*(c * i.u for i, c in x.sensitivities.items() if i.kind == "A"))
