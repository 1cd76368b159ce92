"""What is looked at: by mode and axis the set point and the reading of the last steps, and beneath them the error in detail."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from bench.figures import Figure, Series
from procedures.stages.counts import half_count
from procedures.stages.tracks import TOGETHER
from procedures.step_following.estimates import Group, Results
from procedures.step_following.fit import began
from procedures.step_following.plan import Plan
from procedures.step_following.steps import UP, places, step_of

POINTS = 1500  # of a curve
CLOSE = 0.01  # of a step: the error in detail


def scale_of(unit: str) -> tuple[float, str, float, str]:
    """Of an axis' place and of its errors, each a factor with its unit."""
    return (1e3, "mm", 1e6, "µm") if unit == "m" else (180 / math.pi, "°", 180 / math.pi, "°")


def all_figures(found: Results, plan: Plan) -> Iterable[Figure]:
    """Of each mode and axis one, then the repeats."""
    pairs: dict[tuple[str, str], list[Group]] = {}
    for g in found.groups:
        pairs.setdefault((g.mode.name, g.axis.name), []).append(g)
    for groups in pairs.values():
        yield _steps(groups, plan)
    for groups in pairs.values():
        yield _repeats(groups)


def _title(g: Group) -> str:
    return f"{g.axis.name}{', with the other axes' if g.mode.name == TOGETHER else ''}"


def _steps(groups: Sequence[Group], plan: Plan) -> Figure:
    """The last step each way, and the error around the set point with one count."""
    factor, unit, fine, small = scale_of(groups[0].axis.unit)
    above: list[Series] = []
    below: list[Series] = []
    for g in groups:
        track = g.moves[-1].track
        start = began(track.reference) or 0
        thin = max(len(track.t) // POINTS, 1)
        t = track.t[start:][::thin] - track.t[start]
        above.append(Series(f"set point, {g.way}", t, factor * track.reference[start:][::thin], "guide"))
        above.append(Series(f"reading, {g.way}", t, factor * track.read[start:][::thin]))
        error = fine * (track.read[start:][::thin] - places(g.axis, plan)[g.way == UP])
        reach = fine * max(CLOSE * abs(step_of(g.axis, plan, g.way)), 5 * half_count(g.axis))
        below.append(Series(g.way, t, np.where(np.abs(error) < reach, error, math.nan)))
    half = fine * half_count(groups[0].axis)
    detail = Figure("", "", "", "time since the set point's start / s", f"error / {small}", tuple(below),
                    bands=(("one count", -half, half),))  # fmt: skip
    caption = ("The last step each way: above the set point and the reading, below the reading less where the axis was sent, "
               "near zero. The band is one count of the encoder.")  # fmt: skip
    key = f"step-{groups[0].mode.name}-{groups[0].axis.name}"
    return Figure(key, f"Steps of {_title(groups[0])}", caption, "time since the set point's start / s",
                  f"{groups[0].axis.name} / {unit}", tuple(above), below=detail)  # fmt: skip


def _repeats(groups: Sequence[Group]) -> Figure:
    """Static errors one after the other."""
    _, _, fine, small = scale_of(groups[0].axis.unit)
    series = tuple(
        Series(g.way, np.arange(1.0, len(g.found) + 1), fine * np.array([f.error for f in g.found]), "points",
               np.full(len(g.found), fine * half_count(g.axis)))
        for g in groups
    )  # fmt: skip
    caption = "Where the axis stands beyond its set point, repeat by repeat; bars are half a count."
    key = f"repeats-{groups[0].mode.name}-{groups[0].axis.name}"
    return Figure(key, f"Static errors of {_title(groups[0])}", caption, "repeat", f"beyond the set point / {small}",
                  series)  # fmt: skip
