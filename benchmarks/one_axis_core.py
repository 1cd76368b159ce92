"""Speed of the one-axis AMB's core, and beside it that of another one in C of the same loop, where one is given.

    python benchmarks/one_axis_core.py
    python benchmarks/one_axis_core.py --beside FOLDER/amb1.py

60 s of bench time, noise included, two overlapping filters of degree 7 and 12 ms in the loop, reduced observer, amplifiers of
1 kHz, one RK4 step of a tick. The other is a Python module whose `make(**settings)` and `lib.run` are those of the design's
prototype; it is compiled here with the flags of the core. Prints bench seconds per second of processor time, best of five,
interleaved, and the ratio of the two times; at most 1.1 is the target.
"""

from __future__ import annotations

import argparse
import ctypes
import math
import subprocess
import tempfile
import time
from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import numpy as np

from sim_backend.core import LEVITATE
from sim_backend.core.build import AVX2, FLAGS
from sim_backend.machines.amb1dof.params import ControlParams, PlantParams
from sim_backend.machines.amb1dof.plant import Plant

BENCH_S = 60
DEGREE, SPACING = 7, 120
AMPLIFIER = 2 * math.pi * 1000


def ours() -> Callable[[], int]:
    """A run of the core; returns its ticks."""
    plant = Plant(PlantParams(amplifier_rate=AMPLIFIER), 1, control=ControlParams(compensate=1.0))
    plant.put(1e-4)
    plant.mode = LEVITATE

    def run() -> int:
        return 10 * len(plant.run(BENCH_S * 10000, 1)[0])

    return run


def other(path: Path, folder: Path) -> Callable[[], int]:
    """A run of the other one, its C compiled with the core's flags; returns its ticks."""
    spec = spec_from_file_location("other_core", path)
    assert spec is not None
    assert spec.loader is not None
    module: Any = module_from_spec(spec)
    spec.loader.exec_module(module)
    made = folder / "other.so"
    subprocess.run(["cc", *FLAGS, *AVX2, "-o", made, path.with_suffix(".c"), "-lm"], check=True)
    library = ctypes.CDLL(str(made))
    library.run.restype = ctypes.c_int64
    settings = module.make(est=2, K=DEGREE, eps=SPACING, tstar=2 * SPACING, substeps=1, t_end=float(BENCH_S), t_load=1e9,
                           h_noise=0.4e-6, lag=AMPLIFIER)  # fmt: skip
    out, none = np.zeros((BENCH_S * 10000, 8)), np.zeros(1)

    def run() -> int:
        return int(
            library.run(
                ctypes.byref(settings), none.ctypes.data_as(ctypes.c_void_p), out.ctypes.data_as(ctypes.c_void_p)
            )
        )

    return run


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--beside", type=Path, help="a module in Python with its C beside it")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        cores = {"one-axis core": ours()}
        if asked.beside:
            cores[asked.beside.stem] = other(asked.beside, Path(folder))
        best = dict.fromkeys(cores, math.inf)
        for _ in range(5):
            for name, run in cores.items():
                start = time.process_time()
                done = run()
                best[name] = min(best[name], time.process_time() - start)
                if done != BENCH_S * 10000:
                    raise SystemExit(f"{name}: the plant tripped; nothing to time")
    for name, seconds in best.items():
        print(f"{name}: {BENCH_S} s in {seconds:.3f} s, {BENCH_S / seconds:.0f} times real time")
    if len(best) == 2:
        first, second = best.values()
        print(f"ratio of the times: {first / second:.2f}")


if __name__ == "__main__":
    main()
