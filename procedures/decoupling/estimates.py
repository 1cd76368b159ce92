"""From runs to results with influences: excursion of the held axis, ratio of peaks, cross force, force for force."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.decoupling import fit
from procedures.decoupling.fit import Cross, Nudge, Sine
from procedures.decoupling.plan import Plan
from procedures.decoupling.steps import FAST, SLOW, Run
from procedures.stages.counts import half_count, rounded
from procedures.stages.pairs import Pair, inertia_of

Array = npt.NDArray[np.float64]
RECTANGLE = math.sqrt(3)
DRAG_SHARE = 0.25  # half width: of the drag's part in a result, for it changes along the path
SWINGS = 6.0  # counts a period, at least: an axis that swings by half a count with the motion, unseen, takes pi at its greatest
STANDS = 30.0  # counts a period of an axis whose reading stands: without the chatter that makes it less, drag is three times as
# much, and it may go through a count in a tenth of a period. The more often the reading changes, the less
PEAK = 2.0  # of what is not seen, over its effective value


@dataclass(frozen=True)
class Swing:
    """Of a held axis: its largest excursion in counts, and what it moves, kg or kg m^2."""

    counts: float
    inertia: float


@dataclass(frozen=True)
class Result:
    """Of one pair: `wave` its sine, `sent`, as the controller's set point has it, and `went`, as it is read; the largest
    `excursion` of the held axis; its reading (p, n) over the periods, less its set point, that of the moved
    axis, and that one's `rate` (n,) over its greatest; its cross force; how it follows a
    nudge, slow and fast; `stiffness` of its loop; estimates by quantity."""

    pair: Pair
    sent: Sine
    went: Sine
    excursion: float
    place: Array
    moved: Array
    rate: Array
    cross: Cross
    slow: Nudge
    fast: Nudge
    stiffness: float
    estimates: Mapping[str, Estimate]

    @property
    def hidden(self) -> float:
        """What friction holds against the loop when the held axis is moved slowly, m or rad."""
        return self.slow.drag / self.stiffness if self.stiffness > 0 else math.inf


def results(runs: Sequence[Run], rig: RigFile, plan: Plan, period_s: float) -> list[Result]:
    """Of every pair, in the order of the runs; `period_s` of the telemetry."""
    alone = [r for r in runs if r.turns == 0]
    return [result(r, _nudge(runs, r, SLOW, plan, period_s), _nudge(runs, r, FAST, plan, period_s), rig, plan, period_s)
            for r in alone]  # fmt: skip


def samples(plan: Plan, period_s: float) -> int:
    """Of a period."""
    return round(plan.period_s / period_s)


def _nudge(runs: Sequence[Run], of: Run, turns: float, plan: Plan, period_s: float) -> Nudge:
    run = next(r for r in runs if r.pair.where == of.pair.where and r.turns == turns)
    n = samples(plan, period_s)
    force, place = (fit.periods(run.t, x, plan.period_s, plan.nudges, n) for x in (run.held.asked, run.held.read))
    t = run.t[0] + np.arange(n) * (plan.period_s / n)
    sent = fit.sine(run.t, run.held.reference, plan.period_s / turns)
    on = fit.sliding(fit.sine(run.t, run.moved.reference, plan.period_s), t, plan.sliding)
    return fit.nudge(force, place, sent, t, on)


def result(run: Run, slow: Nudge, fast: Nudge, rig: RigFile, plan: Plan, period_s: float) -> Result:
    """Of one pair."""
    n = samples(plan, period_s)
    cut = {
        name: fit.periods(run.t, x, plan.period_s, plan.periods, n)
        for name, x in (("place", run.held.read - run.held.reference), ("force", run.held.asked), ("other", run.moved.asked),
                        ("moved", run.moved.read))
    }  # fmt: skip
    sent, went = (fit.sine(run.t, x, plan.period_s) for x in (run.moved.reference, run.moved.read))
    t = run.t[0] + np.arange(n) * (plan.period_s / n)
    on = fit.sliding(sent, t, plan.sliding)
    drag, inertia = fit.dragging(slow, fast), inertia_of(rig, run.pair.held, plan.inertia)
    found = fit.cross(
        cut["force"], cut["other"], cut["place"], plan.period_s, on, plan.smooth_hz, inertia, drag,
    )  # fmt: skip
    within = run.t <= run.t[0] + plan.periods * plan.period_s
    excursion = float(np.abs(run.held.read - run.held.reference)[within].max())
    peak = float(np.ptp(run.moved.read[within])) / 2
    estimates = {
        **_places(run.pair, excursion, peak),
        **_forces(run.pair, found, slow, fast, Swing(excursion / _count(run.pair), inertia), plan),
    }
    rate = np.cos(sent.angle(t))
    return Result(
        run.pair, sent, went, excursion, cut["place"], cut["moved"], rate, found, slow, fast, run.stiffness, estimates
    )


def _count(pair: Pair) -> float:
    assert pair.held.pitch is not None
    return pair.held.pitch.value


def _places(pair: Pair, excursion: float, peak: float) -> dict[str, Estimate]:
    """Largest excursion and its ratio to the sine's peak."""
    largest = excursion + rounded(pair.where, pair.held, half_count(pair.held))
    out = {excursion_of(pair): largest}
    if peak > 0:
        out[ratio_of(pair)] = largest * (1 / peak)
    return out


def excursion_of(pair: Pair) -> str:
    """Which of the excursions a pair has."""
    return "excursion" if pair.held.unit == "m" else "excursion_angle"


def ratio_of(pair: Pair) -> str:
    """Which of the ratios of peaks a pair has."""
    if pair.held.unit == pair.moved.unit:
        return "peak_ratio"
    return "peak_per_angle" if pair.held.unit == "m" else "peak_per_stroke"


def coupling_of(pair: Pair) -> str:
    """Which of the ratios of forces a pair has."""
    if pair.held.force == pair.moved.force:
        return "cross_share"
    return "force_per_torque" if pair.held.force == "N" else "torque_per_force"


def named(pair: Pair) -> tuple[str, str]:
    """Effective value and peak of what crosses over."""
    return ("cross_force", "peak_cross_force") if pair.held.force == "N" else ("cross_torque", "peak_cross_torque")


def _forces(pair: Pair, found: Cross, slow: Nudge, fast: Nudge, swing: Swing, plan: Plan) -> dict[str, Estimate]:
    """Cross force, its peak, and per force of the moved axis' loop."""
    force, (rms, peak) = pair.held.force, named(pair)
    unseen = _unseen(pair, found, (slow, fast), swing, plan)
    per = 1 / found.other if found.other > 0 else 0.0
    drags = [DRAG_SHARE * x for x in (abs(found.rms - found.plain), 2 * found.dragged, found.dragged * per / 2)]
    wanted = ((rms, found.rms, force, unseen), (peak, found.peak, force, unseen * PEAK),
              (coupling_of(pair), found.slope, "", unseen * per))  # fmt: skip
    out = {}
    for (name, value, unit, within), by, drag in zip(wanted, found.by_period, drags, strict=True):
        known, noise = f"{name}/{pair.where}", float(by.std(ddof=1)) / math.sqrt(len(by))
        out[name] = Estimate(value, unit, {
            _scale(pair, plan): value,
            Influence(f"scatter/{known}", "scatter of the periods", noise, unit, "A", "normal", len(by) - 1): 1.0,
            _flat(f"drag/{known}", "drag that changes along the path", drag, unit): 1.0,
            _flat(f"within/{known}", "motion within a count, which friction takes up", within, unit): 1.0,
        })  # fmt: skip
    return out


def _unseen(pair: Pair, found: Cross, nudges: tuple[Nudge, Nudge], swing: Swing, plan: Plan) -> float:
    """What drag and mass take of a motion that the reading does not show: half a count at the cross force's own pace w,
    |J w^2 + j b w|, of one count; of more counts it is less, for their edges lie where they may."""
    drag = max(abs(n.drag) / n.speed for n in nudges)
    pace = min(found.pace, 2 * math.pi * plan.smooth_hz)
    moving = math.hypot(drag * pace, swing.inertia * pace**2) * _count(pair) / 2 / max(swing.counts, 1.0)
    standing = max(STANDS - found.changes, SWINGS) * drag * _count(pair) / plan.period_s
    return max(moving, standing)


def _flat(known: str, name: str, half: float, unit: str) -> Influence:
    return Influence(known, name, half / RECTANGLE, unit, "B", "rectangular")


def _scale(pair: Pair, plan: Plan) -> Influence:
    """True newtons for one that the controller's map makes."""
    forces = pair.held.force == "N"
    u, what = (plan.force_scale, "forces") if forces else (plan.torque_scale, "torques")
    return Influence(
        f"map_scale/{pair.held.name}", f"scale of {what} by the controller's map", u, "1", "B", "normal",
        source="the plan: the controller's map is no reference for itself",
    )  # fmt: skip
