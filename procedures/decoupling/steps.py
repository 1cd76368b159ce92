"""From recorded steps to arrays: both axes of a pair while one of them follows its sine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.recording import Recording, Step
from bench.rigfile.roles import STATE
from procedures.decoupling.plan import Plan
from procedures.stages.pairs import Pair, pairs

Array = npt.NDArray[np.float64]
ALONE, NUDGED = "alone", "nudged"
SLOW, FAST = 0.5, 1.5  # periods of the held axis' own sine to one of the motion
SPARE_S = 0.05  # of a step, beyond its periods


@dataclass(frozen=True)
class Axis:
    """Of one axis over a step (n,): its reading, its set point, what its loop asks for."""

    read: Array
    reference: Array
    asked: Array


@dataclass(frozen=True)
class Run:
    """A pair over one step; `turns`: periods of the held axis' own sine to one of the motion, 0 where it is left alone.
    `t` (n,) s, at which both were read, `stiffness` of the held axis' loop, `modes` of the controller, samples lost and
    expected."""

    pair: Pair
    turns: float
    t: Array
    moved: Axis
    held: Axis
    stiffness: float
    modes: tuple[str, ...]
    lost: int
    expected: int


def read_runs(recording: Recording[Plan]) -> list[Run]:
    """Every step of every pair that it tells of, in time order."""
    steps = [step for kind in (ALONE, NUDGED) for step in recording.steps(kind)]
    some = pairs(recording.rig, "all")
    return [_run(recording, step, pair) for step in steps for pair in some if _is_of(step, pair)]


def _is_of(step: Step, pair: Pair) -> bool:
    """While an axis is moved alone every other one is held."""
    return bool(step.labels["moved"] == pair.moved.name and step.labels.get("held", pair.held.name) == pair.held.name)


def _run(recording: Recording[Plan], step: Step, pair: Pair) -> Run:
    both = (pair.moved, pair.held)
    data = step.read(*dict.fromkeys((*(c for a in both for c in (a.channel, a.reference, a.asked)), STATE)))
    codes, rig = recording.rig.choices(STATE), recording.rig
    told = tuple(codes.get(int(code), str(int(code))) for code in np.unique(data[STATE]))
    moved, held = (Axis(*(np.asarray(data[c], np.float64) for c in (a.channel, a.reference, a.asked))) for a in both)
    return Run(
        pair=pair,
        turns=float(step.labels.get("turns", 0.0)),
        t=(data["t_ns"] - step.start_ns) * 1e-9,
        moved=moved,
        held=held,
        stiffness=float(step.labels[f"stiffness_{pair.held.name}"]),
        modes=tuple(rig.binding.mode(name) or name for name in told),
        lost=step.lost(),
        expected=step.expected(),
    )
