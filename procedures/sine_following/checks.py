"""What can be wrong with sines, and what their data say about it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.rigfile.stage import StageAxis
from procedures.sine_following.estimates import Group
from procedures.sine_following.fit import off_sine
from procedures.sine_following.plan import Plan
from procedures.sine_following.steps import SINE, Ride, amplitude, modes_of
from procedures.stages.counts import half_count, pitch_of
from procedures.stages.tracks import Track, of_forces, of_signals, where_of

FOLLOWED = 0.5  # of the amplitude


def told(axis: StageAxis, value: float) -> str:
    """A length or an angle for a reader."""
    return f"{math.degrees(value):z.3f}°" if axis.unit == "rad" else f"{value * 1e3:z.4f} mm"


def of_rides(rides: Sequence[Ride], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Missing periods, and what any positioned stage shows; set points that are not the sine."""
    expected = sum(len(m.axes) for m in modes_of(rig, plan))
    if len(rides) < expected or any(len(r.periods(plan)) < plan.periods for r in rides):
        fewest = min((len(r.periods(plan)) for r in rides), default=0)
        text = (f"found {len(rides)} sines of axes with {fewest} periods or more; expected {expected} with {plan.periods}: "
                "the run was stopped early, or samples are missing")  # fmt: skip
        yield Finding("periods-missing", text, SINE, Effect.ERROR)
        return
    yield from of_signals(by_axis(rides), plan.max_lost)
    for r in rides:
        whole = slice(0, r.periods(plan)[-1].stop)
        off = off_sine(r.track.t[whole], r.track.reference[whole], plan.period_s, amplitude(r.track.axis, plan))
        if off > plan.max_off:
            sine = f"a sine of {told(r.track.axis, amplitude(r.track.axis, plan))} and {plan.period_s:g} s"
            text = (f"the set point of {r.track.axis.name} is up to {off:.1%} of the amplitude off {sine}; "
                    f"{plan.max_off:.1%} is allowed")  # fmt: skip
            yield Finding("set-point-elsewhere", text, where_of(r.mode, r.track.axis), Effect.ERROR)
            return


def by_axis(rides: Sequence[Ride]) -> dict[str, list[Track]]:
    """Tracks by mode and axis."""
    return {where_of(r.mode, r.track.axis): [r.track] for r in rides}


def of_groups(groups: Sequence[Group], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Axes that do not follow; counts and forces."""
    for g in groups:
        worst = max(max(f.ahead.value, f.behind.value) for f in g.found)
        if worst > FOLLOWED * amplitude(g.axis, plan):
            text = f"the axis is up to {told(g.axis, worst)} off, more than half of the amplitude: it does not follow"
            yield Finding("axis-lags-its-sine", text, g.where)
    yield from of_forces(rig, by_axis([g.ride for g in groups]))
    for axis in {g.axis.name: g.axis for g in groups}.values():
        count, half = told(axis, pitch_of(axis)), told(axis, half_count(axis))
        text = (f"{axis.channel} is told to a count of {count}: a place is known to {half} by its own scale, and what rounding "
                "adds to a largest value is taken off.")  # fmt: skip
        yield Finding("reading-quantised", text, axis.name)
