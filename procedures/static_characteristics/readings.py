"""From readings of both sides to loads: friction is off by their mean, a zero by what cells show without currents."""

from __future__ import annotations

import math

import numpy as np

from bench.rigfile import RigFile
from procedures.stages.stators import phases, poles
from procedures.static_characteristics.model import Array, Rows
from procedures.static_characteristics.requires import Cell
from procedures.static_characteristics.steps import Taken

TAKEN = 0.75  # of a reading's variance: mean of two sides, less that of four without currents


def less_zeros(t: Taken) -> Array:
    """(m, l, 2, 2): less what cells show without currents on that side, in proportion to the time from one to the other."""
    first, last = t.loads[:, :1], t.loads[:, -1:]
    begun, ended = t.times[:, :1, :, None], t.times[:, -1:, :, None]
    share = (t.times[..., None] - begun) / np.maximum(ended - begun, 1e-9)
    return np.asarray(t.loads - (first + share * (last - first)))


def held(t: Taken) -> tuple[Array, Array]:
    """Friction in the readings, N and N m (m, l): half of what both sides differ by."""
    half = (t.loads[:, :, 0] - t.loads[:, :, 1]) / 2
    return half[..., 0], half[..., 1]


def rows(t: Taken, rig: RigFile, both: tuple[Cell, Cell]) -> Rows:
    """Every load with a current."""
    some, count = phases(rig), t.loads.shape[1] - 2
    per = count // len(some)
    mean = less_zeros(t)[:, 1:-1].mean(axis=2)  # (m, l, 2)
    phase = np.repeat(np.arange(len(some)), per)
    carried = t.currents[:, 1:-1].mean(axis=2)[:, np.arange(count), phase]
    places = len(t.x)
    return Rows(
        phase=np.tile(phase, places), place=np.repeat(np.arange(places), count), current=carried.ravel(),
        force=mean[..., 0].ravel(), torque=mean[..., 1].ravel(), x=t.x, angle=t.angle,
        side=np.array([float(p.side) for p in some]), stator=np.array([p.stator for p in some]),
        aligned=np.array([p.aligned for p in some]), poles=poles(rig), reach=both[1].length,
        noise=(_noise(both[0]), _noise(both[1])),
    )  # fmt: skip


def _noise(cell: Cell) -> float:
    u = 0.0 if cell.by.noise is None else cell.by.noise.standard_uncertainty
    return max(math.sqrt(TAKEN * (u**2 + cell.by.resolution**2 / 12)) * cell.length / cell.by.gain.value, 1e-9)
