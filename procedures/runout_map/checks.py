"""What can be wrong with turns, and what their data can say about it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from procedures.position_loops import recorded
from procedures.runout_map.estimates import Results, mean
from procedures.runout_map.plan import Plan
from procedures.runout_map.steps import Turned
from procedures.shared import signals

GAP = 0.02  # of a turn, between neighbouring angles
PROGRESS = 0.05  # by which the speed may differ from the plan's
AWAY_M = 0.2e-3  # that a place may read off
APART = 5.0  # standard uncertainties
LEAST_M = 0.3e-6  # that may turn the other way in any case


def of_signals(turned: Sequence[Turned], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """No turns, not levitated, not all of a turn, elsewhere, losses."""
    kinds = {key: sum((t.place, t.sign) == key for t in turned) for key in ((t.place, t.sign) for t in turned)}
    if not turned or min(kinds.values()) < 2 or any((place, -sign) not in kinds for place, sign in kinds):
        text = "found less than two turns each way of a place (was the run stopped early?)"
        yield Finding("no-turns", text, "", Effect.ERROR)
        return
    if (told := recorded.not_held(((t.where, t.states) for t in turned), rig)) is not None:
        yield told
        return
    for t in turned:
        if (told := _covered(t, plan)) is not None:
            yield told
            return
    yield from signals.losses_of(turned, plan.max_lost)


def _covered(t: Turned, plan: Plan) -> Finding | None:
    gap = float(np.diff(np.sort(np.concatenate([t.angle, [0.0, 2 * math.pi]]))).max()) / (2 * math.pi)
    if gap > GAP:
        return Finding(
            "way-not-covered", f"{gap:.2g} of a turn is between two samples; {GAP:g} allowed.", t.where, Effect.ERROR
        )
    speed = abs(float(np.polyfit(t.times, t.angle, 1)[0]))
    if abs(speed / plan.speed_rad_s - 1) > PROGRESS:
        text = f"the shaft turned at {speed:.3g} rad/s; expected {plan.speed_rad_s:.3g}."
        return Finding("way-not-covered", text, t.where, Effect.ERROR)
    if abs(t.stood - t.place) > AWAY_M:
        return Finding("way-not-covered", f"the shaft stood at {t.stood * 1e3:.4g} mm.", t.where, Effect.ERROR)
    return None


def of_results(r: Results, plan: Plan) -> Iterator[Finding]:
    """Readings that the loops did not hold, what does not turn with the shaft."""
    worst = max(r.seen, key=lambda s: max(abs(x) for x in s.reading))
    if (left := max(abs(x) for x in worst.reading)) > plan.max_reading_m:
        text = (f"readings turn by {left * 1e6:.2g} µm with the shaft, {plan.max_reading_m * 1e6:.2g} µm allowed: the loops do "
                "not hold them. Turn slower, or look at the integrators.")  # fmt: skip
        yield Finding("reading-not-held", text, f"{worst.plane.name}, {worst.place}", Effect.INDETERMINATE)
    greatest = max(abs(mean(s.whole, s.signs)) for s in r.seen)
    allowed = plan.max_other * greatest + LEAST_M + APART * r.u_whole
    for s in r.seen:
        if (other := abs(mean(s.other, s.signs))) > allowed:
            text = (f"{other * 1e6:.2g} µm turn the other way than the shaft, {allowed * 1e6:.2g} µm allowed: a probe or a "
                    "current of one axis is reversed, dead or read wrongly.")  # fmt: skip
            yield Finding("other-way", text, f"{s.plane.name}, {s.place}", Effect.INDETERMINATE)
            return
