"""What can be wrong with the zeros of encoders, and what their data can say about it."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence

import numpy as np

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.uncertainty import interval
from procedures.encoder_zero.estimates import Result, differences, shifts
from procedures.encoder_zero.groups import PLACES, Group, groups, settle_s, zeros
from procedures.encoder_zero.plan import Plan
from procedures.encoder_zero.steps import Answers, Taken, answers, column
from procedures.position_loops import recorded
from procedures.position_loops.motors import phase_rate
from procedures.shared import signals

DEG = 180 / math.pi
APART = 4.5  # standard uncertainties by which a sound machine's places may be apart
TAKEN = 0.1  # share of a trial that a zero may go otherwise than it should
AGAINST = math.pi / 2


def of_signals(taken: Sequence[Taken], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Nothing stepped or captured, not levitated, losses, loops at their limit, currents that are not what was asked for."""
    if not taken:
        yield Finding("no-currents", "no current was stepped; expected those of the plan (was the run stopped early?)", "",
                      Effect.ERROR)  # fmt: skip
        return
    missing = [t for t in taken if t.means is None]
    if (told := recorded.not_captured("current-not-captured", "currents", missing, len(taken))) is not None:
        yield told
        return
    if (told := recorded.not_held(((t.where, t.states) for t in taken), rig, "mover-not-held", "mover")) is not None:
        yield told
        return
    yield from signals.losses_of(taken, plan.max_lost)
    for group in groups(rig, plan):
        some = [t for t in taken if t.loop == group.loop]
        yield from _limited(some, group)
        for place, trial in [*((k, "") for k in range(PLACES)), *((PLACES - 1, m) for m in group.motors)]:
            found = answers(taken, group, place, trial)
            if found is not None:
                yield from _of_answers(found, rig, plan)
            elif not trial:
                text = (f"no whole repeat of all currents of {', '.join(group.motors)} at place {place + 1}; expected "
                        f"{plan.repeats}")  # fmt: skip
                yield Finding("currents-missing", text, group.loop, Effect.ERROR)


def names(group: Group) -> tuple[str, ...]:
    """What a group's currents tell."""
    return (
        *(f"zero@{m}" for m in group.motors),
        *(f"K_ratio@{m}/{group.motors[-1]}" for m in group.motors[:-1]),
    )


def _limited(some: Sequence[Taken], group: Group) -> Iterator[Finding]:
    if hit := [t for t in some if t.limited > 0]:
        worst = max(hit, key=lambda t: t.limited)
        text = (f"the loop was at its limit under {len(hit)} of {len(some)} currents ({worst.limited:.1%} of the time in the "
                "worst): then it holds nothing. Step less: current_A.")  # fmt: skip
        yield Finding("loop-limited", text, worst.where, Effect.INDETERMINATE, names(group))


def _of_answers(found: Answers, rig: RigFile, plan: Plan) -> Iterator[Finding]:
    group, mean = found.group, found.pairs.mean(axis=0)
    for e, (motor, way) in enumerate(group.stepped):
        where = f"{motor}, {way}, place {found.place + 1}"
        off = _asked(found, rig, e, motor, way, plan)
        if off > plan.max_off:
            text = (f"a step of {plan.current_A:g} A moved the current that should show it by {off:.1%} of it too much or too "
                    f"little, {plan.max_off:.1%} allowed: a limit, another channel, or nothing that "
                    "the controller steps.")  # fmt: skip
            yield Finding("current-wrong", text, where, Effect.ERROR)
            return
        moved = abs(mean[e, 0]) * phase_rate(rig, motor)
        if moved > plan.max_moved_rad:
            text = (f"the mover stood {2 * moved * DEG:.3g}° electrical apart under both signs, "
                    f"{2 * plan.max_moved_rad * DEG:.3g}° allowed: cogging is "
                    "another there. Wait longer: time_constants.")  # fmt: skip
            yield Finding("mover-moved", text, where, Effect.INDETERMINATE, names(group))
        change = np.abs(found.halves[1] - found.halves[0]).mean(axis=0)[e, 2::2].max() / plan.current_A
        if change > plan.max_unsettled:
            text = (f"the answer still changed by {change:.2%} of the step within the window, {plan.max_unsettled:.2%} "
                    f"allowed, {settle_s(rig, plan, group):.2g} s after it. Wait longer: time_constants.")  # fmt: skip
            yield Finding("answer-unsettled", text, where, Effect.INDETERMINATE, names(group))


def _asked(found: Answers, rig: RigFile, e: int, motor: str, way: str, plan: Plan) -> float:
    """How far a stepped current is off, as a share of the step. What is stepped across is what it has beyond the others of its
    loop, which follow one reference."""
    del rig
    row, group = found.pairs.mean(axis=0)[e], found.group
    seen = row[column(group, motor, way)]
    if way == "across":
        others = [row[column(group, m, way)] for m in group.motors if m != motor]
        seen = seen - float(np.mean(others))
    return abs(float(seen) / plan.current_A - 1)


def of_results(results: Sequence[Result], rig: RigFile, plan: Plan, doubted: Collection[str] = ()) -> Iterator[Finding]:
    """Places that disagree, motors against the others, zeros that are not taken, shared or off; how far they differ. Of what is
    `doubted` already, a quantity as findings name it, no advice is given."""
    for found in results:
        wrong = [*_places(found), *_trials(found, plan), *_against(found)]
        yield from wrong
        unsure = {*doubted, *(name for f in wrong for name in f.concerns)}
        for motor in found.group.motors:
            if f"zero@{motor}" not in unsure:
                yield from _off(found, motor, rig)
        for (one, other), by in differences(found).items():
            i = interval(by)
            told = "differ" if i.low > 0 or i.high < 0 else "may be one"
            ends = f"{i.low * DEG:.3f}° to {i.high * DEG:.3f}°"
            text = f"zeros of {one} and {other} {told}: {by.value * DEG:.3f}° electrical ({ends}) apart."
            yield Finding("zeros-compared", text, f"{one}, {other}", Effect.NOTE)


def _against(found: Result) -> Iterator[Finding]:
    for motor in found.group.motors:
        if abs(found.turns[motor]) > AGAINST:
            text = (f"its currents are laid {found.turns[motor] * DEG:.0f}° electrical off: it works against the others of its "
                    "loop. Are its coils connected the other way round, or its phases exchanged?")  # fmt: skip
            yield Finding("motor-reversed", text, motor, Effect.INDETERMINATE, names(found.group))


def _places(found: Result) -> Iterator[Finding]:
    for motor, by in found.apart.items():
        if abs(by.value) > APART * by.u:
            text = (f"the places, a quarter of an electrical turn apart, tell zeros {by.value * DEG:.3g}° apart, "
                    f"{by.u * DEG:.2g}° is its standard uncertainty: a coil the other way round, phases "
                    "in another order, or a sensor of current that is off.")  # fmt: skip
            yield Finding("places-differ", text, motor, Effect.INDETERMINATE, names(found.group))


def _trials(found: Result, plan: Plan) -> Iterator[Finding]:
    for trial in found.trials:
        went = shifts(found, trial)
        if abs(went[trial] + plan.trial_rad) > TAKEN * plan.trial_rad:
            text = (f"its zero was changed by {plan.trial_rad * DEG:.3g}°, and the currents went by {-went[trial] * DEG:.3g}°: "
                    "the controller does not take it, or takes it another way.")  # fmt: skip
            yield Finding("zero-not-taken", text, trial, Effect.INDETERMINATE, (f"zero@{trial}",))
        if along := [m for m, by in went.items() if m != trial and abs(by) > TAKEN * plan.trial_rad]:
            text = f"as its zero was changed, that of {', '.join(along)} went too: the controller takes one for both."
            yield Finding("zero-shared", text, trial, Effect.INDETERMINATE, tuple(f"zero@{m}" for m in (trial, *along)))


def _off(found: Result, motor: str, rig: RigFile) -> Iterator[Finding]:
    stated, zero = zeros(rig)[motor].stated, interval(found.estimates["zero", motor])
    if stated.half_width is None:
        return
    low, high = stated.value - stated.half_width, stated.value + stated.half_width
    if zero.low > high or zero.high < low:
        value = found.estimates["zero", motor].value
        text = (f"{value * DEG:.2f}° electrical; the rig file states {low * DEG:.3g}° to {high * DEG:.3g}°. "
                f"Force is {1 - math.cos(found.turns[motor]):.2%} short of its greatest. "
                f"Set the controller's zero to {value:.5g} rad.")  # fmt: skip
        yield Finding("zero-off", text, motor, Effect.NOTE)
