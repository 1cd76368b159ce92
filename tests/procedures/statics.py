"""Readings of load cells that hold the rotary-linear motor's shaft, made by the readable reference: what
`static-characteristics` would have recorded."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from bench.rigfile import RigFile
from procedures.stages.stators import phases
from procedures.static_characteristics.places import grid, loads
from procedures.static_characteristics.plan import Plan
from procedures.static_characteristics.steps import Taken
from sim_backend.machines.rlsrm.params import PlantParams
from sim_backend.machines.rlsrm.reference import pulls

SHORT = Plan(positions_m=(-13e-3, -6e-3, 6e-3, 13e-3), angles_per_position=2)


@dataclass(frozen=True)
class Cells:
    """What both cells are: gains, arm and sizes of what they read of each other, as true numbers over stated ones; how far
    they yield; zeros and drift N, N/s; friction along and around."""

    gain: tuple[float, float] = (1.0, 1.0)
    arm: float = 1.0
    cross: tuple[float, float] = (0.0, 0.0)
    give: tuple[float, float] = (2e-6, 2.5e-3)
    zero: tuple[float, float] = (0.3, -0.2)
    drift: float = 0.0
    rubs: tuple[float, float] = (0.1, 0.01)
    noise: tuple[float, float] = (0.003, 0.002)


def taken(rig: RigFile, p: PlantParams, of: Cells | None = None, plan: Plan = SHORT, seed: int = 0) -> Taken:
    """At every place of a plan; currents' readings have the machine's gains, the loops their true currents."""
    rng, of, some, places = np.random.default_rng(seed), of or Cells(), phases(rig), grid(plan)
    r = rig.geometry["torque_arm"].value
    each = [*loads(plan, some)]
    shape = (len(places), len(each), 2)
    found, times, currents = np.zeros((*shape, 2)), np.zeros(shape), np.zeros((*shape, len(some)))
    numbers = {phase.name: k for k, phase in enumerate(some)}
    for m, place in enumerate(places):
        for j, load in enumerate(each):
            k = numbers.get(load.phase, 0)
            true = (load.level - p.current_offset[k]) / p.current_gain[k] if load.phase else 0.0
            force, torque = settled(p, of.give, k, (place.x, place.angle), true)
            for side, way in enumerate((1, -1)):
                t = 1.4 * (m * len(each) * 2 + 2 * j + side)
                pressed = np.array([force + way * of.rubs[0], (torque + way * of.rubs[1]) / (of.arm * r)])
                read = np.array(of.gain) * pressed + np.array(of.cross) * pressed[::-1] + of.zero + of.drift * t
                read += rng.standard_normal(2) * of.noise
                found[m, j, side], times[m, j, side] = np.round(read, 3) * (1.0, r), t
                if load.phase:
                    currents[m, j, side, k] = load.level
    pitch, x = p.pitch[1], np.array([q.x for q in places])
    angle = np.array([round(q.angle / pitch + p.edge[1]) * pitch for q in places])
    return Taken(places, some, found, times, currents, x, angle, (0.0, 0.0), ("READY",), 0, 1000)


@cache
def settled(
    p: PlantParams, give: tuple[float, float], k: int, at: tuple[float, float], current: float
) -> tuple[float, float]:
    """Force and torque of a phase where cells have yielded to them."""
    force = torque = 0.0
    for _ in range(4 if current else 0):
        force, torque = pulls(p.map, k, at[0] + give[0] * force, at[1] + give[1] * torque, current)
    return force, torque


def exchanged(t: Taken, one: int, other: int, per: int) -> Taken:
    """With what two phases press exchanged."""
    order = np.arange(t.loads.shape[1])
    a, b = 1 + one * per + np.arange(per), 1 + other * per + np.arange(per)
    order[a], order[b] = b, a
    return replace(t, loads=t.loads[:, order])


DEG = math.pi / 180
