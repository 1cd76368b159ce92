"""Truths of what turns with a levitated shaft."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bench.cli.truths.settings import Found

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated


def runout(done: Simulated) -> Found:
    from procedures.runout_map.estimates import PARTS

    plan: Any = done.recording.plan
    of = done.drawn.machine.motions.runout
    if of is None:
        return
    for (name, plane, place), vector in of(done.recording.rig, done.drawn, plan.places_m).items():
        for part, value in zip(PARTS, (vector.real, vector.imag), strict=True):
            yield name, f"{plane}, {place * 1e3:.4g} mm, {part}", value
