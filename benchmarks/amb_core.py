"""Speed of the AMB stand's core alone: 60 s of bench time at 10 000 r/min, noise included, two integration steps per tick.

    python benchmarks/amb_core.py

Prints bench seconds per second of processor time, best of three, for each law and for what can be added to one; the target
is 100 for each law.
"""

from __future__ import annotations

import math
import time

from sim_backend.core import LEVITATE, LIFT, READY, TICK_S, DriveLaw
from sim_backend.machines.amb5dof.params import AmbControl, AmbParams
from sim_backend.machines.amb5dof.plant import AmbPlant

BENCH_S = 60
SPEED = 10000 * math.pi / 30
NOTCHES = {"notch1_hz": 650.0, "notch1_q": 2.0, "notch2_hz": 1240.0, "notch2_q": 2.0}
CASES: dict[str, tuple[AmbControl, AmbParams]] = {
    "PID": (AmbControl(law=0), AmbParams()),
    "CCS": (AmbControl(law=1), AmbParams()),
    "CAC": (AmbControl(law=2), AmbParams()),
    "CCS with observer": (AmbControl(law=1, observer=1, compensate=3, integral=0), AmbParams()),
    "CCS with notches, bending shaft": (AmbControl(law=1, **NOTCHES), AmbParams(mode_on=(1.0, 1.0))),
}


def turning(control: AmbControl, params: AmbParams) -> AmbPlant:
    """The machine, held and brought to speed."""
    plant = AmbPlant(params, 1, control=control)
    plant.mode = READY
    plant.run(1000)
    plant.mode = LIFT
    plant.run(6000)
    plant.mode = LEVITATE
    plant.drive(DriveLaw(0.02, 0.2, 400.0), SPEED)
    plant.run(40000)
    return plant


def main() -> None:
    """Run and print."""
    for case, (control, params) in CASES.items():
        plant, times = turning(control, params), []
        for _ in range(3):
            start = time.process_time()
            rows = plant.run(round(BENCH_S / TICK_S))
            times.append(time.process_time() - start)
            if len(rows) != BENCH_S * 1000:
                raise SystemExit(f"{case}: the plant tripped (bits {plant.trips}); nothing to time")
        print(f"AMB core, {case}: {BENCH_S} s in {min(times):.3f} s, {BENCH_S / min(times):.0f} times real time")


if __name__ == "__main__":
    main()
