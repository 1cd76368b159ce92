"""Speed of the twin's core beside the AMB stand's, in one run: the same rotor on the same five axes at the same tick, 60 s
of bench time at 10 000 r/min, noise included, PID, two integration steps per tick.

    python benchmarks/twin_core.py

Prints bench seconds per second of processor time, best of five, and the ratio of the two times; at most 1.4 is the target.
"""

from __future__ import annotations

import math
import time
from pathlib import Path

from bench.rigfile import RigFile
from sim_backend.core import LEVITATE, LIFT, READY, DriveLaw
from sim_backend.machines.amb5dof.params import AmbControl
from sim_backend.machines.amb5dof.plant import AmbPlant
from sim_backend.machines.twin.plant import TwinPlant
from sim_backend.truth import draw

BENCH_S = 60
SPEED = 10000 * math.pi / 30
RIG = Path(__file__).resolve().parents[1] / "rigs/amb5dof.toml"


def rigid(machine: str) -> RigFile:
    """The shipped stand with a rigid shaft, as one machine or the other simulates it."""
    text = RIG.read_text(encoding="utf-8").replace('machine = "amb5dof"', f'machine = "{machine}"')
    text = text.replace("mode_1_on = 1.0", "mode_1_on = 0.0").replace("mode_2_on = 1.0", "mode_2_on = 0.0")
    return RigFile.parse(text, RIG.with_suffix(".dbc").read_text(encoding="utf-8"), str(RIG))


def turning(plant: AmbPlant | TwinPlant) -> AmbPlant | TwinPlant:
    """Held and brought to speed."""
    plant.mode = READY
    plant.run(1000)
    plant.mode = LIFT
    plant.run(11000)
    plant.mode = LEVITATE
    plant.drive(DriveLaw(0.02, 0.2, 400.0), SPEED)
    plant.run(40000)
    return plant


def main() -> None:
    """Run and print."""
    stand, twin = draw(rigid("amb5dof"), 1), draw(rigid("twin"), 1)
    plants = {
        "AMB stand": turning(AmbPlant(stand.plant, 1, control=AmbControl(law=0))),
        "twin": turning(TwinPlant(twin.plant, 1)),
    }
    best = dict.fromkeys(plants, math.inf)
    for _ in range(5):
        for name, plant in plants.items():
            start = time.process_time()
            rows = plant.run(BENCH_S * 10000)
            best[name] = min(best[name], time.process_time() - start)
            if len(rows) != BENCH_S * 1000:
                raise SystemExit(f"{name}: the plant tripped (bits {plant.trips}); nothing to time")
    for name, seconds in best.items():
        print(f"{name}: {BENCH_S} s in {seconds:.3f} s, {BENCH_S / seconds:.0f} times real time")
    print(f"twin over AMB stand: {best['twin'] / best['AMB stand']:.2f}")


if __name__ == "__main__":
    main()
