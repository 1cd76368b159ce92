"""Truths of a stage that was positioned while an instrument outside the loop was read."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bench.cli.truths.settings import Found

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated


def figures(done: Simulated) -> Found:
    """Of the places where the axes truly were at each reading of this run: how they come to rest hangs on friction and on
    counts, and no other run has the same."""
    from procedures.positioning.standard import FIGURES, figures
    from procedures.positioning.targets import UP, cycle
    from procedures.positioning.way import tested

    rig, plan, seen = done.recording.rig, done.recording.plan, done.drawn.seen
    for one in tested(rig, plan):
        places = [place for axis, place in seen if axis == one.axis.name]
        order = list(cycle(one.at, plan.repeats))
        if len(places) != len(order):
            continue
        x = np.empty((2, len(one.at), plan.repeats))
        for a, place in zip(order, places, strict=True):
            x[0 if a.way == UP else 1, a.target, a.repeat] = place - a.place
        end = "_angle" if one.axis.unit == "rad" else ""
        yield from ((f"{name}{end}", one.axis.name, float(v)) for name, v in zip(FIGURES, figures(x), strict=True))
