"""L's mission, VI-B: out of the touchdown rings, gate, steps between two places, landing; and what it showed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim_backend.core.plant import Array
from sim_backend.machines.lira.params import ControlParams, PlantParams
from sim_backend.machines.lira.plant import AXES, TRACE, Plant

HERE, THERE = (8e-3, 0.0), (14e-3, np.radians(80))
READ = slice(0, 4)
TRUE = slice(6, 10)
MODE = TRACE.index("mode")
LEVITATED = 4.0


@dataclass(frozen=True)
class Flown:
    """How far it came, and the rows at 35 kHz; from the gate to the landing's begin those of `active`; `rests` are the second
    halves of the dwells."""

    ended: str
    rows: Array
    active: Array
    rests: tuple[Array, ...]

    @property
    def peak_m(self) -> float:
        """Greatest radial reading from gate to landing."""
        return float(abs(self.active[:, READ]).max())

    @property
    def swing_m(self) -> float:
        """Greatest peak to peak of one radial reading from gate to landing."""
        return float(np.ptp(self.active[:, READ], axis=0).max())

    def level_m(self, columns: slice) -> float:
        """Greatest difference of the radial levels in the two places."""
        means = np.array([r[:, columns].mean(axis=0) for r in self.rests])
        return float(np.ptp(means, axis=0).max())


class Host:
    """Sends commands and heartbeats, keeps the rows."""

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self.rows: list[Array] = []

    def wait(self, seconds: float) -> Array:
        """Heartbeats every 20 ms."""
        taken = []
        for _ in range(round(seconds / 0.02)):
            self.plant.beat()
            taken.append(self.plant.run(0.02))
        self.rows.append(np.vstack(taken))
        return self.rows[-1]

    def until(self, state: str, at_most_s: float) -> bool:
        """Wait for a state."""
        for _ in range(round(at_most_s / 0.02)):
            if self.plant.state == state:
                return True
            self.wait(0.02)
        return self.plant.state == state


def fly(params: PlantParams, seed: int = 0, *, reduced: bool = False, profiles: bool = True, cycles: int = 1,
        dwell_s: float = 0.3, **control: float) -> Flown:  # fmt: skip
    """The whole mission."""
    plant = Plant(params, seed, control=ControlParams(**control), reduced=reduced)
    plant.put(x=15e-6, y=-20e-6, angle=0.3)
    host, rests, begun = Host(plant), [], 0

    def flown(ended: str) -> Flown:
        rows = np.vstack(host.rows)
        flying = rows[:, MODE] == LEVITATED
        return Flown(ended, rows, rows[flying] if flying.any() else rows[:1], tuple(rests))

    host.wait(0.3)
    plant.command("idle")
    plant.command("on")
    plant.go("angle", 0.0, 2.0, 20.0)
    host.wait(0.5)
    begun = plant.command("lift")
    if begun != 0:
        return flown("refused")
    if not host.until("LEVITATED", 4.0):
        return flown("no gate" if plant.state == "LIFT" else plant.fault)
    for _ in range(cycles):
        for z, angle in (THERE, HERE):
            plant.go("z", z, 0.5, 40.0 if profiles else 0.0)
            plant.go("angle", angle, 18.0, 300.0 if profiles else 0.0)
            host.wait(0.14)
            host.wait(dwell_s / 2)
            rests.append(host.wait(dwell_s / 2))
            if plant.state != "LEVITATED":
                return flown(plant.fault)
    plant.command("land")
    landed = host.until("CURRENT", 2.0)
    return flown("landed" if landed else plant.fault)


def settled(rows: Array, axis: str) -> float:
    """Where an axis truly is at the end."""
    return float(rows[-1, 6 + AXES.index(axis)])
