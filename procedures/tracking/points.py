"""A reference of set points, written one after the other where the controller has no path of its own.

Each of `points` to a revolution is held until the next is written: the reference is a staircase, whose steps are known by when
they were written. What is compared with it at its frequency is its own first harmonic, not the ellipse's. How far the shaft is
off the ellipse itself, wherever along it (the contour error), needs no time at all.

A write acts somewhat later than it is recorded. How much later is read from the coil currents: the answers to all steps,
each over its size, lie on one curve, whose begin is that delay.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording import Step
from procedures.amb_rotor.machine import AmbRotor
from procedures.amb_rotor.onset import onset

Array = npt.NDArray[np.float64]
POINT, ORBIT_LOST = "reference-point", "orbit-lost"
FINE = 2000  # points of the ellipse that are looked at
LARGE = 0.5  # of the greatest step: those whose answers are looked at
RESTS = 4  # samples before a step that it is counted from
REACH_S = 6e-3  # after a step


@dataclass(frozen=True)
class Points:
    """When the set points were written, `t` (n,) s on the path's time, and where to: `y`, `z` (n,) m."""

    t: Array
    y: Array
    z: Array

    def harmonic(self, begin: float, end: float, hz: float, late: float) -> npt.NDArray[np.complex128]:
        """Of y and z, twice the mean of x exp(-i w t) over a whole period from `begin` to `end` s, all of them `late` s later
        than they were written."""
        at = np.clip(np.concatenate([self.t + late, [math.inf]]), begin, end)
        turn = -2j * math.pi * hz
        parts = (np.exp(turn * at[1:]) - np.exp(turn * at[:-1])) / turn
        return np.asarray(np.array([x @ parts for x in (self.y, self.z)], np.complex128) * 2 / (end - begin))


def read_points(step: Step, origin: int) -> Points | None:
    """The set points of an orbit; None where there are none."""
    found = [e for e in step.recording.events(POINT) if step.start_ns <= e["t_ns"] < step.end_ns]
    if not found:
        return None
    t, y, z = np.array([((e["t_ns"] - origin) * 1e-9, e["y"], e["z"]) for e in found]).T
    return Points(t, y, z)


def written_apart(step: Step, names: Collection[str]) -> float:
    """From the first to the last write of the set points `names` of one point of an orbit, s, at its longest."""
    writes = [
        e for e in step.recording.events("parameter") if e["name"] in names and step.start_ns <= e["t_ns"] < step.end_ns
    ]
    at = np.array([e["t_ns"] for e in writes], dtype=np.int64)
    begins = np.array([e["t_ns"] for e in step.recording.events(POINT)], dtype=np.int64)
    of = np.searchsorted(begins, at, side="right")
    spans = [float(np.ptp(at[of == k])) * 1e-9 for k in np.unique(of[of > 0])]
    return max(spans, default=0.0)


def delay(
    points: Points, t: Array, upper: Array, lower: Array, machine: AmbRotor, tick: float, ticks: int, period_s: float
) -> tuple[float, float]:
    """By how much later than it is recorded a write acts, s, and the answer's jump over its noise; from the currents of both
    sides (4, n) A at `t` (n,) s.

    Raises:
        AnalysisError: no step has samples to tell.
    """
    control, period = (upper - lower) / 2, float(np.median(np.diff(t)))
    moves = np.diff(np.array([points.y, points.z]), axis=1)
    to_axes = machine.stations.pulls[:, :2] @ moves
    size = np.sqrt((to_axes**2).sum(axis=0))
    at, answers = [], []
    for k in np.flatnonzero(size > LARGE * size.max()):
        written = points.t[k + 1]
        near = (t > written - RESTS * period) & (t < written + REACH_S)
        seen = to_axes[:, k] @ control[:, near] / size[k] ** 2
        rest = t[near] <= written
        if rest.sum() < 2:
            continue
        at.append(t[near] - written)
        answers.append(seen - seen[rest].mean())
    if not at:
        raise AnalysisError("found no samples about the steps of the reference; expected some about each")
    when, what = np.concatenate(at), np.concatenate(answers)
    return onset(
        when, what, 0.0, 2 * period, tick=tick, ticks=ticks, lag_s=machine.lag_s, period_s=period_s, answers=len(at)
    )


def contour(y: Array, z: Array, half_y: float, half_z: float) -> Array:
    """How far outside an ellipse the points are, (n,) m, below zero inside it."""
    turn = np.linspace(0, 2 * math.pi, FINE, endpoint=False)
    on = np.array([half_y * np.sin(turn), half_z * np.cos(turn)])
    normal = np.array([half_z * np.sin(turn), half_y * np.cos(turn)])
    normal = normal / np.hypot(*normal)
    found = np.empty_like(y)
    for k, (a, b) in enumerate(zip(y, z, strict=True)):
        away = np.array([a - on[0], b - on[1]])
        j = int(np.argmin((away**2).sum(axis=0)))
        found[k] = away[:, j] @ normal[:, j]
    return found
