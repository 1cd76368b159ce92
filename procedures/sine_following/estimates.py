"""Numbers with influences: of each axis in each mode, over periods."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bench.rigfile.stage import StageAxis
from bench.uncertainty import Estimate, Influence
from procedures.shared.greater import greater
from procedures.sine_following.fit import Followed, Largest, followed
from procedures.sine_following.plan import Plan
from procedures.sine_following.steps import Ride, amplitude
from procedures.stages.counts import edges, erred, half_count, pitch_of, stretched
from procedures.stages.tracks import named, where_of, without

ROUNDING = "rounding of the reading"
LARGEST, TRUE, RMS, RATIO, LAG = "largest_error", "true_largest_error", "rms_error", "amplitude_ratio", "lag"


@dataclass(frozen=True)
class Group:
    """What one axis did in one mode, period by period; `where` is what its results are called."""

    ride: Ride
    where: str
    found: Sequence[Followed]

    @property
    def axis(self) -> StageAxis:
        """It."""
        return self.ride.track.axis


@dataclass(frozen=True)
class Results:
    """Groups in time order, estimates by quantity and where."""

    groups: Sequence[Group]
    estimates: Mapping[tuple[str, str], Estimate]


def grouped(rides: Sequence[Ride], plan: Plan) -> list[Group]:
    """Each ride by periods."""
    out = []
    for r in rides:
        t = r.track
        found = [followed(t.t[s], t.read[s], t.reference[s], plan.period_s, pitch_of(t.axis)) for s in r.periods(plan)]
        out.append(Group(r, where_of(r.mode, t.axis, without(plan.integrators)), found))
    return out


def results(groups: Sequence[Group], plan: Plan) -> Results:
    """All estimates."""
    out: dict[tuple[str, str], Estimate] = {}
    for g in groups:
        out |= _of_group(g, plan)
    return Results(groups, out)


def _of_group(g: Group, plan: Plan) -> Mapping[tuple[str, str], Estimate]:
    axis, where = g.axis, g.where
    ahead, behind = (side(g, name) for name in ("ahead", "behind"))
    largest = ahead if ahead.value >= behind.value else behind
    return {
        (named(LARGEST, axis), where): largest,
        (named(TRUE, axis), where): truly(g, ahead, behind, plan),
        (named(RMS, axis), where): _mean(g, RMS, "rms", axis.unit),
        (RATIO, where): _mean(g, RATIO, "ratio", "1"),
        (LAG, where): _mean(g, LAG, "lag", "s"),
    }


def side(g: Group, name: str) -> Estimate:
    """The largest error to one side, by the encoder's scale; rounding repeats itself with the periods."""
    found: list[Largest] = [getattr(f, name) for f in g.found]
    return _rounded(f"{LARGEST}/{g.where}/{name}", [x.value for x in found], [x.u for x in found], g.axis.unit)


def _mean(g: Group, quantity: str, name: str, unit: str) -> Estimate:
    values, left = ([getattr(f, key) for f in g.found] for key in (name, f"u_{name}"))
    return _rounded(f"{quantity}/{g.where}", values, left, unit)


def _rounded(identity: str, values: Sequence[float], left: Sequence[float], unit: str) -> Estimate:
    """Mean over periods with the u that rounding leaves of one: they are nearly alike, and so is their rounding."""
    u = float(np.sqrt(np.mean(np.square(left))))
    return Estimate.of(float(np.mean(values)), Influence(f"rounding/{identity}", ROUNDING, u, unit, "B", "normal"))


def truly(g: Group, ahead: Estimate, behind: Estimate, plan: Plan) -> Estimate:
    """The largest true error. Edges of counts that lie off the zero make the error larger to one side and smaller to the other,
    so that the larger of both grows either way."""
    axis, size = g.axis, amplitude(g.axis, plan)
    constant = edges(axis)
    up = ahead - constant - erred(axis, f"{g.where}/ahead") + stretched(axis, size)
    down = behind + constant - erred(axis, f"{g.where}/behind") + stretched(axis, size)
    return greater(up, down)


def half(g: Group) -> float:
    """Half a count of its encoder."""
    return half_count(g.axis)
