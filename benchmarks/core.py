"""Speed of the C core alone: 60 s of bench time, noise included, two integration steps per tick, 22 columns at 1 kHz.

    python benchmarks/core.py

Prints bench seconds per second of processor time, best of three; the target is 100.
"""

from __future__ import annotations

import time

from sim_backend.core import LEVITATE, LIFT, READY, TICK_S
from sim_backend.machines.tsbs.plant import Plant

BENCH_S = 60
CASES = {"standing": {}, "at 40 rad/s": {"speed_ref": 40.0}, "motor carrying": {"motor_share": 1.0}}
"""What the law does meanwhile."""


def levitated() -> Plant:
    """The nominal machine, held, with a weight on its hook."""
    plant = Plant(seed=1, substeps=2)
    plant.mode = READY
    plant.run(1000)
    plant.mode = LIFT
    plant.run(12000)
    plant.mode = LEVITATE
    plant.load(1.25, 12.26, 0.3)
    plant.run(5000)
    return plant


def main() -> None:
    """Run and print."""
    best = {}
    for case, settings in CASES.items():
        plant = levitated()
        for name, value in settings.items():
            plant.set(name, value)
        plant.run(30000)
        times = []
        for _ in range(3):
            start = time.process_time()
            rows = plant.run(round(BENCH_S / TICK_S))
            times.append(time.process_time() - start)
            if len(rows) != BENCH_S * 1000:
                raise SystemExit(f"the plant tripped (bits {plant.trips}); nothing to time")
        best[case] = min(times)
    for case, seconds in best.items():
        print(f"core, {case}: {BENCH_S} s in {seconds:.3f} s, {BENCH_S / seconds:.0f} times real time")


if __name__ == "__main__":
    main()
