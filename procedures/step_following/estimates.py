"""Numbers with influences: by mode, axis and way over the repeats that count."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from bench.rigfile.stage import StageAxis
from bench.uncertainty import Estimate, Influence
from procedures.stages.counts import (
    BOUND,
    RECTANGLE,
    averaged,
    bounded,
    edges,
    erred,
    half_count,
    pitch_of,
    rested,
    rounded,
    stretched,
    topped,
)
from procedures.stages.tracks import Mode, named, where_of, without
from procedures.step_following.fit import Stepped, began, stepped
from procedures.step_following.plan import Plan
from procedures.step_following.steps import UP, Move, places, step_of

ALIKE = 1e-3  # of a sample's period, by which loops and telemetry have the same
EVEN = 0.25  # of half a count: an eighth of a whole one
ERROR, TRUE, OVER, TIME = "static_error", "true_static_error", "overshoot", "settling_time"


@dataclass(frozen=True)
class Group:
    """Moves of one axis one way in one mode, with what each of them was; `where` is what its results are called."""

    mode: Mode
    axis: StageAxis
    way: str
    where: str
    moves: Sequence[Move]
    found: Sequence[Stepped]


@dataclass(frozen=True)
class Results:
    """Groups in time order, estimates by quantity and where."""

    groups: Sequence[Group]
    estimates: Mapping[tuple[str, str], Estimate]


def grouped(moves: Iterable[Move], plan: Plan) -> list[Group]:
    """Moves that count, by mode, axis and way."""
    some: dict[tuple[str, str, str], list[Move]] = {}
    for m in moves:
        if m.repeat >= 0:
            some.setdefault((m.mode.name, m.track.axis.name, m.way), []).append(m)
    return [_group(g, plan) for g in some.values()]


def _group(moves: Sequence[Move], plan: Plan) -> Group:
    mode, axis, way = moves[0].mode, moves[0].track.axis, moves[0].way
    where = where_of(mode, axis, way, without(plan.integrators))
    return Group(mode, axis, way, where, moves, [one(m, plan) for m in moves])


def one(move: Move, plan: Plan) -> Stepped:
    """What one move was."""
    track, axis = move.track, move.track.axis
    step, target = step_of(axis, plan, move.way), places(axis, plan)[move.way == UP]
    rest = max(round(plan.rest_s / float(np.median(np.diff(track.t)))), 2)
    begun = began(track.reference) or 0
    return stepped(track.t, track.read, target, step, begun, rest, plan.band, pitch_of(axis))


def results(groups: Sequence[Group], plan: Plan, loop_s: float) -> Results:
    """All estimates; `loop_s`: period of the loops at whose ticks set points start, s, 0 where that is not known."""
    out: dict[tuple[str, str], Estimate] = {}
    for g in groups:
        out |= _of_group(g, plan, loop_s)
    return Results(groups, out)


def _of_group(g: Group, plan: Plan, loop_s: float) -> Mapping[tuple[str, str], Estimate]:
    axis, where, way = g.axis, g.where, (1.0 if g.way == UP else -1.0)
    size = abs(step_of(axis, plan, g.way))
    target = places(axis, plan)[g.way == UP]
    errors, tops = [f.error for f in g.found], [f.overshoot * size for f in g.found]
    place = rested(f"{ERROR}/{where}", axis, errors, [f.entered for f in g.found])
    beyond = edges(axis) + erred(axis, f"{target:g}") + stretched(axis, target)
    over = bounded(f"{OVER}/{where}", axis, tops, topped(f"{OVER}/{where}", axis, tops, [f.stood for f in g.found]))
    out = {
        (named(ERROR, axis), where): bounded(f"{ERROR}/{where}", axis, errors, place),
        (named(TRUE, axis), where): place - way * beyond,
        (OVER, where): Estimate(over.value / size, "1", {i: c / size for i, c in over.sensitivities.items()}),
    }
    if all(f.settled is not None for f in g.found):
        out[TIME, where] = _time(g) + _start(g, loop_s)
    return out


def _start(g: Group, loop_s: float) -> Estimate:
    """What a settling time is shorter by, s: the set point starts at a tick of the loops after the last sample at which it is
    where it was, at one before the next sample; each step for itself, at any of them alike likely."""
    period = float(np.median(np.diff(g.moves[0].track.t)))
    half = max(period - loop_s, 0.0) / 2
    if half < ALIKE * period:
        return Estimate(0.0, "s", {})
    u = half / RECTANGLE / math.sqrt(len(g.moves))
    form: Literal["rectangular", "normal"] = "rectangular" if len(g.moves) == 1 else "normal"
    return Estimate.of(
        -half, Influence(f"start/{g.where}", "set point's start, between two samples", u, "s", "B", form)
    )


def _time(g: Group) -> Estimate:
    """Settling: all times that parabolas tell are alike likely; at half a count a sample they are. Where none was asked, edges
    are passed between two samples, and where the rate changes by no more than itself from edge to edge of a count, the place is
    up to an eighth of that time off its straight line."""
    found = [f.settling for f in g.found if f.settling is not None]
    slope, within = (float(np.mean([getattr(s, what) for s in found])) for what in ("slope", "within"))
    share = averaged([s.at for s in found])
    off = rounded(f"{TIME}/{g.where}", g.axis, EVEN * half_count(g.axis) * share)
    known, what = f"sampling/{g.where}", "between two samples"
    if all(s.passed for s in found):
        told = Influence(known, what, share * within / RECTANGLE, "s", "B", "rectangular")
    else:
        told = Influence(known, what, share * within / BOUND, "s", "B", "normal")
    turned = Estimate(float(np.mean([s.at for s in found])), "s", {i: c * slope for i, c in off.sensitivities.items()})
    return turned + Estimate.of(0.0, told)
