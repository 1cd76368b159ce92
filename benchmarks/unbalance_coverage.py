"""Coverage of procedure `unbalance` over virtual rigs: the share of 95 % intervals and ellipses that hold what the shaft does.

python benchmarks/unbalance_coverage.py --first 0 --count 40 --law CCS --compensate
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from bench.analysis.vectors import contains
from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from bench.rigfile import load_rig
from bench.uncertainty import interval
from procedures.estimators import unbalance_estimates
from procedures.estimators.unbalance_data import AXES, PLANES, RPM, read_dwells
from procedures.unbalance import CODES, POLES, SETTINGS
from sim_backend import amb_unbalance
from sim_backend.truth import draw

RIG = "amb5dof"
PLAN: dict[str, Any] = {
    "speeds_rad_s": (3000 / RPM, 10000 / RPM), "slow_s": 5.0, "dwell_s": 1.0, "settle_s": 1.0, "capture_s": 0.2,
    "repeat": False,
}  # fmt: skip


def one(seed: int, plan: dict[str, Any], folder: Path, hits: dict[str, list[tuple[bool, float, float]]]) -> None:
    """A rig's vectors and D_max into `hits`: held, error, half width."""
    rig, path = load_rig(RIG), folder / "recording.mcap"
    path.unlink(missing_ok=True)
    run = simulated_run("unbalance", RIG, seed, plan, path)
    serious = [f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE]
    if serious:
        print(f"seed {seed}: {', '.join(serious)}")
    made = run.recording.plan
    results = unbalance_estimates.results(read_dwells(run.recording), run.recording.rig, made)
    plant, defaults = draw(rig, seed).plant, {n: p.default for n, p in rig.parameters.items()}
    for r in results.dwells:
        settings = {**defaults, **(POLES if made.observed else {}), **SETTINGS[r.dwell.variant], "law": CODES[made.law]}  # type: ignore[index]
        true = amb_unbalance.motion(plant, settings, r.dwell.speed)
        wanted = {("d_max", plane): value for plane, value in zip(PLANES, true.d_max, strict=True)}
        for k, axis in enumerate(AXES):
            wanted |= {
                ("vector_cos", axis): float(true.shaft[k].real),
                ("vector_sin", axis): float(-true.shaft[k].imag),
            }
            held = contains(r.vectors.one(k), complex(true.shaft[k]))
            hits["ellipse"].append((held, abs(r.vectors.values[k] - true.shaft[k]), math.nan))
        for key, value in wanted.items():
            e = r.estimates[key]
            i = interval(e)
            hits[key[0]].append((i.low <= value <= i.high, abs(e.value - value), (i.high - i.low) / 2))


def main() -> None:
    """Print a line for each quantity."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--law", default="CCS")
    parser.add_argument("--compensate", action="store_true")
    chosen = parser.parse_args()
    plan = {**PLAN, "law": chosen.law, "variants": ("off", "corrected") if chosen.compensate else ("off",)}
    hits: dict[str, list[tuple[bool, float, float]]] = defaultdict(list)
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(chosen.first, chosen.first + chosen.count):
            one(seed, plan, Path(folder), hits)
    for name, found in hits.items():
        held, away, half = np.array(found).T
        width = half.mean() / np.quantile(away, 0.95)
        print(f"{name:12s} {held.mean():.3f} of {len(found)} hold the truth; 95 % of errors within "
              f"{1e6 * np.quantile(away, 0.95):.3f} um; mean half width over that {width:.2f}")  # fmt: skip


if __name__ == "__main__":
    main()
