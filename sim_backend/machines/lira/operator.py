"""Who works on the linear-rotary actuator: hangs weights on its mover and puts a ring on it, once nothing is live."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from bench.rigfile import RigFile
from sim_backend.draws import uniform
from sim_backend.machine import Truth, weight_in_air
from sim_backend.machines.lira.plant import Plant
from sim_backend.operator_line import words

HAND_OVER_S: Final = 5.0
TOUCHED: Final = ("OFF", "IDLE", "FAULT")
HARMLESS_V: Final = 60.0
SEAT: Final = "geometry.hook_far"
"""Where the ring sits: over the groove near the load's end."""
RING: Final = ("machine.ring_mass", "machine.ring_inertia", "machine.ring_eccentricity")


class Attendant:
    """Says yes, hangs masses on hooks of a mover that lies and puts a ring on it. `hung` counts the hangings, `mounted` the
    mountings.

    Args:
        rig: its hooks count from the mover's centre of mass, each by one number of `[geometry]`.
    """

    def __init__(self, rig: RigFile, plant: Plant, truth: Truth) -> None:
        self._plant, self._truth = plant, truth
        self._at = {name: _drawn(str(hook.at), truth.values) for name, hook in rig.hooks.items()}
        self._masses = tuple(rig.masses)
        self._seat_m = rig.hook_seat.half_width or 0.0
        self.hung = self.mounted = 0

    def request(self, line: str) -> str:
        """One line: `hang HOOK M1`, `hang HOOK -`, `mount ring`, `mount -`, `ask TEXT`. Answers `ok SECONDS`, `yes` or
        `error TEXT`."""
        match words(line, self._masses):
            case ["ask", *_]:
                return "yes"
            case ["hang", hook, label] if hook in self._at and (
                label == "-" or f"masses.{label}" in self._truth.values
            ):
                return self._live() or self._hang(hook, "" if label == "-" else label)
            case ["mount", "ring" | "-" as part] if all(name in self._truth.values for name in RING):
                return self._live() or self._mount(part)
        return f"error cannot {line.strip()!r}"

    def _live(self) -> str:
        if self._plant.state in TOUCHED and self._plant.link_V < HARMLESS_V:
            return ""
        return f"error the machine is live: {self._plant.state}, {self._plant.link_V:.0f} V"

    def _mount(self, part: str) -> str:
        """A ring by its certificate, off the axis by its fit, in any phase."""
        self.mounted += 1
        defects, values = self._truth.defects, self._truth.values
        if part == "-" or defects["ring_missing"]:
            self._plant.mount(0.0, 0.0, 0.0)
            return f"ok {HAND_OVER_S}"
        kg, inertia, off = (values[name] for name in RING)
        more = 1 + defects["ring_other"]
        phase = 2 * math.pi * uniform(self._truth.seed, self._truth.anew(f"ring:{self.mounted}"), self._truth.visit)
        self._plant.mount(kg * more, weight_in_air(kg * more, values), inertia * more, at=values[SEAT], off=off,
                          phase=phase, grip=defects["ring_grip"] or math.inf)  # fmt: skip
        return f"ok {HAND_OVER_S}"

    def _hang(self, hook: str, label: str) -> str:
        self.hung += 1
        defects, values = self._truth.defects, self._truth.values
        if not label:
            self._plant.hang(0.0, 0.0, 0.0)
            return f"ok {HAND_OVER_S}"
        others = [at for name, at in self._at.items() if name != hook]
        elsewhere = defects["places_exchanged"] or defects["misplaced"] == self.hung
        at = others[0] if elsewhere and others else self._at[hook]
        kg = values[f"masses.{label}"] * (1 + defects.get(f"mass_error_{label}", 0.0))
        seat = self._seat_m * (
            2 * uniform(self._truth.seed, self._truth.anew(f"seat:{self.hung}"), self._truth.visit) - 1
        )
        self._plant.hang(kg, weight_in_air(kg, values), at + seat)
        return f"ok {HAND_OVER_S}"


def _drawn(at: str, values: Mapping[str, float]) -> float:
    """A place as the rig file says it: the identity of a number, with its sign."""
    name = at.removeprefix("-").strip().replace("/", ".")
    return -values[name] if at.startswith("-") else values[name]
