"""What the machine does: axes are moved past and back under each load, and loads put on and taken off while they are held."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from bench.procedure.rig import Rig
from bench.procedure.roles import Motion
from bench.recording.recorder import Recorder
from bench.rigfile.stage import StageAxis, axes_of
from procedures.load_response.plan import Plan
from procedures.load_response.sequence import INTEGRATORS, Put, changes, lead, order, set_point, slow
from procedures.stages.known_loads import put

APPROACH, DISTURBED = "approach", "disturbed"
SPARE_S = 0.05
GOLDEN = 0.6180339887


def motion(rig: Rig) -> Motion:
    """Of the machine; `requires` asks for it."""
    assert rig.motion is not None
    return rig.motion


def integrators(rig: Rig, way: str) -> None:
    """On or off. What an integrator has gathered stays in the loop until the axes are let go."""
    motion(rig).let_go()
    motion(rig).write(rig.file.capabilities.settings[INTEGRATORS][way])
    motion(rig).hold()


def approaches(rig: Rig, plan: Plan, record: Recorder, axis: StageAxis) -> None:
    """At every set point of one count every load, from both sides: so that no winding carries for long. The other axes come
    anew to where they stand each time, half of the times from one side and half from the other: their counts and their friction
    are then in the scatter."""
    others = [a for a in axes_of(rig.file).values() if a.name != axis.name]
    on = Put(None, "")
    for phase in range(plan.phases):
        for load in order(rig.file, axis, plan):
            _change(rig, on, load)
            on = load
            for other in others:
                _stand(rig, plan, other, phase)
            for side in (1, -1):
                _approach(rig, plan, record, axis, load, phase, side)
        rig.clock.sleep(plan.cool_s)
    motion(rig).move({axis.name: 0.0})


def _change(rig: Rig, before: Put, after: Put) -> None:
    if before.source is not None and before.source != after.source:
        put(rig, before.source, "")
    if after.source is not None:
        put(rig, after.source, after.label)


def _stand(rig: Rig, plan: Plan, axis: StageAxis, phase: int) -> None:
    at, side = set_point(axis, plan, phase), 1 if 2 * phase < plan.phases else -1
    motion(rig).move({axis.name: at + side * lead(axis, plan) / 2})
    motion(rig).move({axis.name: at})
    rig.clock.sleep(plan.settle_s)


def _approach(rig: Rig, plan: Plan, record: Recorder, axis: StageAxis, load: Put, phase: int, side: int) -> None:
    """Past by the lead, and slowly back: friction holds the axis where it comes to rest."""
    at = set_point(axis, plan, phase)
    motion(rig).move({axis.name: at - side * lead(axis, plan)})
    rig.clock.sleep(plan.settle_s)
    with _slowly(rig, axis, slow(axis, plan)), record.step(APPROACH, **_labels(rig, axis, load, phase, at), side=side):
        motion(rig).move({axis.name: at})
        rig.clock.sleep(plan.settle_s + plan.average_s)


@contextmanager
def _slowly(rig: Rig, axis: StageAxis, rate: float) -> Iterator[None]:
    before = motion(rig).get(axis.rate)
    motion(rig).write({axis.rate: rate})
    yield
    motion(rig).write({axis.rate: before})


def rests(number: int) -> float:
    """Of a disturbance by its number, between 1 and 1.5, spread evenly however many there are."""
    return 1 + 0.5 * (number * GOLDEN % 1.0)


def _labels(rig: Rig, axis: StageAxis, load: Put, phase: int, at: float) -> dict[str, float | str]:
    source = load.source
    return {
        "axis": axis.name, "source": "" if source is None else source.name, "load": load.label, "phase": phase, "at": at,
        "stiffness": motion(rig).get(axis.stiffness), "limit": motion(rig).get(axis.limit) if axis.limit else 0.0,
    }  # fmt: skip


def disturbances(rig: Rig, plan: Plan, record: Recorder, axis: StageAxis) -> None:
    """The greatest load each way is put on and taken off, at every set point of one count. Integrators hunt within friction:
    rests of different length meet them at different places."""
    others = [a for a in axes_of(rig.file).values() if a.name != axis.name]
    for phase in range(plan.phases):
        at, side = set_point(axis, plan, phase), 1 if phase % 2 else -1
        for other in others:
            _stand(rig, plan, other, phase)
        for load in changes(rig.file, axis, plan):
            motion(rig).move({axis.name: at + side * lead(axis, plan)})
            motion(rig).move({axis.name: at})
            rig.clock.sleep(plan.rest_s * rests(phase))
            for on in (1, 0):
                with record.step(DISTURBED, **_labels(rig, axis, load, phase, at), on=on):
                    rig.clock.sleep(plan.before_s)
                    _change(rig, Put(None, "") if on else load, load if on else Put(None, ""))
                    rig.clock.sleep(plan.after_s + plan.look_s + SPARE_S)
    motion(rig).move({axis.name: 0.0})
