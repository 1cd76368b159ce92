"""What the machine does: without integrators, set points creep to and fro until axes break away, alone, under loads and at
once."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from bench.procedure.rig import Rig
from bench.procedure.roles import Motion
from bench.recording.recorder import Recorder
from bench.rigfile.stage import StageAxis, axes_of
from procedures.axis_breakaway.plan import Plan
from procedures.axis_breakaway.sequence import (
    BACK,
    INTEGRATORS,
    ON,
    PULLS,
    WAYS,
    beside,
    chosen,
    helix,
    loads,
    mass,
    pair,
    place,
    ramp,
)
from procedures.stages.known_loads import put
from procedures.stages.spread import others

RAMP, HELIX = "ramp", "helix"


def motion(rig: Rig) -> Motion:
    """Of the machine; `requires` asks for it."""
    assert rig.motion is not None
    return rig.motion


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Each axis without a load, then under loads; then both at once."""
    with _restored(rig, plan):
        for axis in chosen(rig.file, plan):
            each = range(plan.repeats)
            for repeats in [each] if beside(rig.file, plan, axis) is None else [range(k, k + 1) for k in each]:
                _under_loads(rig, plan, record, axis, repeats)
        if (both := pair(rig.file, plan)) is not None:
            for repeat in range(plan.repeats):
                for share in plan.helix:
                    _helices(rig, plan, record, both, share, repeat)


def _under_loads(rig: Rig, plan: Plan, record: Recorder, axis: StageAxis, repeats: range) -> None:
    """Without a load and under each. An axis that is pulled has them anew in each repeat: a winding that holds a weight through
    all of them reaches its limit."""
    for source in (None, *loads(rig.file, axis)):
        if source is not None:
            put(rig, source, mass(axis, plan))
        for repeat in repeats:
            _ramps(rig, plan, record, axis, repeat, "" if source is None else source.name)
        if source is not None:
            put(rig, source, "")


@contextmanager
def _restored(rig: Rig, plan: Plan) -> Iterator[None]:
    """Without integrators, which would break an axis away by themselves; rates and they as they were in the end."""
    off = rig.file.capabilities.settings[INTEGRATORS]["off"]
    names = [*(axis.rate for axis in axes_of(rig.file).values() if axis.rate), *off]
    before = {name: motion(rig).get(name) for name in names}
    motion(rig).write(off)
    try:
        yield
    finally:
        motion(rig).write(before)


def _ramps(rig: Rig, plan: Plan, record: Recorder, axis: StageAxis, repeat: int, load: str) -> None:
    """Both ways, and for each pull of the axis beside it."""
    rate, span = ramp(axis, plan)
    at, pulled = place(axis, plan, repeat), beside(rig.file, plan, axis)
    for pull in (0,) if pulled is None else PULLS:
        for way in WAYS:  # by turns: three ramps against a weight in a row heat a winding towards its limit
            _slide(rig, plan, axis, repeat, way)
            if pulled is not None:
                motion(rig).write({pulled.rate: plan.ramp_rad_s})
                motion(rig).move({pulled.name: place(pulled, plan, repeat) + pull * plan.pull_rad})
            motion(rig).write({axis.rate: rate})
            rig.clock.sleep(plan.rest_s)
            with record.step(RAMP, axis=axis.name, repeat=repeat, load=load, way=way, turned=0, share=0.0, pull=pull):
                motion(rig).move({axis.name: at + way * (0.5 + ON) * span})


def _slide(rig: Rig, plan: Plan, axis: StageAxis, repeat: int, way: int) -> None:
    """At its usual rate, so that it sticks anywhere in a count, and last as it is to be pushed: what the map crosses under that
    force has moved the other axes, so that little is left in them. Then back by half of its friction's band, without a slip."""
    axes = (axis, *others(rig.file, axis))
    motion(rig).write({a.rate: rig.file.parameters[a.rate].default for a in axes if a.rate})
    for other in axes[1:]:
        motion(rig).move({other.name: place(other, plan, repeat)})
    at, span = place(axis, plan, repeat), ramp(axis, plan)[1]
    for end in (-0.5, 0.5, 0.5 - BACK):
        motion(rig).move({axis.name: at + way * end * span})


def _helices(
    rig: Rig, plan: Plan, record: Recorder, both: tuple[StageAxis, StageAxis], share: float, repeat: int
) -> None:
    """Along and around at once, slid one way and then pushed the other, both ways along and around."""
    path, at = helix(rig.file, plan, both, share), {a.name: place(a, plan, repeat) for a in both}
    usual = {a.rate: rig.file.parameters[a.rate].default for a in both}
    for turned in WAYS:
        for way in WAYS:
            sign = {both[0].name: way, both[1].name: way * turned}
            motion(rig).write(usual)
            motion(rig).move(at)
            motion(rig).write({a.rate: path.slide[a.name] for a in both})
            low = {name: at[name] - sign[name] * path.slid[name] for name in at}
            motion(rig).move(low)
            motion(rig).write({a.rate: path.ramp[a.name] for a in both})
            rig.clock.sleep(plan.rest_s)
            with record.step(
                HELIX, axis=both[0].name, repeat=repeat, load="", way=way, turned=turned * way, share=share
            ):
                motion(rig).move({name: low[name] + sign[name] * path.ramped[name] for name in at})
