"""Labels of what is recorded, and from a recording to arrays by axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.recording import Recording, Step
from bench.rigfile.roles import STATE
from procedures.positioning.plan import Plan
from procedures.positioning.targets import UP
from procedures.positioning.way import Tested, tested

Array = npt.NDArray[np.float64]
REST, READING = "rest", "reading"
READ = "reference-read"


@dataclass(frozen=True)
class Taken:
    """Of an axis, all (2, m, n), ways up and down, targets, approaches; NaN where there is none. `read`: what the instrument
    shows, by its own sign and gain; `counted`: what the axis' encoder reads meanwhile, `before`: and at rest before that;
    `moved`: from its least to its greatest reading at rest; `times` s. `warm`: mean temperatures of what carries the axis."""

    tested: Tested
    read: Array
    counted: Array
    before: Array
    moved: Array
    times: Array
    warm: Array
    states: tuple[str, ...]
    lost: int
    expected: int


def read_taken(recording: Recording[Plan]) -> list[Taken]:
    """Every axis that was to be tested."""
    shown = {e["number"]: float(e["value"]) for e in recording.events(READ)}
    by = {kind: _by_axis(recording, kind) for kind in (REST, READING)}
    return [
        _taken(recording, one, by[REST].get(one.axis.name, []), by[READING].get(one.axis.name, []), shown)
        for one in tested(recording.rig, recording.plan)
    ]


def _by_axis(recording: Recording[Plan], kind: str) -> dict[str, list[Step]]:
    return {str(name): steps for name, steps in recording.steps(kind).by("axis")}


def _at(step: Step) -> tuple[int, int, int]:
    labels = step.labels
    return (0 if int(labels["way"]) == UP else 1), int(labels["target"]), int(labels["repeat"])


def _taken(
    recording: Recording[Plan], one: Tested, rests: Sequence[Step], readings: Sequence[Step], shown: Mapping[int, float]
) -> Taken:
    shape = (2, len(one.at), recording.plan.repeats)
    read, counted, before, moved, times, warm = (np.full(shape, np.nan) for _ in range(6))
    channel = one.axis.channel
    for step in rests:
        x = step.read(channel)[channel]
        if len(x):
            before[_at(step)], moved[_at(step)] = x.mean(), np.ptp(x)
    names: set[str] = set()
    for step in readings:
        at = _at(step)
        told = step.read(channel, STATE)
        if len(told[channel]):
            counted[at], times[at] = told[channel].mean(), 1e-9 * (step.start_ns - recording.start_ns)
        names |= set(_states(recording, told[STATE]))
        value = step.mean(one.by.channel) if one.by.channel else shown.get(int(step.labels["number"]), np.nan)
        read[at] = one.by.sign * value / one.by.gain.value
        if one.by.temperature:
            warm[at] = step.mean(one.by.temperature)
    lost, expected = (sum(f(step) for step in (*rests, *readings)) for f in (Step.lost, Step.expected))
    return Taken(one, read, counted, before, moved, times, warm, tuple(sorted(names)), lost, expected)


def _states(recording: Recording[Plan], codes: Array) -> list[str]:
    names = recording.rig.choices(STATE)
    return [names.get(int(code), str(int(code))) for code in np.unique(codes)]
