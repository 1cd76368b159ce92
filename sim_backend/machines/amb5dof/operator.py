"""Who works on the AMB stand: fixes weights in its balancing planes, with the errors that the rig file states."""

from __future__ import annotations

import math

from bench.rigfile import RigFile
from sim_backend.draws import draw_one
from sim_backend.machine import Truth
from sim_backend.machines.amb5dof.plant import AmbPlant

WORK_S = 1.0
PLANES = {"inboard": 0, "outboard": 1}


class Balancer:
    """Each weight is off by a mass and an angle of its own, from the rig file's `machine.weight_mass` and `weight_angle`;
    all sit at the radius that was drawn for the rig. Defects: `weight_lost`, what is fixed falls off; the number of the weight
    that goes into the other plane (`weight_astray`), that is turned by `weight_turned_rad` (`weight_turned`), that is heavier
    by the share `weight_heavy_by` (`weight_heavy`); `loose_weight`, an unbalance in kg m that somebody left in the inboard
    plane."""

    def __init__(self, plant: AmbPlant, rig: RigFile, truth: Truth) -> None:
        self._plant, self._truth = plant, truth
        self._errors = [rig.machine.get(name) for name in ("weight_mass", "weight_angle")]
        self._radius = truth.values.get("geometry.balance_radius", 0.0)
        self._planes = PLANES | {name: k for k, name in enumerate(rig.balancing)}
        self._fixed = 0
        if truth.defects.get("loose_weight"):
            plant.weights(0, truth.defects["loose_weight"], 0.0)

    def request(self, line: str) -> str:
        """One line: `attach PLANE KG RAD`, `detach PLANE`, `ask TEXT`; planes by the rig file's names, or as they were called
        before they had any. Answers `ok SECONDS`, `yes` or `error TEXT`."""
        match line.split():
            case ["ask", *_]:
                return "yes"
            case ["attach", plane, mass, angle] if plane in self._planes and self._radius and numbers(mass, angle):
                self._attach(self._planes[plane], float(mass), float(angle))
            case ["detach", plane] if plane in self._planes and self._radius:
                self._plant.without_weights(self._planes[plane])
            case _:
                return f"error cannot {line.strip()!r}"
        return f"ok {WORK_S}"

    def _attach(self, plane: int, mass: float, angle: float) -> None:
        self._fixed += 1
        seed, visit, defects = self._truth.seed, self._truth.visit, self._truth.defects
        off = [
            draw_one(t, seed, self._truth.anew(f"weight:{k}:{self._fixed}"), visit) if t is not None else 0.0
            for k, t in enumerate(self._errors)
        ]
        if self._fixed == defects["weight_astray"]:
            plane = 1 - plane
        if self._fixed == defects["weight_turned"]:
            angle += defects["weight_turned_rad"]
        if self._fixed == defects["weight_heavy"]:
            mass *= 1 + defects["weight_heavy_by"]
        if not defects["weight_lost"]:
            self._plant.weights(plane, (mass + off[0]) * self._radius, angle + off[1])


def numbers(mass: str, angle: str) -> bool:
    """Whether these are a mass and an angle."""
    try:
        return float(mass) > 0 and math.isfinite(float(mass)) and math.isfinite(float(angle))
    except ValueError:
        return False
