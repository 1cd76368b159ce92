"""Truths of positioned stages that are sent to and fro or follow sines: the run is gone through again, row by row."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.cli.truths.settings import Found, settings_of

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated

COMMANDS = {"HOME": "home", "HOLD": "hold", "MOVE": "play", "STOP": "stop"}
SEEN = {"HOME": "HOMING", "HOLD": "HOLDING", "MOVE": "MOVING"}
"""State of the first row after a command."""


class Rows:
    """Rows of the telemetry of a run: a command or parameter is seen in the first row after it came."""

    def __init__(self, recording: Any) -> None:
        data = recording.read(("state",), 0, 1 << 62)
        rig = recording.rig
        self._t, names = data["t_ns"], rig.choices("state")
        self._modes = np.array([rig.binding.mode(names.get(int(c), "")) for c in data["state"]])
        self._period = int(np.median(np.diff(self._t)))
        told = [(e["t_ns"], e["name"], math.nan) for e in recording.events("command") if e["name"] in COMMANDS]
        told += [(e["t_ns"], e["name"], float(e["value"])) for e in recording.events("parameter")]
        told.sort(key=lambda e: e[0])
        home = next(self.of(t, name) for t, name, _ in told if name == "HOME")
        self.zero = home
        self.commands = [
            (self.of(t, name) - home, COMMANDS.get(name, name), value) for t, name, value in told
            if self.of(t, name) >= home
        ]  # fmt: skip

    def of(self, t_ns: int, name: str = "") -> int:
        """The first row after a time, or after a command came."""
        row = math.ceil((t_ns - int(self._t[0])) / self._period)
        if name not in SEEN:
            return row
        return row + int(np.flatnonzero(self._modes[row:] == SEEN[name])[0])

    def after(self, t_ns: int) -> int:
        """As `of`, from the search of the zeros on."""
        return self.of(t_ns) - self.zero


def steps(done: Simulated) -> Found:
    """Of the same machine, sent as the plan says for longer."""
    from procedures.stages.tracks import chosen, where_of, without
    from procedures.step_following.steps import STEP, WAYS, modes_of, places
    from sim_backend.motion import StageMode, StepsFollowed

    recording, of = done.recording, done.drawn.machine.motions.following
    rig, plan = recording.rig, recording.plan
    if of is None:
        return
    rows, modes = Rows(recording), []
    for m in modes_of(rig, plan):
        last = [s for s in recording.steps(STEP) if s.labels["mode"] == m.name][-1]
        begin, end = rows.after(last.start_ns), rows.after(last.end_ns)
        sent = {a.name: next(r for r, name, _ in rows.commands if name == a.target and r >= begin) for a in m.axes}
        wheres = {a.name: [where_of(m, a, way, without(plan.integrators)) for way in reversed(WAYS)] for a in m.axes}
        stagger = {name: r - min(sent.values()) for name, r in sent.items()}
        modes.append(StageMode([a.name for a in m.axes], wheres, end, stagger))
        dwell = end - min(sent.values())
    between = {a.name: places(a, plan) for a in chosen(rig, plan.moved)}
    asked = StepsFollowed(
        settings_of(done),
        rows.commands,
        modes,
        between,
        round(plan.before_s * 1e3),
        dwell,
        round(plan.rest_s * 1e3),
        plan.band,
    )
    yield from ((name, where, value) for (name, where), value in of(rig, done.drawn, asked).items())


def sines(done: Simulated) -> Found:
    """Of the same machine, following as the plan says for longer."""
    from procedures.sine_following.steps import SINE, modes_of
    from procedures.stages.tracks import where_of, without
    from sim_backend.motion import SinesFollowed, StageMode

    recording, of = done.recording, done.drawn.machine.motions.following
    rig, plan = recording.rig, recording.plan
    if of is None:
        return
    rows, modes = Rows(recording), []
    for m in modes_of(rig, plan):
        step = next(s for s in recording.steps(SINE) if s.labels["mode"] == m.name)
        wheres = {a.name: [where_of(m, a, without(plan.integrators))] for a in m.axes}
        modes.append(StageMode([a.name for a in m.axes], wheres, rows.after(step.end_ns), {}))
    asked = SinesFollowed(settings_of(done), rows.commands, modes, round(plan.period_s * 1e3))
    yield from ((name, where, value) for (name, where), value in of(rig, done.drawn, asked).items())
