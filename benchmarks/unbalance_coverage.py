"""Coverage of procedure `unbalance` over virtual rigs: the share of 95 % intervals and ellipses that hold what the shaft does.

    python benchmarks/unbalance_coverage.py --first 3000 --count 60 --law CCS --compensate

A short plan, no report; some 2 s of processor time a rig. The values of a rig share its certificates and its runout, so that
shares come with their standard error over the rigs, not over the values. D_max by Monte Carlo costs as much as the rest: it is
looked at on the first `--d-max` rigs only.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bench.analysis.vectors import Vectors, contains
from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.uncertainty import Estimate, correlation, interval
from procedures.estimators.unbalance_data import AXES, DWELL, PLANES, RPM
from procedures.unbalance import CODES, POLES, SETTINGS
from sim_backend import amb_unbalance
from sim_backend.truth import draw

RIG = "amb5dof"
PLAN: dict[str, Any] = {
    "speeds_rad_s": (3000 / RPM, 10000 / RPM), "slow_s": 4.2, "dwell_s": 1.0, "settle_s": 1.0, "capture_s": 0.2,
    "repeat": False,
}  # fmt: skip
Hits = dict[str, dict[int, list[tuple[bool, float, float]]]]
"""By quantity and seed: held, error, half width."""


def one(seed: int, plan: Mapping[str, Any], path: Path, d_max: bool, hits: Hits) -> None:
    """A rig's vectors and D_max into `hits`."""
    path.unlink(missing_ok=True)
    run = simulated_run("unbalance", RIG, seed, plan, path)
    serious = [f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE]
    if serious:
        print(f"seed {seed}: {', '.join(serious)}")
    found = {(m.quantity.name, m.where): m.estimate for m in run.results if isinstance(m, Measured)}
    rig, made = load_rig(RIG), run.recording.plan
    settings = {n: p.default for n, p in rig.parameters.items()} | (POLES if made.observed else {})
    plant = draw(rig, seed).plant
    for step in run.recording.steps(DWELL):
        variant, driven = str(step.labels["variant"]), float(step.labels["driven_rad_s"])  # a loaded drive falls short
        where = f"{float(step.labels['speed_rad_s']) * RPM:.0f} r/min, {variant}"
        used = {**settings, **SETTINGS[variant], "law": CODES[made.law]}  # type: ignore[index]
        true = amb_unbalance.motion(plant, used, driven)
        for axis, shaft in zip(AXES, true.shaft, strict=True):
            c, s = (found[f"vector_{part}", f"{axis}, {where}"] for part in ("cos", "sin"))
            for name, e, value in (("vector_cos", c, shaft.real), ("vector_sin", s, -shaft.imag)):
                for key in (name, f"vectors at {where}"):
                    _into(hits[key][seed], e, float(value))
            hits[f"ellipses at {where}"][seed].append((_held(c, s, complex(shaft)), math.nan, math.nan))
        for plane, value in zip(PLANES, true.d_max, strict=True) if d_max else ():
            _into(hits["d_max"][seed], found["d_max", f"{plane}, {where}"], value)


def _into(hits: list[tuple[bool, float, float]], e: Estimate, value: float) -> None:
    i = interval(e)
    hits.append((i.low <= value <= i.high, abs(e.value - value), (i.high - i.low) / 2))


def _held(c: Estimate, s: Estimate, true: complex) -> bool:
    """Whether the 95 % ellipse of C - j S holds a vector."""
    both = -correlation(c, s) * c.u * s.u
    return contains(
        Vectors(np.array([c.value - 1j * s.value]), np.array([[c.u**2, both], [both, s.u**2]]), math.inf), true
    )


def main() -> None:
    """Print a line for each quantity."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=3000)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--law", default="CCS", choices=CODES)
    parser.add_argument("--compensate", action="store_true")
    parser.add_argument("--d-max", type=int, default=12)
    chosen = parser.parse_args()
    plan = {**PLAN, "law": chosen.law, "variants": ("off", "corrected") if chosen.compensate else ("off",)}
    hits: Hits = defaultdict(lambda: defaultdict(list))
    with tempfile.TemporaryDirectory() as folder:
        for k in range(chosen.count):
            one(chosen.first + k, plan, Path(folder) / "recording.mcap", k < chosen.d_max, hits)
    for name, rigs in hits.items():
        shares = np.array([np.mean([h for h, _, _ in found]) for found in rigs.values()])
        away, half = np.array([x[1:] for found in rigs.values() for x in found]).T
        far = 1e6 * np.quantile(away, 0.95)
        width = "" if math.isnan(far) else f"; 95 % of errors within {far:.3f} um; width {1e6 * half.mean() / far:.2f}"
        error = shares.std() / math.sqrt(len(shares))
        print(f"{name:34s} {shares.mean():.3f} +- {error:.3f} of {len(half)} on {len(shares)} rigs{width}")
    print(f"{time.process_time() / chosen.count:.1f} s of processor time a rig")


if __name__ == "__main__":
    main()
