"""The truth of set-point steps of a rig's twin: the same machine does the same steps without noise and rounding; small motions
are steps of ten nanometres."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from sim_backend.machine import Truth
from sim_backend.machines.stepping import Shown, Small, Watched, small, steps
from sim_backend.machines.twin.plant import TwinPlant
from sim_backend.machines.twin.quiet import Floating, Sight, floating
from sim_backend.motion import StepsAsked

Array = npt.NDArray[np.float64]
REPEATS = 32  # of a small step round a revolution


def steps_asked(rig: RigFile, drawn: Truth, asked: StepsAsked) -> tuple[Small, dict[tuple[float, int], Shown]]:
    """Along one axis: small motions, and by size and way the steps."""
    slew = rig.capabilities.set_points.slew
    settings: Mapping[str, float] = {**asked.settings, **({slew: 0.0} if slew else {})}
    made = floating(rig, drawn, settings, asked.speed)
    plant, sight = made.plant, Sight(rig, made.plant.params, drawn.values)

    def write(plant: TwinPlant, end: float) -> None:
        Floating(plant, made.parameters.on(plant)).write(asked.points(end))

    of = Watched(asked.axis, sight.shaft, write, plant.tick_s)
    turn_s = 2 * math.pi / asked.speed if asked.speed else 0.0
    of_small = small(plant, of, REPEATS, turn_s) if turn_s else small(plant, of)
    out: dict[tuple[float, int], Shown] = {}
    for size in sorted(asked.sizes):
        shown = steps(plant, of, size, asked.rest_s, asked.record_s, wait_s=asked.wait_s, turn_s=turn_s)
        out |= {(size, way): s for way, s in shown.items()}
    return of_small, out
