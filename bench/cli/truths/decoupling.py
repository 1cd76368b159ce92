"""Truths of how axes of a stage are decoupled."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bench.cli.truths.settings import Found, settings_of

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated


def crossed(done: Simulated) -> Found:
    """Of each pair of axes, the same machine moved anew: its true motion, whatever the encoders make of it."""
    from procedures.decoupling.estimates import coupling_of, excursion_of, named, ratio_of
    from procedures.decoupling.procedure import OWN
    from procedures.stages.map_model import identified
    from procedures.stages.pairs import pairs
    from sim_backend.stage_motion import DecouplingAsked

    rig, plan, of = done.recording.rig, done.recording.plan, done.drawn.machine.motions.decoupling
    if of is None:
        return
    told = (
        identified(rig, plan.model, {c.procedure: c for c in done.recording.calibrations}) if plan.model != OWN else {}
    )
    for pair in pairs(rig, plan.moved):
        size = plan.amplitude_m if pair.moved.unit == "m" else plan.amplitude_rad
        asked = DecouplingAsked(settings_of(done, told, plan.parameters), pair.moved.name, pair.held.name, size, plan.period_s,
                                plan.periods, plan.sliding, plan.smooth_hz)  # fmt: skip
        if not (true := of(rig, done.drawn, asked)):
            continue
        rms, peak = named(pair)
        yield excursion_of(pair), pair.where, true["excursion"]
        yield ratio_of(pair), pair.where, true["excursion"] / true["swing"]
        yield rms, pair.where, true["cross"]
        yield peak, pair.where, true["peak"]
        yield coupling_of(pair), pair.where, true["slope"]
