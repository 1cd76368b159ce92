"""What can be wrong with a run of decoupling, and what its data can say about it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from procedures.decoupling.estimates import Result, coupling_of, excursion_of, named, ratio_of, samples
from procedures.decoupling.plan import Plan
from procedures.decoupling.steps import FAST, SLOW, Run
from procedures.shared import signals
from procedures.stages.pairs import Pair, pairs

PLAYING = ("MOVING", "HOLDING")
DRAGGED = 0.3  # of the cross force; where friction lies along the axis that slides it is up to 0.2
FOLLOWS = 0.5  # of a nudge, below which the held axis is stuck
LIMIT = 0.999  # of a loop's greatest force: it is there
LIMITED = 2e-3  # share of samples


def of_signals(runs: Sequence[Run], rig: RigFile, plan: Plan, period_s: float) -> Iterator[Finding]:
    """Steps that are missing or too short, axes that were not held, losses, loops at their limit."""
    found = {(r.pair.where, r.turns) for r in runs}
    wanted = [(p.where, turns) for p in pairs(rig, plan.moved) for turns in (0.0, SLOW, FAST)]
    if missing := [f"{where} ({turns:g})" for where, turns in wanted if (where, turns) not in found]:
        text = f"found no step of {', '.join(missing)} (was the run stopped early?)"
        yield Finding("sines-missing", text, "", Effect.ERROR)
        return
    for r in runs:
        if other := [m for m in r.modes if m not in PLAYING]:
            text = f"the controller was in {', '.join(other)}: its loops did not hold the axes."
            yield Finding("axis-not-held", text, r.pair.where, Effect.ERROR)
            return
        whole = (plan.nudges if r.turns else plan.periods) * samples(plan, period_s)
        if len(r.t) < (1 - plan.max_lost) * whole:
            text = f"found {len(r.t)} samples; expected {whole}: whole periods, or a rest of one looks like coupling."
            yield Finding("sines-missing", text, r.pair.where, Effect.ERROR)
            return
    lost, expected = np.array([(r.lost, r.expected) for r in runs], dtype=float).T
    yield from signals.losses(lost, expected, plan.max_lost, lambda share: runs[int(np.argmax(share))].pair.where)
    for r in runs:
        if r.turns == 0:
            yield from _limits(r, rig, plan)


def _limits(r: Run, rig: RigFile, plan: Plan) -> Iterator[Finding]:
    for axis, asked in ((r.pair.moved, r.moved.asked), (r.pair.held, r.held.asked)):
        if axis.limit not in rig.parameters:
            continue
        limit = plan.parameters.get(axis.limit, rig.parameters[axis.limit].default)
        share = float((np.abs(asked) >= LIMIT * limit).mean())
        if share > LIMITED:
            text = (f"the loop of {axis.name} asks for its limit, {limit:g} {axis.force}, in {share:.1%} of the samples: "
                    "what is read is that of the limit. Move slower or less.")  # fmt: skip
            yield Finding("asks-for-its-limit", text, r.pair.where, Effect.INDETERMINATE, (f"@{r.pair.where}",))


def size_of(pair: Pair, plan: Plan) -> float:
    """Of the moved axis' sine."""
    return plan.amplitude_m if pair.moved.unit == "m" else plan.amplitude_rad


def of_results(results: Sequence[Result], plan: Plan) -> Iterator[Finding]:
    """Sines that were not followed, axes that are stuck; what is known of each."""
    for r in results:
        yield from _moved(r, plan)
        yield from _stuck(r, plan)
        yield _known(r)


def _moved(r: Result, plan: Plan) -> Iterator[Finding]:
    size = size_of(r.pair, plan)
    for what, sine in (("set point", r.sent), ("reading", r.went)):
        if abs(sine.amplitude / size - 1) > plan.max_miss:
            text = (f"the {what} of {r.pair.moved.name} swings by {sine.amplitude:.4g} {r.pair.moved.unit}; expected "
                    f"{size:.4g}: {r.pair.held.name} was not tried by the motion of the plan.")  # fmt: skip
            yield Finding("sine-not-followed", text, r.pair.where, Effect.INDETERMINATE, (f"@{r.pair.where}",))
            return


def stuck(r: Result, plan: Plan) -> bool:
    """Whether friction hides what crosses over: the held axis does not go with a nudge, or friction takes more than half of
    the cross force's peak, or is a good part of what is seen of it, and is worth a share of a count."""
    assert r.pair.held.pitch is not None
    if min(r.slow.follow, r.fast.follow) < FOLLOWS:
        return True
    much = r.slow.drag > r.cross.peak / 2 or r.cross.dragged > DRAGGED * r.cross.rms
    return much and r.hidden > plan.max_hidden * r.pair.held.pitch.value


def _stuck(r: Result, plan: Plan) -> Iterator[Finding]:
    if not stuck(r, plan):
        return
    held, moved, force = r.pair.held, r.pair.moved, r.pair.held.force
    follow = min(r.slow.follow, r.fast.follow)
    still = " and does not move by a count" if not np.ptp(r.place) else ""
    text = (f"{held.name} is stuck{still} while {moved.name} moves: friction takes {abs(r.slow.drag):.2g} {force} of a slow "
            f"nudge, which it follows by {follow:.0%}; the cross force that the loop sees is {r.cross.peak:.2g} {force} at "
            "most. A force within the friction moves nothing, so that the excursion says nothing of the controller's map. Is a "
            "brake left on? Does the bearing rub each way alone?")  # fmt: skip
    concerned = (excursion_of(r.pair), ratio_of(r.pair), *named(r.pair), coupling_of(r.pair))
    yield Finding(
        "stuck", text, r.pair.where, Effect.INDETERMINATE, tuple(f"{name}@{r.pair.where}" for name in concerned)
    )


def _known(r: Result) -> Finding:
    """What an excursion is worth: friction and stiffness beside it."""
    held, force = r.pair.held, r.pair.held.force
    assert held.pitch is not None
    text = (f"while {r.pair.moved.name} moves, a slow nudge of {held.name} takes {abs(r.slow.drag):.2g} {force}, "
            f"{abs(r.hidden) / held.pitch.value:.2g} counts of a loop of {r.stiffness:.4g} {force}/{held.unit}; more drag by "
            f"{abs(r.fast.drag - r.slow.drag) / (r.fast.speed - r.slow.speed):.2g} {force} s/{held.unit}.")  # fmt: skip
    return Finding("friction-beside", text, r.pair.where)
