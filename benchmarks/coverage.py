"""Coverage over virtual rigs: how often 95 % intervals hold the truth, and whether they are padded (house rules below).

For each seed a rig is drawn, calibrated through the whole path (frames, recording, analysis) and compared with its truth.

    python benchmarks/coverage.py amb-calibration --runs 1000
    python benchmarks/coverage.py amb-calibration --runs 1000 --first-seed 1000000

Pass: for every judged quantity the share of hits lies within 0.95 +- 3.3 sqrt(0.95 0.05 / N), and the mean expanded
uncertainty is 0.8 to 1.25 of the 95th percentile of |error|. Recordings of rigs that miss stay in --keep.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")  # one process per core: library threads would fight over them

import numpy as np  # noqa: E402  (after the thread limits)

PLAN = {"settle_s": 0.5, "average_s": 0.3}
JUDGED = ("K_i", "K_o")


@dataclass(frozen=True)
class One:
    """One rig: errors, expanded uncertainties and interval bounds by quantity, and the outcome's findings."""

    seed: int
    error: dict[str, float]
    expanded: dict[str, float]
    hit: dict[str, bool]
    findings: tuple[str, ...]


def calibrate(procedure: str, seed: int, plan: dict[str, float], keep: str) -> One:
    """Calibrate one virtual rig."""
    from bench.cli.virtual import simulate
    from bench.findings import Finding
    from bench.uncertainty import interval

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recording.mcap"
        truth, results = simulate(procedure, "tsbs12", seed, plan, path)
        error, expanded, hit, findings = {}, {}, {}, []
        for item in results:
            if isinstance(item, Finding):
                findings.append(item.code)
                continue
            name, true = item.quantity.name, truth[item.quantity.name]
            bounds = interval(item.estimate, seed=seed)
            error[name] = item.estimate.value - true
            expanded[name] = (bounds.high - bounds.low) / 2
            hit[name] = bounds.low <= true <= bounds.high
        if keep and not all(hit.get(q, False) for q in JUDGED):
            Path(keep).mkdir(parents=True, exist_ok=True)
            path.replace(Path(keep) / f"{procedure}-{seed}.mcap")
    return One(seed, error, expanded, hit, tuple(findings))


def main() -> int:
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    p.add_argument("procedure")
    p.add_argument("--runs", type=int, default=1000)
    p.add_argument("--first-seed", type=int, default=0)
    p.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    p.add_argument("--keep", default="", help="folder for recordings of rigs that miss")
    a = p.parse_args()
    begun, done = time.monotonic(), []
    with ProcessPoolExecutor(a.jobs) as pool:
        seeds = range(a.first_seed, a.first_seed + a.runs)
        jobs = pool.map(calibrate, [a.procedure] * a.runs, seeds, [PLAN] * a.runs, [a.keep] * a.runs, chunksize=4)
        for one in jobs:
            done.append(one)
            if len(done) % 50 == 0:
                left = (time.monotonic() - begun) / len(done) * (a.runs - len(done))
                print(f"{len(done)}/{a.runs}, {left / 60:.1f} min left", file=sys.stderr, flush=True)
    return report(a.procedure, done, time.monotonic() - begun)


def report(procedure: str, done: list[One], seconds: float) -> int:
    """Print the table and one JSON line; 0 when the judged quantities are within the bands."""
    n = len(done)
    band = 3.3 * np.sqrt(0.95 * 0.05 / n)
    findings: dict[str, int] = {}
    for one in done:
        for code in set(one.findings):
            findings[code] = findings.get(code, 0) + 1
    print(f"{procedure}: {n} rigs from seed {done[0].seed}, {seconds / 60:.1f} min; findings {findings or 'none'}")
    print(f"coverage band {0.95 - band:.4f} .. {min(0.95 + band, 1):.4f}; width band 0.80 .. 1.25")
    rows, passed = {}, True
    for name in done[0].error:
        errors = np.array([abs(one.error[name]) for one in done if name in one.error])
        coverage = float(np.mean([one.hit.get(name, False) for one in done]))
        width = float(np.mean([one.expanded[name] for one in done if name in one.error]) / np.percentile(errors, 95))
        good = abs(coverage - 0.95) <= band and 0.8 <= width <= 1.25
        passed = passed and (good or name not in JUDGED)
        rows[name] = {"coverage": coverage, "width": width, "good": bool(good)}
        print(f"  {name:5} coverage {coverage:.4f}  width {width:.3f}  {'ok' if good else 'OUT'}")
    print(json.dumps({"procedure": procedure, "runs": n, "first_seed": done[0].seed, "seconds": seconds, **rows}))
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
