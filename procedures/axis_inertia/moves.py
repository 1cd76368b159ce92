"""What the machine does: each axis plays sines, with the bare shaft and with a known part on it."""

from __future__ import annotations

import math

from bench.procedure.rig import Rig
from bench.procedure.roles import Motion, RigState
from bench.procedure.states import transition
from bench.recording.recorder import Recorder
from bench.rigfile.stage import StageAxis
from procedures.axis_inertia.plan import Plan
from procedures.axis_inertia.sequence import BARE, Tone, order, tones
from procedures.stages.spread import middle, others, stands, turns

TONE = "tone"
SPARE_S = 0.05


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """All sines with the bare shaft, then with each part."""
    for name, axes in order(rig.file, plan):
        if name:
            _mount(rig, name)
        for axis in axes:
            for repeat in range(plan.repeats):
                _stand(rig, plan, axis, repeat)
                for tone in tones(axis, plan, name):
                    _play(rig, plan, record, axis, tone, {"repeat": repeat, "part": name})
        if name:
            _mount(rig, BARE)


def motion(rig: Rig) -> Motion:
    """Of the machine; `requires` asks for it."""
    assert rig.motion is not None
    return rig.motion


def _mount(rig: Rig, name: str) -> None:
    """Nobody works on a shaft that is held by currents."""
    transition(rig, RigState.READY)
    rig.operator.mount(name)
    transition(rig, RigState.HELD)


def _stand(rig: Rig, plan: Plan, axis: StageAxis, repeat: int) -> None:
    """The axis in the middle of its travel, one around somewhere else in every repeat, as the other axes are."""
    places = {a.name: stands(a, repeat, plan.repeats, plan.spread_m) for a in others(rig.file, axis)}
    own = stands(axis, repeat, plan.repeats, 0.0) if turns(axis) else middle(axis)
    motion(rig).move({axis.name: own, **places})


def recorded_s(plan: Plan, hz: float) -> float:
    """Whole periods, `record_s` or more."""
    return math.ceil(plan.record_s * hz - 1e-9) / hz


def _play(rig: Rig, plan: Plan, record: Recorder, axis: StageAxis, tone: Tone, labels: dict[str, float | str]) -> None:
    wave = axis.wave
    assert wave is not None
    assert wave.sine is not None
    sine = {wave.kind: float(wave.sine), wave.amplitude: tone.amplitude, wave.period: 1 / tone.hz}
    motion(rig).write({**sine, **({wave.phase: 0.0} if wave.phase else {})})
    motion(rig).play()
    rig.clock.sleep(plan.settle_s)
    with record.step(TONE, axis=axis.name, tone=tone.number, hz=tone.hz, amplitude=tone.amplitude, **labels):
        rig.clock.sleep(recorded_s(plan, tone.hz) + SPARE_S)
    motion(rig).stop()
    motion(rig).write({wave.kind: float(wave.off)})
