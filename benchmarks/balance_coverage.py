"""Balancing of virtual rigs: how many reach the grade within the plan's corrections, and whether residuals hold the truth.

python benchmarks/balance_coverage.py --first 0 --count 20 [--positions 24] [--leave]
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from bench.analysis.vectors import contains
from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from bench.rigfile import load_rig
from bench.uncertainty import interval
from procedures.estimators import balance_checks
from procedures.estimators.balance_data import BASE, SIDES
from procedures.estimators.unbalance_data import RPM
from sim_backend import amb_balance
from sim_backend.truth import draw

RIG = "amb5dof"
PLAN: dict[str, Any] = {
    "speeds_rad_s": (10000 / RPM,), "slow_s": 5.0, "dwell_s": 0.5, "settle_s": 0.8, "capture_s": 0.3, "repeat": False,
}  # fmt: skip
Hits = dict[str, list[tuple[bool, float, float]]]


def one(seed: int, plan: dict[str, Any], folder: Path, hits: Hits) -> str:
    """Balance a rig; what held the truth goes into `hits`: held, error, half width, g mm. How it ended."""
    rig, path = load_rig(RIG), folder / "recording.mcap"
    path.unlink(missing_ok=True)
    run = simulated_run("balance", RIG, seed, plan, path)
    serious = [f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE]
    found = balance_checks.evaluated(run.recording)
    if serious or found.balance is None:
        print(f"seed {seed}: {', '.join(serious)}")
    if found.balance is None:
        return "refused"
    true = amb_balance.left(rig, draw(rig, seed), run.recording.events("operator"))
    inside = True
    for name, values in ((BASE, true[0]), (found.last, true[-1])):
        kind = "found" if name == BASE else "left"
        for p in range(len(SIDES)):
            vector = found.balance.unbalance[name].one(p)
            away = 1e6 * abs(vector.values[0] - values[p])
            hits[f"{kind}, ellipse"].append((contains(vector, complex(values[p])), away, math.nan))
            for k, part in enumerate((values[p].real, values[p].imag)):
                e = found.balance.parts[name][2 * p + k]
                i = interval(e)
                hits[f"{kind}, component"].append((i.low <= part <= i.high, 1e6 * abs(e.value - part), 1e6 * i.U))
            inside &= name == BASE or abs(values[p]) <= found.balance.permissible[p].value
    if "not-reached" in serious:
        return "not reached"
    return f"reached after {found.last}" + ("" if inside else ", BUT IT IS NOT SO")


def main() -> None:
    """Print how the rigs ended, and a line for each quantity."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--positions", type=int, default=0)
    parser.add_argument("--leave", action="store_true")
    parser.add_argument("--minutes", type=float, default=math.inf, help="begin no rig after so long")
    chosen = parser.parse_args()
    plan = {**PLAN, "positions": chosen.positions, "leave": chosen.leave}
    hits: Hits = defaultdict(list)
    ends: Counter[str] = Counter()
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(chosen.first, chosen.first + chosen.count):
            if time.monotonic() - begin < 60 * chosen.minutes:
                ends[one(seed, plan, Path(folder), hits)] += 1
    print(f"{ends.total()} rigs: " + "; ".join(f"{n} {end}" for end, n in sorted(ends.items())))
    for name, some in hits.items():
        held, away, half = np.array(some).T
        far = float(np.quantile(away, 0.95))
        print(f"{name:18s} {held.mean():.3f} of {len(some)} hold the truth; 95 % of errors within {far:.3f} g mm; mean half "
              f"width over that {half.mean() / far:.2f}")  # fmt: skip


if __name__ == "__main__":
    main()
