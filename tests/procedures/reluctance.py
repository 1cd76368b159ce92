"""Pulses at a locked rotor, straight from the rotary-linear motor's plant: what `inductance-map` would have captured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bench.rigfile import RigFile
from procedures.inductance_map.places import grid
from procedures.inductance_map.plan import Plan
from procedures.inductance_map.steps import Shot, Taken, with_pulses
from procedures.stages.stators import phases
from sim_backend.core.plant import Array
from sim_backend.machines.rlsrm.params import PlantParams
from sim_backend.machines.rlsrm.plant import TICKS_S, TRACE, Plant

AT = {name: k for k, name in enumerate(TRACE)}
SHORT = Plan(positions_m=(-13e-3, -9e-3, -4e-3, 4e-3, 9e-3, 13e-3), angles_per_position=3)
LEAD = 40  # ticks


def pulse(plant: Plant, k: int, amperes: float = 6.0) -> tuple[Array, Array, Array]:
    """Voltage and current of winding `k`, and all true currents, over one pulse of 20 ms."""
    reference = np.zeros(6)
    rest = plant.run(LEAD / TICKS_S, 1)
    reference[k] = amperes
    plant.drive(reference)
    up = plant.run(20e-3, 1)
    plant.drive(np.zeros(6))
    rows = np.concatenate([rest, up, plant.run(8e-3, 1)])
    return rows[:, AT["u_A1"] + k], rows[:, AT["i_A1"] + k], rows[:, AT["i_A1"] : AT["i_A1"] + 6]


def taken(rig: RigFile, params: PlantParams, plan: Plan = SHORT, gains: Sequence[float] = (1.0,) * 6, offset: float = 0.0,
          noise: tuple[float, float] = (2e-3, 0.05), seed: int = 0) -> list[Taken]:  # fmt: skip
    """At every place of a plan; `gains` and `offset` of currents' readings, noise of a current and of a voltage."""
    rng, out, some = np.random.default_rng(seed), [], phases(rig)
    for place in grid(plan):
        plant = Plant(replace(params, locked=(1.0, 1.0)))  # anew: a lock stays where it was shut
        plant.put(place.x, place.angle)
        plant.switch(on=True)
        read = plant.run(2e-3)[-1]
        shots = {}
        for k, phase in enumerate(some):
            u, i, others = pulse(plant, k)
            other = float(np.abs(np.delete(others[200:400], k, axis=1).mean(axis=0)).max())
            u, i = (
                u + noise[1] * rng.standard_normal(u.size),
                gains[k] * i + offset + noise[0] * rng.standard_normal(u.size),
            )
            shots[phase.name] = Shot(1 / TICKS_S, u, i, other, (0.0, 0.0))
        out.append(Taken(place, float(read[AT["x"]]), float(read[AT["angle"]]), shots, {}, ("READY",)))
    return with_pulses(out)
