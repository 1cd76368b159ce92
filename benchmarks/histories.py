"""Do the control charts of `bench trend` signal as often as their theory says, on histories that runs make?

    python -m benchmarks.histories FOLDER --histories 20

Each history is one virtual machine on successive visits: a baseline, then runs of the machine as it is (false alarms), and
beside them runs of one whose force constant moves by one u with each (detection), u being what a run's budget has of its own
scatter. The same command goes on where it was stopped. Recordings are deleted, records stay. A run takes about a second of
processor time.
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.stats import binom

from bench.cli.__main__ import main as bench
from bench.history.charts import individuals
from bench.history.runlength import no_signal
from bench.history.series import one_history
from bench.history.trend import BASELINE, WEIGHT, Trend, trend
from bench.run import index

RIG, PROCEDURE, QUANTITY = "tsbs12", "amb-calibration", "K_i"
PLAN = ("angles=1", "settle_s=0.3", "average_s=0.2")  # three rounds of the masses at one angle
STILL, DRIFTING = 12, 8  # runs after the baseline
CHARTS = {"individuals": 1.0, "EWMA": WEIGHT}


def make(folder: Path, seed: int) -> None:
    """The runs of one history that are not there yet."""
    still, drifting = folder / f"{seed:03}-still", folder / f"{seed:03}-drifting"
    for visit in range(1, BASELINE + STILL + 1):
        _run(still, seed, visit)
    first = [p for p in sorted(still.iterdir()) if (p / "record.json").is_file() and _record(p)["visit"] <= BASELINE]
    for path in first:
        if not (drifting / path.name).is_dir():
            shutil.copytree(path, drifting / path.name)
    true, u = json.loads((still / "truth.json").read_text())["quantities"][QUANTITY], own_u(first)
    for k in range(1, DRIFTING + 1):
        _run(drifting, seed, BASELINE + k, f"{QUANTITY}={true + k * u!r}")


def own_u(paths: Sequence[Path]) -> float:
    """What the budgets have of Type A, root of the mean square over some runs."""
    found = [m for p in paths for m in _record(p)["measurements"] if m["name"] == QUANTITY]
    return math.sqrt(np.mean([sum(e["contribution"] ** 2 for e in m["budget"] if e["type"] == "A") for m in found]))


def _run(folder: Path, seed: int, visit: int, truth: str = "") -> None:
    """One run, of which the record stays; the truth of the machine as it is lies beside them."""
    there = {_record(p)["visit"] for p in folder.glob("*/") if (p / "record.json").is_file() and _record(p)["ended"]}
    if visit in there:
        return
    plan = [x for setting in PLAN for x in ("--plan", setting)]
    asked = [
        "run",
        PROCEDURE,
        "--rig",
        RIG,
        "--seed",
        str(seed),
        "--visit",
        str(visit),
        "--no-report",
        "--out",
        str(folder),
    ]
    status = bench([*asked, *plan, *(("--truth", truth) if truth else ())])
    made = max((p for p in folder.glob("*/")), key=lambda p: p.stat().st_mtime_ns)
    if status:
        raise SystemExit(f"{made}: status {status}")
    if not truth:
        (made / "truth.json").replace(folder / "truth.json")
    for path in made.iterdir():
        if path.name != "record.json":
            path.unlink()


def _record(path: Path) -> dict[str, object]:
    found: dict[str, object] = json.loads((path / "record.json").read_text())
    return found


def followed(folder: Path) -> Trend:
    """The trend of a history."""
    return trend(one_history(index.results(folder, quantity=QUANTITY), QUANTITY, list, str(folder)))


def first_signal(found: Trend, chart: str) -> int | None:
    """How many runs after the baseline it took; None without a signal."""
    (segment,) = found.segments
    return next((g.at - BASELINE + 1 for g in segment.signals if g.chart == chart), None)


def report(folder: Path, seeds: range) -> None:
    """Signals found and expected, with the 99 % band of so many histories."""
    still = [followed(folder / f"{seed:03}-still") for seed in seeds]
    drifting = [followed(folder / f"{seed:03}-drifting") for seed in seeds]
    scatter = math.sqrt(np.mean([np.var(t.segments[0].values, ddof=1) for t in still]))
    u = math.sqrt(np.mean([own_u([r.path for r in t.segments[0].results[:BASELINE]]) ** 2 for t in still]))
    ranges = np.mean([individuals(t.segments[0].values).sigma for t in still])
    print(f"{len(still)} histories; standard deviation of a machine's runs {scatter:.4f} N/A (moving range {ranges:.4f}), "
          f"their own u {u:.4f} N/A, the drift per run {u / scatter:.2f} standard deviations")  # fmt: skip
    for chart, weight in CHARTS.items():
        for name, made, runs, slope in (("still", still, STILL, 0.0), ("drifting", drifting, DRIFTING, u / scatter)):
            left = no_signal([slope * k for k in range(1, runs + 1)], weight, BASELINE)
            lengths = [first_signal(t, chart) for t in made]
            for within in sorted({3, 5, runs}):
                p, n = 1 - left[within - 1], len(made)
                seen = sum(k is not None and k <= within for k in lengths)
                low, high = binom.interval(0.99, n, p)
                print(f"{chart:12} {name:9} a signal within {within:2} runs: {seen:3} of {n}, expected {n * p:.1f}, 99 % band "
                      f"{low:.0f} to {high:.0f}{'' if low <= seen <= high else '   OUTSIDE'}")  # fmt: skip


def main() -> None:
    """Make what is missing, then report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--histories", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, metavar="SEED")
    asked = parser.parse_args()
    seeds = range(asked.first, asked.first + asked.histories)
    for seed in seeds:
        for kind in ("still", "drifting"):
            (asked.folder / f"{seed:03}-{kind}").mkdir(parents=True, exist_ok=True)
        make(asked.folder, seed)
    report(asked.folder, seeds)


if __name__ == "__main__":
    main()
