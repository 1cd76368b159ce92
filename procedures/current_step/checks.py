"""What can be wrong with a stepped current, and what its data can say about it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from bench.findings import Effect, Finding
from procedures.current_step import fit
from procedures.current_step.estimates import Limits, Place
from procedures.current_step.plan import Plan
from procedures.current_step.steps import LARGE, SMALL, Pushed, Taken

LIKE = 0.2  # share of its size by which a step may be another one, before it did not come


def of_signals(taken: Sequence[Taken], plan: Plan) -> Iterator[Finding]:
    """Lost samples, channels that stand still, steps that did not come or that do not rest."""
    for kind, place in dict.fromkeys((t.kind, t.place) for t in taken):
        mine = [t for t in taken if (t.kind, t.place) == (kind, place)]
        share = max(t.lost / max(t.expected, 1) for t in mine)
        if share > plan.max_lost:
            text = (
                f"{share:.2%} of the samples of a step are missing ({plan.max_lost:.2%} is allowed). Look at the link."
            )
            yield Finding("missing-samples", text, place, Effect.INDETERMINATE)
        if any(np.ptp(t.along) == 0 for t in mine):
            yield Finding("stuck-channel", "the current does not move at all during a step.", place, Effect.ERROR)
            continue
        yield from _stepped(mine, kind, place, plan)


def _stepped(mine: Sequence[Taken], kind: str, place: str, plan: Plan) -> Iterator[Finding]:
    found = [fit.edges(t.along, t.size, t.tick_s) for t in mine]
    missing = sum(e is None for e in found)
    if missing:
        text = (
            f"in {missing} of {len(mine)} captures of the {kind} step the current does not go by half of {mine[0].size:g} A "
            "and back: the step did not come, it came outside of the capture, or the loop does not follow. Look at the "
            "reference, at spare_s, and whether the current loops are switched on."
        )
        yield Finding("current-not-stepped", text, place, Effect.ERROR)
        return
    both = [e for pair in found if pair is not None for e in pair]
    size = float(np.mean([abs(e.end - e.before) for e in both])) / abs(mine[0].size) - 1
    drift = float(np.mean([e.drift / e.size for e in both]))
    if abs(size) > LIKE:
        text = f"the {kind} step is off its {mine[0].size:g} A by {size:+.1%}: another step came than was told."
        yield Finding("current-not-stepped", text, place, Effect.ERROR)
    elif max(abs(size), abs(drift)) > plan.max_unsettled:
        text = (
            f"the current does not come to rest where it was told to: the {kind} step is off by {size:+.2%} of its size at its "
            f"end and drifts by {drift:+.2%} of it there ({plan.max_unsettled:.2%} is allowed). Hold it longer, or look for "
            "what pulls at it: a loop without integrator, a reference that another loop moves, a sensor's gain."
        )
        yield Finding("current-not-settled", text, place, Effect.INDETERMINATE)


def of_pushes(pushed: Sequence[Pushed], plan: Plan) -> Iterator[Finding]:
    """Positions and angles that a step must leave alone."""
    for p in pushed:
        far = {name: m for name, m in p.moved.items() if m > plan.max_push_m}
        if far:
            text = (
                f"the step pushed the mover aside: {', '.join(f'{name} by {m * 1e6:.0f} µm' for name, m in far.items())} "
                f"({plan.max_push_m * 1e6:.0f} µm is allowed). This current gives no such force on a winding that is as the "
                "controller takes it to be: a coil is reversed, or exchanged with one of another system."
            )
            yield Finding("mover-pushed", text, p.place, Effect.INDETERMINATE)
        if turned := {name: rad for name, rad in p.turned.items() if rad > plan.max_turn_rad}:
            text = (
                f"the step turned the mover: {', '.join(f'{name} by {rad * 1e3:.3g} mrad' for name, rad in turned.items())} "
                f"({plan.max_turn_rad * 1e3:.3g} mrad is allowed). This current gives no torque where phases and the angle's "
                "zero are as the controller takes them to be: two phases are exchanged, or the zero is off. The steps were "
                "taken at other angles than the mover was left at."
            )
            yield Finding("mover-turned", text, p.place, Effect.INDETERMINATE)


def of_result(places: Sequence[Place]) -> Iterator[Finding]:
    """Whether limits shaped the large step, and left the small one alone."""
    for p in places:
        large, small = p.limits[LARGE], p.limits[SMALL]
        said = _said(large)
        if large.current_touched or large.voltage_touched:
            text = (
                f"the large step touches its limits: {said}. Its rise time is that of a saturated step and goes with the "
                "supply."
            )
            yield Finding("limit-touched", text, p.name)
        elif said:
            text = (
                f"the large step touches no limit: {said}. Its rise time is not that of a saturated step, and the small step "
                "has the same. Step by more, or look whether the loop's gain is as told."
            )
            concerns = tuple(f"{name}@{p.name}" for name in ("rise_time", "fall_time", "rise_bandwidth"))
            yield Finding("limit-untouched", text, p.name, Effect.INDETERMINATE, concerns)
        if small.current_touched or small.voltage_touched:
            text = (
                f"the small step touches a limit: {_said(small)}. Its band is not that of a small signal: step by less."
            )
            yield Finding("small-step-limited", text, p.name, Effect.INDETERMINATE, (f"bandwidth_small@{p.name}",))


def _said(limits: Limits) -> str:
    parts = []
    if limits.current == limits.current and limits.current_limit == limits.current_limit:
        parts.append(f"inductor current {limits.current:.3g} A of {limits.current_limit:.3g} A")
    if limits.voltage == limits.voltage and limits.voltage_limit == limits.voltage_limit:
        parts.append(
            f"half-bridge voltage {limits.voltage:.3g} V of {limits.voltage_limit:.3g} V, {limits.voltage_s * 1e6:.3g} µs"
        )
    return ", ".join(parts)
