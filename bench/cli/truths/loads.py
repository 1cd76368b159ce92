"""Truths of how a positioned stage answers known loads."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bench.cli.truths.settings import Found, settings_of

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated
    from bench.rigfile import RigFile
    from bench.rigfile.stage import StageAxis
    from procedures.load_response.plan import Plan
    from sim_backend.loads_motion import LoadedAxis


def answers(done: Simulated) -> Found:
    """Of the plan's axes and loads, of the same machine taken through it anew."""
    from bench.rigfile.stage import axes_of
    from procedures.load_response.sequence import INTEGRATORS, chosen
    from sim_backend.loads_motion import LoadsAsked

    rig, plan, of = done.recording.rig, done.recording.plan, done.drawn.machine.motions.loads
    if of is None:
        return
    ways = rig.capabilities.settings[INTEGRATORS]
    times = (plan.cool_s, plan.settle_s, plan.average_s, plan.rest_s, plan.after_s, plan.look_s)
    asked = LoadsAsked(
        settings_of(done, ways["on"]), settings_of(done, ways["off"]), [_axis(rig, plan, a) for a in chosen(rig, plan)],
        [_axis(rig, plan, a) for a in axes_of(rig).values()], plan.static, plan.disturbed, plan.phases, *times,
    )  # fmt: skip
    for (name, where), value in of(rig, done.drawn, asked).items():
        yield name, where, value


def _axis(rig: RigFile, plan: Plan, axis: StageAxis) -> LoadedAxis:
    from procedures.load_response.sequence import Put, changes, count, lead, order, slow
    from sim_backend.loads_motion import LoadedAxis

    def told(load: Put) -> tuple[str, str, int]:
        return ("", "", 0) if load.source is None else (load.source.name, load.label, load.source.sign)

    return LoadedAxis(
        axis.name, axis.unit == "rad", count(axis), lead(axis, plan), slow(axis, plan), rig.parameters[axis.rate].default,
        rig.parameters[axis.rise].default, [told(x) for x in order(rig, axis, plan)],
        [told(x) for x in changes(rig, axis, plan)],
    )  # fmt: skip
