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
    from procedures.positioning.steps import READ, READING
    from procedures.positioning.targets import UP
    from procedures.positioning.way import tested

    recording, plan = done.recording, done.recording.plan
    told = [e["number"] for e in recording.events(READ)]
    if len(told) != len(done.drawn.seen):
        return
    saw = {number: place for number, (_, place) in zip(told, done.drawn.seen, strict=True)}
    for one in tested(recording.rig, plan):
        x = np.full((2, len(one.at), plan.repeats), np.nan)
        for step in recording.steps(READING):
            labels = step.labels
            if labels["axis"] == one.axis.name:  # of more readings at one approach the last one counts
                x[0 if labels["way"] == UP else 1, labels["target"], labels["repeat"]] = (
                    saw[labels["number"]] - labels["place"]
                )
        if np.isnan(x).any():
            continue
        end = "_angle" if one.axis.unit == "rad" else ""
        yield from ((f"{name}{end}", one.axis.name, float(v)) for name, v in zip(FIGURES, figures(x), strict=True))
