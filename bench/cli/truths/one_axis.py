"""Truths of procedures of a machine of one magnetic axis."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bench.cli.truths.settings import Found, settings_of

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated


def derivative(done: Simulated) -> Found:
    from sim_backend.motion import BandAsked

    plan: Any = done.recording.plan
    band = done.drawn.machine.motions.band
    if band is None:
        return
    asked = BandAsked(settings_of(done), plan.lines_hz, plan.limit, plan.at_hz)
    for (name, hz), value in band(done.recording.rig, done.drawn, asked).items():
        yield name, "" if hz is None else f"{hz:g} Hz", value


def compare(done: Simulated) -> Found:
    from procedures.one_axis.conventions import conventions
    from sim_backend.motion import CompareAsked

    plan: Any = done.recording.plan
    compare, machine = done.drawn.machine.motions.compare, conventions(done.recording.rig)
    if compare is None:
        return
    engaged, loaded = ({e: machine.choose("estimator", e) for e in names} for names in (plan.engaged, plan.loaded))
    asked = CompareAsked(settings_of(done), engaged, loaded, plan.load, plan.lead_s, plan.calm_s)
    for (name, where), value in compare(done.recording.rig, done.drawn, asked).items():
        yield name, where, value
