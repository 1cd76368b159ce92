"""Who works on the rotary-linear motor: hangs weights over pulleys at both ends of its shaft and on a disc, clamps its axes,
puts a ring on it or a bar into its bore."""

from __future__ import annotations

import math
from typing import Final

from bench.rigfile import RigFile
from sim_backend.instrument import Instruments
from sim_backend.load_cells import Cells
from sim_backend.machine import Truth, weight_in_air
from sim_backend.machines.rlsrm.device import StagePlant
from sim_backend.machines.rlsrm.plant import AXES, TICKS_S
from sim_backend.operator_line import words

HAND_OVER_S: Final = 0.3  # how long it takes to let a mass go
WORK_S: Final = 1.0
STILL_S: Final = 0.1
NONE: Final = (0.0, 0.0)
LOCKS: Final = {"lock": (True, True), "lock-along": (True, False), "lock-around": (False, True)}
PARTS: Final = ("ring", "bar")
DAMPED: Final = 0.1  # share of the critical damping that load cells have
SIDES: Final = {"above": 1, "below": -1}
GRAVITY: Final = "site.gravity"


class Attendant:
    """A weight over a pulley pulls along the shaft with what the pulley's misalignment leaves of it, and its friction is one
    more that acts on the axis; its mass moves along. On the disc it gives a torque with the same arm at every angle.

    Args:
        rig: its hooks say to which end they pull.
    """

    def __init__(self, rig: RigFile, plant: StagePlant, truth: Truth) -> None:
        self._plant, self._truth = plant, truth
        self._ends = {name: 1 if hook.along == "far" else -1 for name, hook in rig.hooks.items()}
        self._masses = tuple(rig.masses)
        self._hung: dict[str, str] = {}  # labels by hook or side
        places = {name: lambda k=k: float(plant.core.place[k]) for k, name in enumerate(AXES)}
        self._instruments = Instruments(rig, truth, places, lambda: plant.core.tick / TICKS_S)
        loads = {name: lambda k=k: plant.core.carried[k] for k, name in enumerate(AXES)}
        self._cells = Cells(rig, truth, loads, lambda: plant.core.tick / TICKS_S)
        self._carries = all(axis in rig.capabilities.load_cells for axis in AXES)

    def request(self, line: str) -> str:
        """One line: `hang HOOK M1`, `hang HOOK -`, `lever left M1`, `lever left -`, `mount ring`, `mount bar`, `mount lock`
        (both axes), `mount lock-along`, `mount lock-around`, `mount cells` (load cells in their place), `mount -` (all of these
        off), `wind above`, `wind below`, `read AXIS`, `cell AXIS`, `ask TEXT`. Answers
        `ok SECONDS` (when it will be done), `ok SECONDS NUMBER UNIT`, `yes` or `error TEXT`."""
        match words(line, self._masses):
            case ["ask", *_]:
                return "yes"
            case ["read", axis]:
                return self._instruments.request(axis)
            case ["cell", axis]:
                return self._cells.request(axis)
            case ["wind", side] if side in SIDES and self._plant.core.carries:
                return f"ok {self._plant.core.wind(SIDES[side]) + STILL_S}"
            case ["hang", hook, label] if hook in self._ends and self._knows(label):
                return self._hang(hook, label)
            case ["lever", "left" | "right" as side, label] if self._knows(label):
                return self._hang(side, label)
            case ["mount", "-"]:
                self._plant.core.clamp(False, False)
                self._plant.core.carry(NONE, NONE)
                self._mount("")
            case ["mount", "cells"] if self._carries:
                self._carry()
            case ["mount", part] if part in PARTS:
                self._mount(part)
            case ["mount", lock] if lock in LOCKS:
                self._plant.core.clamp(*LOCKS[lock])
            case _:
                return f"error cannot {line.strip()!r}"
        return f"ok {WORK_S}"

    def _knows(self, label: str) -> bool:
        return label == "-" or f"masses.{label}" in self._truth.values

    def _mount(self, part: str) -> None:
        v, p = self._truth.values, self._plant.built.plant
        more = {
            "ring": ("machine.ring_mass", "machine.ring_inertia"),
            "bar": ("machine.added_mass", "machine.added_mass_inertia"),
        }
        mass, inertia = (v[name] for name in more[part]) if part else NONE
        self._plant.core.weigh(p.mass + mass, p.inertia + inertia)

    def _carry(self) -> None:
        p, stiffness = self._plant.built.plant, [1 / self._cells.gives(axis) for axis in AXES]
        critical = [2 * math.sqrt(k * j) for k, j in zip(stiffness, (p.mass, p.inertia), strict=True)]
        self._plant.core.carry((stiffness[0], stiffness[1]), (DAMPED * critical[0], DAMPED * critical[1]))

    def _hang(self, where: str, label: str) -> str:
        self._hung.pop(where, None)
        if label != "-":
            self._hung[where] = label
        force, added, rub = [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]
        for place, name in self._hung.items():
            if place in self._ends:
                self._over_pulley(place, name, force, added, rub)
            else:
                self._on_disc(place, name, force, added)
        defects = self._truth.defects
        along, around = (-1 if defects[f"{what}_exchanged"] else 1 for what in ("hook", "lever"))
        self._plant.core.hang(
            (along * force[0], around * force[1]), (added[0], added[1]), (rub[0], rub[1]), HAND_OVER_S
        )
        return f"ok {HAND_OVER_S}"

    def _over_pulley(self, hook: str, label: str, force: list[float], added: list[float], rub: list[float]) -> None:
        v = self._truth.values
        kg, newtons = self._load(label)
        force[0] += self._ends[hook] * newtons * math.cos(v[f"hooks.{hook}.pulley.misalignment"])
        added[0] += kg
        rub[0] += abs(v[f"hooks.{hook}.pulley.friction"]) * newtons

    def _on_disc(self, side: str, label: str, force: list[float], added: list[float]) -> None:
        kg, newtons, arm = self._truth.on_lever(side, label)
        force[1] += newtons * arm
        added[1] += kg * arm**2

    def _load(self, label: str) -> tuple[float, float]:
        """Mass and weight in air of a mass on its cord."""
        v = self._truth.values
        kg = v[f"masses.{label}"] * (1 + self._truth.defects.get(f"mass_error_{label}", 0.0)) + v["hanger"]
        return kg, weight_in_air(kg, v)
