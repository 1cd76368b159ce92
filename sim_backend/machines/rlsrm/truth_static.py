"""Truth of force and torque of single phases, as encoders read places."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from bench.rigfile import RigFile
from sim_backend.core.plant import Array
from sim_backend.machines.rlsrm.params import PHASES, Map
from sim_backend.machines.rlsrm.plant import slopes
from sim_backend.machines.rlsrm.truth_map import of_map, read_frame
from sim_backend.stage_motion import StaticsAsked

PULSED: Final = ("give", "give_x", "leakage", "resistance")
"""What a test by pulses tells alone."""
ANGLES: Final = 721


def statics(rig: RigFile, drawn: Any, asked: StaticsAsked) -> Mapping[tuple[str, str], float]:
    """By quantity of `static-characteristics` and where."""
    v, known = drawn.values, read_frame(drawn.plant.plant)
    out = {
        (f"static_{name}", where): value for (name, where), value in of_map(rig, drawn).items() if name not in PULSED
    }
    out |= {("cell_give_x", ""): v["load_cells.x.give"], ("cell_give", ""): v["load_cells.angle.give"]}
    cells, arm = rig.capabilities.load_cells, cells_arm(rig)
    gains = {axis: v[f"load_cells.{axis}.gain"] / cells[axis].gain.value for axis in ("x", "angle")}
    out["reciprocity", ""] = (
        gains["angle"] / gains["x"] / (v["geometry." + arm] / rig.geometry[arm].value if arm else 1.0)
    )
    for k, name in enumerate(PHASES):
        out["force", name], out["torque", name] = _greatest(known, k, asked.greatest)
    if asked.beside is not None:
        own = np.array(
            [_loads(known, *one) for one in zip(asked.x, asked.angle, asked.phase, asked.current, strict=True)]
        )
        for name, true, other in zip(
            ("force_ratio", "torque_ratio"), own.T, map(np.asarray, asked.beside), strict=True
        ):
            out[name, ""] = float(true @ other / (other @ other))
    return out


def cells_arm(rig: RigFile) -> str:
    """The length of the torque cell's arm, by its name; none of a transducer."""
    return rig.capabilities.load_cells["angle"].arm.removeprefix("geometry/")


def _q(known: Map, current: float) -> float:
    return float(current**2 / (1 + np.sqrt(1 + (current / known.saturation) ** 2)))


def _loads(known: Map, x: float, angle: float, phase: int, current: float) -> tuple[float, float]:
    _, along, around = slopes(known, x, angle)
    return float(along[phase]) * _q(known, current), float(around[phase]) * _q(known, current)


def _greatest(known: Map, k: int, current: float) -> tuple[float, float]:
    """Without what turns once: aligned at the centre, and the greatest torque there."""
    even = Map(**{**vars(known), "uneven": 0.0})
    aligned = (0.0, np.pi / 3, np.pi / 6)[k % 3] + known.zero[k // 3]
    force = abs(_loads(even, known.centre, aligned, k, current)[0])
    turned: Array = np.linspace(aligned - np.pi / 4, aligned, ANGLES)
    return force, max(_loads(even, known.centre, float(a), k, current)[1] for a in turned)
