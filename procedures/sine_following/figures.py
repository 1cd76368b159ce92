"""What is looked at: of each mode and axis the set point and the reading over a period, and beneath them the error."""

from __future__ import annotations

import math
from collections.abc import Iterable

from bench.figures import Figure, Series
from procedures.sine_following.estimates import Group, Results
from procedures.sine_following.plan import Plan
from procedures.stages.counts import half_count
from procedures.stages.tracks import TOGETHER

POINTS = 1500  # of a curve


def scale_of(unit: str) -> tuple[float, str, float, str]:
    """Of an axis' place and of its errors, each a factor with its unit."""
    return (1e3, "mm", 1e6, "µm") if unit == "m" else (180 / math.pi, "°", 180 / math.pi, "°")


def all_figures(found: Results, plan: Plan) -> Iterable[Figure]:
    """One of each mode and axis."""
    return (_period(g, plan) for g in found.groups)


def _period(g: Group, plan: Plan) -> Figure:
    factor, unit, fine, small = scale_of(g.axis.unit)
    track, periods = g.ride.track, g.ride.periods(plan)
    above: tuple[Series, ...] = ()
    below: tuple[Series, ...] = ()
    for name, cut in (("first", periods[0]), ("last", periods[-1])):
        thin = max((cut.stop - cut.start) // POINTS, 1)
        t = (track.t[cut] - track.t[cut.start])[::thin]
        if not above:
            above = (Series("set point", t, factor * track.reference[cut][::thin], "guide"),
                     Series("reading", t, factor * track.read[cut][::thin]))  # fmt: skip
        below += (Series(f"{name} period", t, fine * (track.read[cut] - track.reference[cut])[::thin]),)
    half = fine * half_count(g.axis)
    detail = Figure("", "", "", "time / s", f"error / {small}", below, bands=(("one count", -half, half),))
    together = g.ride.mode.name == TOGETHER
    title = f"Sine of {g.axis.name}{', with the other axes' if together else ''}"
    caption = ("Above the set point and the reading over the first period that counts, below the reading less the set point in "
               "the first and in the last one. The band is one count of the encoder.")  # fmt: skip
    return Figure(f"sine-{g.ride.mode.name}-{g.axis.name}", title, caption, "time / s", f"{g.axis.name} / {unit}", above,
                  below=detail)  # fmt: skip
