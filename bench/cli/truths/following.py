"""Truths of positioned stages that are sent to and fro or follow sines: the run is gone through again, row by row."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.cli.truths.settings import Found, settings_of

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated

COMMANDS = {"HOME": "home", "HOLD": "hold", "MOVE": "play", "STOP": "stop"}


class Rows:
    """Rows of the telemetry of a run, and what was commanded by the machine's ticks, from the row on in which it begins to look
    for its zeros. A row is read one tick before its time. Values go to the controller as 32-bit floats, and a count that is
    read a row later sends a mover that sticks and slips another way."""

    def __init__(self, recording: Any, tick_s: float) -> None:
        data, rig = recording.read(("state",), 0, 1 << 62), recording.rig
        t, names = data["t_ns"], rig.choices("state")
        homing = [rig.binding.mode(names.get(int(c), "")) == "HOMING" for c in data["state"]]
        self._tick, self._period = round(tick_s * 1e9), int(np.median(np.diff(t)))
        self._zero = int(t[int(np.argmax(homing))]) - self._tick
        told = [
            (e["t_ns"], COMMANDS[e["name"]], math.nan) for e in recording.events("command") if e["name"] in COMMANDS
        ]
        told += [(e["t_ns"], e["name"], float(np.float32(e["value"]))) for e in recording.events("parameter")]
        told.sort(key=lambda e: e[0])
        self.commands = [(max(-(-(at - self._zero) // self._tick), 0), name, value) for at, name, value in told]

    def of(self, t_ns: int) -> int:
        """The first row that is read at a time or after it."""
        return -(-(t_ns - self._zero) // self._period)

    def sent(self, parameter: str, t_ns: int) -> int:
        """The first row that knows a parameter's next value after a time."""
        a_row = self._period // self._tick
        begin = -(-(t_ns - self._zero) // self._tick)
        tick: int = next(tick for tick, name, _ in self.commands if name == parameter and tick >= begin)
        return -(-tick // a_row)


def steps(done: Simulated) -> Found:
    """Of the same machine that is sent the same way, of the steps that count."""
    from procedures.stages.tracks import where_of, without
    from procedures.step_following.steps import STEP, UP, modes_of, places
    from sim_backend.stage_motion import StageWindow, StepsFollowed

    recording, of = done.recording, done.drawn.machine.motions.following
    rig, plan = recording.rig, recording.plan
    if of is None:
        return
    rows, windows = Rows(recording, done.drawn.machine.tick_s), []
    known = {m.name: m for m in modes_of(rig, plan)}
    for step in recording.steps(STEP):
        mode, way = known[step.labels["mode"]], step.labels["way"]
        for a in mode.axes if step.labels["repeat"] >= 0 else ():
            low, high = places(a, plan)
            ends = (low, high) if way == UP else (high, low)
            where = where_of(mode, a, way, without(plan.integrators))
            windows.append(
                StageWindow(a.name, where, rows.sent(a.target, step.start_ns) - 1, rows.of(step.end_ns), ends)
            )
    asked = StepsFollowed(settings_of(done), rows.commands, windows, round(plan.rest_s * 1e3), plan.band)
    yield from ((name, where, value) for (name, where), value in of(rig, done.drawn, asked).items())


def sines(done: Simulated) -> Found:
    """Of the same machine that is sent the same way, of the periods that count."""
    from procedures.sine_following.steps import SINE, modes_of
    from procedures.stages.tracks import where_of, without
    from sim_backend.stage_motion import SinesFollowed, StageWindow

    recording, of = done.recording, done.drawn.machine.motions.following
    rig, plan = recording.rig, recording.plan
    if of is None:
        return
    rows, windows, n = Rows(recording, done.drawn.machine.tick_s), [], round(plan.period_s * 1e3)
    known = {m.name: m for m in modes_of(rig, plan)}
    for step in recording.steps(SINE):
        mode, begin = known[step.labels["mode"]], rows.of(step.start_ns)
        windows += [
            StageWindow(a.name, where_of(mode, a, without(plan.integrators)), begin, begin + n * plan.periods)
            for a in mode.axes
        ]
    asked = SinesFollowed(settings_of(done), rows.commands, windows, n)
    yield from ((name, where, value) for (name, where), value in of(rig, done.drawn, asked).items())
