"""The truth of one simulated rig: drawn for a seed from exactly the distributions that the rig file states.

The bench never sees any of it; tests and campaigns read `truth.json`.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from bench.errors import ConfigError
from bench.rigfile import RigFile
from sim_backend.draws import draw_one
from sim_backend.machine import Machine, machine_of
from sim_backend.unspoken import unspoken


@dataclass(frozen=True)
class Truth:
    """Every drawn value by name, planted defects, and what follows from them."""

    seed: int
    values: Mapping[str, float]
    defects: Mapping[str, float]
    plant: Any  # parameters of the machine's plant
    quantities: Mapping[str, float]
    machine: Machine

    @property
    def supply_V(self) -> float:
        """Of the amplifiers: the machine's, or what the rig file or an override says."""
        return self.values.get("supply_V", self.machine.supply_V)

    def load(self, label: str) -> tuple[float, float]:
        """Hung mass in kg and its weight in air in N for a load's label; the hanger is on, and "" is nothing else.

        Raises:
            KeyError: the rig has no such mass.
        """
        kg = 0.0
        if label:
            kg = self.values[f"masses.{label}"] * (1 + self.defects.get(f"mass_error_{label}", 0.0))
        if label or not self.defects["hanger_off_at_zero"]:
            kg += self.values["hanger"]
        return kg, _weight(kg, self.values)

    def on_lever(self, side: str, label: str) -> tuple[float, float, float]:
        """Mass in kg on the lever, its weight in air in N, and its arm in m, positive on the left.

        Raises:
            KeyError: the rig has no such mass, or no lever.
        """
        arm = self.values[f"geometry.lever_{side}"] * {"left": 1, "right": -1}[side]
        if not label:
            return 0.0, 0.0, arm
        kg = self.values[f"masses.{label}"] * (1 + self.defects.get(f"mass_error_{label}", 0.0))
        return kg, _weight(kg, self.values), arm


def _weight(kg: float, v: Mapping[str, float]) -> float:
    density = v["mass_density"]
    true = kg * (1 - 1.2 / 8000) / (1 - 1.2 / density)  # `kg` is a conventional mass, OIML D 28
    return true * v["site.gravity"] * (1 - v["site.air_density"] / density)


def draw(
    rig: RigFile,
    seed: int,
    overrides: Mapping[str, float] | None = None,
    settings: Mapping[str, float] | None = None,
) -> Truth:
    """Draw a rig. `overrides` set drawn values or defects by name, or the truth of the machine's `targets` directly.
    `settings` are the controller parameters that a procedure will write: the measurands hold for the bias among them.

    Raises:
        ConfigError: an override names nothing, or the rig file has nothing to simulate.
    """
    if not rig.simulation:
        raise ConfigError(
            f"rig {rig.name}: found no [simulation] table, so that there is nothing to simulate; expected --backend live"
        )
    machine = machine_of(rig)
    if lacking := tuple(unspoken(rig, machine)):
        raise ConfigError(f"rig {rig.name} cannot be simulated:", lacking)
    tolerances = machine.stated(rig)
    values = {name: draw_one(t, seed, name) for name, t in tolerances.items()}
    values |= {k: float(v) for k, v in rig.simulation.items() if isinstance(v, int | float)}
    defects = dict(machine.defects)
    wanted = dict(overrides or {})
    used = {**{n: p.default for n, p in rig.parameters.items()}, **(settings or {})}
    targets = {k: wanted.pop(k) for k in machine.targets if k in wanted}
    for name, value in wanted.items():
        table = defects if name in defects else values
        if name not in table:
            known = [*tolerances, *defects, *machine.targets]
            close = difflib.get_close_matches(name, known, 3)
            raise ConfigError(
                f"--truth {name}: no such value; {'did you mean' if close else 'expected one of'} {', '.join(close or known)}"
            )
        table[name] = float(value)
    for name, value in targets.items():
        values[machine.targets[name]] *= value / machine.quantities(machine.params(values, defects), used)[name]
    plant = machine.params(values, defects)
    return Truth(seed, values, defects, plant, machine.quantities(plant, used), machine)


def nominal(rig: RigFile) -> Mapping[str, float]:
    """Overrides that put every drawn value at what the rig file states."""
    return {name: t.value for name, t in machine_of(rig).stated(rig).items()}
