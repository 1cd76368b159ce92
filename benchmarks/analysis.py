"""Speed of the analysis: spectra and order tracking of a minute of thirty channels at 10 kHz, on one core.

    python benchmarks/analysis.py

Prints the seconds of averaged spectra (Hann, 8192 samples, half overlap) and of vectors of orders 1 and 2 every 16 turns of a
run-up to 14 000 r/min, and their ratio to one plain numpy rfft of the same data; then a JSON line. The target is 1 s for both.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from bench.analysis.orders import synchronous
from bench.analysis.sampling import Sampling
from bench.analysis.spectra import amplitude
from bench.analysis.tachometer import tachometer

RATE, SECONDS, CHANNELS, TOP = 10_000, 60, 30, 14_000 * np.pi / 30
TARGET_S = 1.0


def run_up() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (n,), data (channels, n), times of the pulses."""
    t = np.arange(RATE * SECONDS) / RATE
    rise = TOP / SECONDS
    angle = rise * t**2 / 2
    rng = np.random.default_rng(1)
    x = rng.normal(0, 3e-7, (CHANNELS, t.size))
    x += rng.uniform(1e-6, 1e-5, (CHANNELS, 1)) * np.cos(angle)
    turns = np.arange(1, int(angle[-1] / 2 / np.pi) + 1)
    return t, x, np.sqrt(2 * 2 * np.pi * turns / rise)


def best(work: Callable[[], object], times: int = 3) -> float:
    """Least processor seconds of several tries."""
    taken = []
    for _ in range(times):
        start = time.process_time()
        work()
        taken.append(time.process_time() - start)
    return min(taken)


def main() -> int:
    """Run and print; 1 when the target is missed."""
    t, x, pulses = run_up()
    sampling = Sampling(1 / RATE)
    plain = best(lambda: np.fft.rfft(x, axis=1))
    spectra = best(lambda: amplitude(x, RATE, segment=8192))
    orders = best(lambda: synchronous(t, x, tachometer(pulses), sampling, turns=16))
    both = spectra + orders
    print(f"spectra {spectra:.2f} s, orders {orders:.2f} s, together {both:.2f} s (target {TARGET_S:.0f} s)")
    print(f"a plain rfft of the same data {plain:.2f} s; the ratio is {both / plain:.2f}")
    print(json.dumps({"spectra_s": round(spectra, 3), "orders_s": round(orders, 3), "rfft_s": round(plain, 3)}))
    return int(both > TARGET_S)


if __name__ == "__main__":
    sys.exit(main())
