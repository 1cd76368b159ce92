"""What can be wrong with the responses of position loops, and what their data can say about it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.uncertainty import interval
from procedures.loop_response.estimates import Result
from procedures.loop_response.fit import Point
from procedures.loop_response.injection import SENSOR
from procedures.loop_response.plan import Plan
from procedures.loop_response.steps import REFINED, Taken
from procedures.position_loops import recorded
from procedures.sensitivity.checks import SCOPE, ZONES
from procedures.shared import signals

OFF = 0.05  # share by which the captured sine may differ from what was asked for
UNEXPLAINED = 1e-4  # chance that a sound run's lines lie so far off their curve, all its curves together
LIMITED = 0.0  # share of a line's samples that may be at the limit: a loop at its limit is not linear


def of_signals(taken: Sequence[Taken], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Nothing injected or captured, not levitated, another sine than was asked for, loops at their limit, losses."""
    if not taken:
        yield Finding("no-sines", "no sine was injected; expected those of the plan (was the run stopped early?)", "",
                      Effect.ERROR)  # fmt: skip
        return
    missing = [t for t in taken if t.line is None]
    if (told := recorded.not_captured("sine-not-captured", "sines", missing, len(taken))) is not None:
        yield told
        return
    yield from _held(taken, rig)
    yield from signals.losses_of(taken, plan.max_lost)
    for t in taken:
        if t.line is not None and abs(t.line.wave - 1) > OFF:
            text = (f"the captured sine has {t.line.wave:.3g} of the amplitude asked for: another frequency, or none. Look at "
                    "the rig file's capabilities.loop_injection.")  # fmt: skip
            yield Finding("sine-wrong", text, t.where, Effect.ERROR)
            break
    for axis in dict.fromkeys(t.axis for t in taken):
        yield from _limited([t for t in taken if t.axis == axis], axis)
        yield from _shown([t for t in taken if t.axis == axis], axis, plan)


def _held(taken: Sequence[Taken], rig: RigFile) -> Iterator[Finding]:
    if (told := recorded.not_held(((t.where, t.states) for t in taken), rig)) is not None:
        yield told
        return


def _limited(some: Sequence[Taken], axis: str) -> Iterator[Finding]:
    hit = [t for t in some if t.limited > LIMITED]
    if hit:
        worst = max(hit, key=lambda t: t.limited)
        text = (f"the loop was at its limit in {len(hit)} of {len(some)} sines ({worst.limited:.1%} of the time in the worst): "
                "|y/r| then reads low, and its bandwidth too. Inject less: share, counts or amplitude.")  # fmt: skip
        names = {"s_max" if t.place == SENSOR else "bandwidth" for t in hit if t.kind == REFINED}
        effect = Effect.INDETERMINATE if names else Effect.NOTE
        yield Finding("loop-limited", text, worst.where, effect, tuple(f"{n}@{axis}" for n in sorted(names)))


def _shown(some: Sequence[Taken], axis: str, plan: Plan) -> Iterator[Finding]:
    lost = [t for t in some if t.kind == REFINED and t.line is not None and t.line.size < plan.min_signal * t.line.u]
    if lost:
        worst = min(lost, key=lambda t: t.line.size / t.line.u if t.line is not None else 0.0)
        assert worst.line is not None
        text = (f"{len(lost)} lines are lost in noise: {worst.line.size / worst.line.u:.2g} standard uncertainties in the "
                f"worst, {plan.min_signal:g} wanted. Does its channel show this loop? Inject more, or longer.")  # fmt: skip
        names = {"s_max" if t.place == SENSOR else "bandwidth" for t in lost}
        yield Finding(
            "loop-not-shown", text, worst.where, Effect.INDETERMINATE, tuple(f"{n}@{axis}" for n in sorted(names))
        )


def of_results(results: Sequence[Result]) -> Iterator[Finding]:
    """Lines off their curves; in which zone each sensitivity is, and for what the zones hold."""
    curves = [(r.axis, name, p) for r in results for name, p in (("bandwidth", r.crossing), ("s_max", r.summit))]
    fitted = [(axis, name, p) for axis, name, p in curves if p is not None]
    for axis, name, point in fitted:
        yield from _explained(axis, name, point, len(fitted))
    zoned = [(r.axis, r.estimates["s_max"]) for r in results if "s_max" in r.estimates]
    for axis, estimate in zoned:
        i = interval(estimate)
        low, high = (_zone(x) for x in (i.low, i.high))
        told = f"zone {low}" if low == high else f"zone {low} or {high}"
        ends = f"A to {ZONES[0]:g}, B to {ZONES[1]:g}, C to {ZONES[2]:g}"
        yield Finding("sensitivity-zone", f"S_max {estimate.value:.2f}: {told} of ISO 14839-3 ({ends}).", axis)
    if zoned:
        yield Finding("zones-scope", SCOPE)


def _zone(size: float) -> str:
    return "ABCD"[int(np.searchsorted(ZONES, size))]


def _explained(axis: str, name: str, point: Point, count: int) -> Iterator[Finding]:
    if point.fit.p_value < UNEXPLAINED / max(count, 1):
        text = (f"{name}: the lines are off their curve by more than their noise, chi-squared {point.fit.chi2:.3g} of "
                f"{point.fit.dof} degrees of freedom: the loop changed meanwhile, or is not linear.")  # fmt: skip
        yield Finding("misfit", text, axis, Effect.INDETERMINATE, (f"{name}@{axis}",))
