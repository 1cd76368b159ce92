"""What the machine does: without integrators, set points creep to and fro until axes break away, alone, under loads and at
once."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from bench.procedure.rig import Rig
from bench.procedure.roles import Motion
from bench.recording.recorder import Recorder
from bench.rigfile.stage import StageAxis
from procedures.axis_breakaway.plan import Plan
from procedures.axis_breakaway.sequence import (
    INTEGRATORS,
    WAYS,
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
            for source in (None, *loads(rig.file, axis)):
                if source is not None:
                    put(rig, source, mass(axis, plan))
                for repeat in range(plan.repeats):
                    _ramps(rig, plan, record, axis, repeat, "" if source is None else source.name)
                if source is not None:
                    put(rig, source, "")
        if (both := pair(rig.file, plan)) is not None:
            for repeat in range(plan.repeats):
                for share in plan.helix:
                    _helices(rig, plan, record, both, share, repeat)


@contextmanager
def _restored(rig: Rig, plan: Plan) -> Iterator[None]:
    """Without integrators, which would break an axis away by themselves; rates and they as they were in the end."""
    off = rig.file.capabilities.settings[INTEGRATORS]["off"]
    names = [*(axis.rate for axis in chosen(rig.file, plan)), *off]
    before = {name: motion(rig).get(name) for name in names}
    motion(rig).write(off)
    try:
        yield
    finally:
        motion(rig).write(before)


def _ramps(rig: Rig, plan: Plan, record: Recorder, axis: StageAxis, repeat: int, load: str) -> None:
    """From above to the low end, so that it sticks; then to the high end and back."""
    for other in others(rig.file, axis):
        motion(rig).move({other.name: place(other, plan, repeat)})
    rate, span = ramp(axis, plan)
    at, usual = place(axis, plan, repeat), rig.file.parameters[axis.rate].default
    motion(rig).write({axis.rate: usual})
    for end in (at + span / 2, at - span / 2):
        motion(rig).move({axis.name: end})
    motion(rig).write({axis.rate: rate})
    for way in WAYS:
        rig.clock.sleep(plan.rest_s)
        with record.step(RAMP, axis=axis.name, repeat=repeat, load=load, way=way, turned=0, share=0.0):
            motion(rig).move({axis.name: at + way * span / 2})


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
