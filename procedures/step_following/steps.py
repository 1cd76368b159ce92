"""Labels of what is recorded, and from a recording to moves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from bench.recording import Recording
from bench.rigfile import RigFile
from bench.rigfile.stage import StageAxis
from procedures.stages.tracks import Mode, Track, modes, tracks_of
from procedures.step_following.plan import Plan

STEP = "step"
UP, DOWN = "up", "down"
WAYS = (UP, DOWN)


@dataclass(frozen=True)
class Move:
    """One axis' part of one step: its mode, its way and which repeat, negative ones before those that count."""

    mode: Mode
    way: str
    repeat: int
    track: Track


def places(axis: StageAxis, plan: Plan) -> tuple[float, float]:
    """Between which an axis goes, m or rad."""
    return plan.places_m if axis.unit == "m" else plan.angles_rad


def targets(mode: Mode, plan: Plan, way: str) -> Mapping[str, float]:
    """Where the axes of a mode are sent, by name."""
    return {a.name: places(a, plan)[way == UP] for a in mode.axes}


def step_of(axis: StageAxis, plan: Plan, way: str) -> float:
    """By how much the set point goes, m or rad."""
    low, high = places(axis, plan)
    return high - low if way == UP else low - high


def modes_of(rig: RigFile, plan: Plan) -> tuple[Mode, ...]:
    """What is done, in order."""
    return modes(rig, plan.moved, together=plan.together)


def read(recording: Recording[Plan]) -> list[Move]:
    """Every move of every axis, in time order."""
    known = {m.name: m for m in modes_of(recording.rig, recording.plan)}
    out = []
    for step in recording.steps(STEP):
        mode = known[str(step.labels["mode"])]
        found = tracks_of(recording, step, mode.axes)
        out += [Move(mode, str(step.labels["way"]), int(step.labels["repeat"]), track) for track in found.values()]
    return out
