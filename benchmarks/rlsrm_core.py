"""Speed of the rotary-linear motor's core, and beside it that of another one in C of the same machine, where one is given.

    python benchmarks/rlsrm_core.py
    python benchmarks/rlsrm_core.py --beside FOLDER/rlsrm.c

60 s of bench time, the angle following a sine of 200 degrees in 5 s, steps of 50 us, friction along the path of the bearing's
balls, no rows. The other is a program that takes key=value and tells its own processor time as `cpu`; it is compiled here with
the flags of the core. Prints bench seconds per second of processor time, best of five, interleaved, and the ratio of the two
times; at most 1.1 is the target.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from sim_backend.core.build import AVX2, FLAGS
from sim_backend.machines.rlsrm.params import ControlParams, PlantParams
from sim_backend.machines.rlsrm.plant import Plant

BENCH_S = 60
TURN = math.radians(200)
APART = 1.5 * math.pi / 180
NOT_OF_A_PROGRAM = ("-shared", "-fPIC")


def ours() -> Callable[[], float]:
    """A run of the core; returns its processor time, s."""

    def run() -> float:
        plant = Plant(PlantParams(), replace(ControlParams(), wave=(0.0, 1.0), amplitude=(0.0, TURN)))
        plant.switch(on=True, x=True, angle=True)
        start = time.process_time()
        plant.run(BENCH_S, 0)
        took = time.process_time() - start
        if abs(plant.place[1]) > APART:  # whole periods: back at zero but for the lag
            raise SystemExit("the angle does not follow; nothing to time")
        return took

    return run


def other(source: Path, folder: Path) -> Callable[[], float]:
    """A run of the other one; returns the processor time that it tells."""
    made = folder / "other"
    flags = [flag for flag in (*FLAGS, *AVX2) if flag not in NOT_OF_A_PROGRAM]
    subprocess.run(["cc", *flags, "-D_GNU_SOURCE", "-o", made, source, "-lm"], check=True)
    command = [str(made), "couple=1", "rt_kind=1", f"rt_amp={TURN}", f"t_end={BENCH_S}"]

    def run() -> float:
        words = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
        return float(words[words.index("cpu") + 1])

    return run


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--beside", type=Path, help="a program in C of the same machine")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        cores = {"rlsrm core": ours()}
        if asked.beside:
            cores[str(asked.beside)] = other(asked.beside, Path(folder))
        best = dict.fromkeys(cores, math.inf)
        for _ in range(5):
            for name, run in cores.items():
                best[name] = min(best[name], run())
    for name, seconds in best.items():
        print(f"{name}: {BENCH_S} s in {seconds:.3f} s, {BENCH_S / seconds:.0f} times real time")
    if len(best) == 2:
        mine, theirs = best.values()
        print(f"ratio {mine / theirs:.3f}, target at most 1.1")


if __name__ == "__main__":
    main()
