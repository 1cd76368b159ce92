"""What the machine does: axes go to and fro at constant rates, alone, under loads, and both at once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from bench.procedure.rig import Rig
from bench.procedure.roles import Motion
from bench.recording.recorder import Recorder
from bench.rigfile.stage import StageAxis
from procedures.axis_friction.plan import Plan
from procedures.axis_friction.sequence import (
    TURNED,
    WAYS,
    chosen,
    crossed,
    ends,
    helix_settle,
    helix_turns,
    load_rate,
    loads,
    mass,
    rates,
    settle,
    start,
    written,
)
from procedures.stages.known_loads import put
from procedures.stages.spread import others

PASS, HELIX = "pass", "helix"
Labels = Mapping[str, float | str]


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Each axis at all rates, then under loads; then both at once."""
    with _restored(rig, plan):
        for axis in chosen(rig.file, plan):
            for repeat in range(plan.repeats):
                _stand(rig, plan, axis, repeat)
                for rate in rates(axis, plan):
                    _passes(rig, plan, record, axis, rate, repeat, "")
            for source in loads(rig.file, axis, plan):
                put(rig, source, mass(axis, plan))
                for repeat in range(plan.repeats):
                    _stand(rig, plan, axis, repeat)
                    _passes(rig, plan, record, axis, load_rate(axis, plan), repeat, source.name)
                put(rig, source, "")
        if (pair := crossed(rig.file, plan)) is not None:
            for repeat in range(plan.repeats):
                for rate in plan.helix_rad_s:
                    _helices(rig, plan, record, pair, rate, repeat)


def motion(rig: Rig) -> Motion:
    """Of the machine; `requires` asks for it."""
    assert rig.motion is not None
    return rig.motion


@contextmanager
def _restored(rig: Rig, plan: Plan) -> Iterator[None]:
    names = [name for axis in chosen(rig.file, plan) for name in (axis.rate, axis.rise) if name]
    before = {name: motion(rig).get(name) for name in names}
    yield
    motion(rig).write(before)


def _stand(rig: Rig, plan: Plan, axis: StageAxis, repeat: int) -> None:
    for other in others(rig.file, axis):
        motion(rig).move({other.name: start(other, plan, repeat)})


def _passes(rig: Rig, plan: Plan, record: Recorder, axis: StageAxis, rate: float, repeat: int, load: str) -> None:
    """There and back."""
    low, high = ends(axis, plan, rate, settle(axis, plan))
    motion(rig).write(written(axis, plan, max(rate, load_rate(axis, plan))))
    motion(rig).move({axis.name: low})
    motion(rig).write(written(axis, plan, rate))
    for way in WAYS:
        rig.clock.sleep(plan.rest_s)
        with record.step(PASS, axis=axis.name, rate=rate, repeat=repeat, load=load, way=way):
            motion(rig).move({axis.name: high if way > 0 else low})


def _helices(
    rig: Rig, plan: Plan, record: Recorder, pair: tuple[StageAxis, StageAxis], rate: float, repeat: int
) -> None:
    """There and back along, turning one way there and back again, then the other way."""
    along, around = pair
    low, high = ends(along, plan, plan.helix_m_s, helix_settle(pair, plan))
    begin, far = start(around, plan, repeat), helix_turns(pair, plan, rate)
    motion(rig).write(
        {**written(along, plan, plan.helix_m_s), **written(around, plan, max(rate, plan.load_rate_rad_s))}
    )
    motion(rig).move({along.name: low, around.name: begin})
    motion(rig).write(written(around, plan, rate))
    for turned in TURNED:
        for way in WAYS:
            rig.clock.sleep(plan.rest_s)
            to = {along.name: high if way > 0 else low, around.name: begin + turned * far * (way > 0)}
            with record.step(HELIX, axis=along.name, rate=rate, repeat=repeat, way=way, turned=turned * way):
                motion(rig).move(to)
