"""Steps of a controller whose telemetry is too slow for them: recorded in its own memory, at its full rate, and read as a
faster
telemetry would have them.

What follows works on means over a period, as telemetry sends them. So a capture's single readings are averaged over as many
ticks
as fit into half a millisecond: a rise of 1.5 ms then has more samples than the AMB stand's telemetry of 1 kHz gives of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.procedure.rig import Rig
from bench.recording import Step
from bench.recording.captured import Captured
from bench.rigfile import RigFile
from bench.rigfile.capture import Layout
from bench.rigfile.roles import STATUS
from procedures.amb_rotor.machine import AmbRotor
from procedures.step.turning import with_angle

Array = npt.NDArray[np.float64]
Samples = dict[str, npt.NDArray[Any]]
SLOW_S = 1.5e-3  # of telemetry: what stands farther apart shows no rise of a stiff loop
MEAN_S = 5e-4  # what a capture's readings are averaged over
OF_STEP = "step"  # label of a capture: which step of the recording it is of, counted from 0
SPARE_S = 0.05  # that a capture ends before its step


def channels(machine: AmbRotor) -> tuple[str, ...]:
    """What is captured of a step."""
    positions = dict.fromkeys((*machine.all_positions, *machine.stations.channels))
    return (*positions, *machine.all_currents)


def captures(rig: RigFile, machine: AmbRotor) -> bool:
    """Whether a rig's steps are captured: its telemetry is slow, and its controller records all that a step needs."""
    first = rig.messages.messages.get(rig.binding.telemetry[0])
    if rig.capture is None or first is None:
        return False
    return first.period_s > SLOW_S and set(channels(machine)) <= set(rig.capture.channels)


def arm(rig: Rig, machine: AmbRotor, seconds: float) -> None:
    """From now on for that long, less what a step is longer; at the highest rate that the memory holds."""
    spec = rig.file.capture
    assert rig.capture is not None
    assert spec is not None
    names, lasts = channels(machine), seconds - SPARE_S
    room = rig.capture.memory_bytes // Layout.of(spec, names).sample.itemsize
    divider = math.ceil(lasts * rig.capture.rate_hz / room)
    rig.capture.arm(names, seconds=lasts, rate_hz=rig.capture.rate_hz / divider)


def fetch(rig: Rig, number: int) -> None:
    """What was recorded of the step of that number, into the recording."""
    assert rig.capture is not None
    rig.capture.wait(5.0)
    rig.capture.upload(None, **{OF_STEP: number})


def read(step: Step, names: Sequence[str]) -> Samples:
    """Samples of a step by channel or role, with `t_ns` and `index`: of its telemetry, or, where it was captured, of that. What
    was not captured is as the telemetry has it: the status of the whole step, else interpolated."""
    told, found = with_angle(step.recording.rig, step.read(*names)), _captured(step)
    if found is None:
        return told
    tick_s = step.recording.rig.devices["controller"].tick_s
    fast = averaged(found, [n for n in names if n in found.channels], tick_s)
    t = (fast["t_ns"] - fast["t_ns"][0]) * 1e-9
    slow = (told["t_ns"] - fast["t_ns"][0]) * 1e-9
    for name in told:
        if name == STATUS:
            word = np.bitwise_or.reduce(told[name].astype(np.int64)) if len(slow) else 0
            fast[name] = np.full(len(t), word)
        elif name not in fast:
            fast[name] = np.interp(t, slow, told[name])
    return fast


def read_control(step: Step, pairs: Sequence[tuple[str, str]]) -> tuple[npt.NDArray[np.int64], Array] | None:
    """Single readings of a captured step: their times, ns, and the sum of the differences of `pairs` of coils, A (n,)."""
    found = _captured(step)
    if found is None:
        return None
    data = found.arrays(*(name for pair in pairs for name in pair))
    return data["t_ns"], np.asarray(sum(data[p] - data[n] for p, n in pairs), np.float64)


def _captured(step: Step) -> Captured | None:
    events = (e for e in step.recording.events("capture") if OF_STEP in e["labels"])
    mine = next((e for e in events if step.start_ns <= e["start_ns"] < step.end_ns), None)
    return None if mine is None else Captured.of(step.recording, mine)


def averaged(capture: Captured, names: Sequence[str], tick_s: float) -> Samples:
    """Means over `MEAN_S` of a capture's readings, each at the tick after the last of them, as telemetry has it; with
    `index`."""
    data = capture.arrays(*names)
    count = max(round(MEAN_S * capture.rate_hz), 1)
    blocks = len(data["t_ns"]) // count
    used = slice(0, blocks * count)
    out: Samples = {name: data[name][used].reshape(blocks, count).mean(axis=1) for name in names}
    out["t_ns"] = data["t_ns"][used].reshape(blocks, count)[:, -1] + round(tick_s * 1e9)
    out["index"] = np.arange(blocks)
    return out
