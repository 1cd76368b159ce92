"""What can be wrong with steps, and what their data say about it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.rigfile.stage import StageAxis
from procedures.stages.counts import half_count, pitch_of
from procedures.stages.tracks import STANDS, Track, of_forces, of_signals, where_of
from procedures.step_following.estimates import ERROR, TIME, TRUE, Group
from procedures.step_following.fit import began
from procedures.step_following.plan import Plan
from procedures.step_following.steps import STEP, UP, Move, modes_of, places, step_of

FOLLOWED = 0.5  # of a step
ELSEWHERE = 1e-3  # of a step, by which a set point may miss where it was sent


def told(axis: StageAxis, value: float) -> str:
    """A length or an angle for a reader; what is under a micrometre by three digits."""
    if axis.unit == "rad":
        return f"{math.degrees(value):z.3f}°"
    return f"{value * 1e3:z.4f} mm" if abs(value) >= 1e-6 or not value else f"{value * 1e6:.3g} µm"


def of_moves(moves: Sequence[Move], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Missing steps, and what any positioned stage shows; set points that were not taken."""
    per_mode = 2 * (plan.lead + plan.repeats)
    expected = sum(per_mode * len(m.axes) for m in modes_of(rig, plan))
    if len(moves) < expected or any(len(m.track.t) < 3 for m in moves):
        text = f"found {len(moves)} moves of axes; expected {expected}: the run was stopped early"
        yield Finding("axis-steps-missing", text, STEP, Effect.ERROR)
        return
    yield from of_signals(by_axis(moves), plan.max_lost)
    for m in moves:
        axis, reference = m.track.axis, m.track.reference
        target, step = places(axis, plan)[m.way == UP], step_of(axis, plan, m.way)
        off = float(reference[-1]) - target
        if began(reference) is None or abs(off) > max(ELSEWHERE * abs(step), STANDS * pitch_of(axis)):
            text = (f"the set point of {axis.name} ends {told(axis, off)} from where it was sent, repeat {m.repeat + 1} "
                    f"{m.way}: did the controller take it?")  # fmt: skip
            yield Finding("set-point-elsewhere", text, where_of(m.mode, axis), Effect.ERROR)
            return


def by_axis(moves: Sequence[Move]) -> dict[str, list[Track]]:
    """Tracks by mode and axis."""
    out: dict[str, list[Track]] = {}
    for m in moves:
        out.setdefault(where_of(m.mode, m.track.axis), []).append(m.track)
    return out


def of_groups(groups: Sequence[Group], moves: Sequence[Move], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Axes that do not follow, that do not come to rest, that do not settle; counts and forces."""
    for g in groups:
        yield from _of_group(g, plan)
    yield from of_forces(rig, by_axis([m for m in moves if m.repeat >= 0]))
    for axis in {g.axis.name: g.axis for g in groups}.values():
        stays = sum(f.moved < STANDS * pitch_of(axis) for g in groups if g.axis == axis for f in g.found)
        count = sum(len(g.found) for g in groups if g.axis == axis)
        text = (f"{axis.channel} is told to a count of {told(axis, pitch_of(axis))}; in {stays} of {count} rests it changes by "
                f"one at most. Where the axis stands is known to {told(axis, half_count(axis))} by its own scale.")  # fmt: skip
        yield Finding("reading-quantised", text, axis.name)


def _of_group(g: Group, plan: Plan) -> Iterator[Finding]:
    size, axis = abs(step_of(g.axis, plan, g.way)), g.axis
    lags = [f for f in g.found if f.error < -FOLLOWED * size]
    if lags:
        text = (f"in {len(lags)} of {len(g.found)} steps the axis ends more than half of the step short of its set point: it "
                "is not followed")  # fmt: skip
        yield Finding("not-followed", text, g.where)
    restless = max(f.moved for f in g.found)
    if restless > max(STANDS * pitch_of(axis), plan.max_moved * size):
        count = sum(f.moved > max(STANDS * pitch_of(axis), plan.max_moved * size) for f in g.found)
        text = (f"in {count} of {len(g.found)} steps the axis does not rest in the last {plan.rest_s:g} s: it moves by up to "
                f"{told(axis, restless)}. Wait longer (dwell_s); if it swings, look at the gains.")  # fmt: skip
        what = tuple(f"{name}{end}@{g.where}" for name in (ERROR, TRUE) for end in ("", "_angle"))
        yield Finding("still-moving", text, g.where, Effect.INDETERMINATE, what)
    if late := sum(f.settled is None for f in g.found):
        text = f"in {late} of {len(g.found)} steps the axis is outside ±{plan.band:.0%} of the step at the end"
        yield Finding("not-settled", text, g.where, Effect.INDETERMINATE, (f"{TIME}@{g.where}",))
    errors = np.array([f.error for f in g.found])
    if float(np.ptp(errors)) > STANDS * pitch_of(axis):
        text = (f"repeats stand {told(axis, float(errors.min()))} to {told(axis, float(errors.max()))} beyond the set point, "
                f"with a standard deviation of {told(axis, float(errors.std(ddof=1)))}: the result is their mean")  # fmt: skip
        yield Finding("repeats-apart", text, g.where)
