"""Does the interval of a difference hold? Pairs of runs of virtual rigs through the whole path of `bench run`, compared as
`bench compare` does.

    nice python benchmarks/compared.py visits FOLDER --count 1000
    nice python benchmarks/compared.py rigs FOLDER --count 1000

`visits`: one rig on two days, so that the true difference is nought: |E_n| > 1 is to happen in 5 % of the pairs. `rigs`: two
rigs, whose true difference is known: the interval is to hold it. The runs are short ones of amb-calibration, of a second or
two. A line of FOLDER/visits.jsonl or rigs.jsonl for each pair, so that a run that was stopped goes on; the runs are not kept.
"""

from __future__ import annotations

import argparse
import json
import logging
import math
import shutil
import sys
from pathlib import Path

from bench.cli.compose import Request, prepare
from bench.history.compare import Comparison, Side, compare
from bench.progress import Silent
from bench.run import runner
from bench.run.supervisor import Supervisor

PLANS = {"visits": ("angles=1", "settle_s=0.3", "average_s=0.2"), "rigs": ("angles=8", "settle_s=0.3", "average_s=0.2")}
"""At one angle the constant is that of a shaft as it stands: not the truth of a rig, but the same on both of its days."""
Truth = dict[str, float]


def measured(kind: str, folder: Path, seed: int, visit: int) -> tuple[Side, Truth]:
    """One run and the true quantities of its rig."""
    request = Request(
        procedure="amb-calibration", rig="tsbs12", seed=seed, visit=visit, plan=PLANS[kind], out=folder, report=False
    )
    job, connect = prepare(request)
    supervisor = Supervisor()
    with supervisor.watching() as watching:
        result = runner.run(job, folder, connect, watching, Silent(), None)
    truth = json.loads((result.directory / "truth.json").read_text(encoding="utf-8"))["quantities"]
    return Side(result.directory, result.record), truth


def pair(kind: str, folder: Path, seed: int) -> dict[str, object]:
    """What a pair has shown: of each quantity the difference, its uncertainty, the true one, and whether that was missed."""
    a, true_a = measured(kind, folder, seed, 0)
    b, true_b = measured(kind, folder, seed, 1) if kind == "visits" else measured(kind, folder, seed + 500_000, 0)
    sound = [side.record.outcome.value for side in (a, b)]
    found = compare(a, b)
    for side in (a, b):
        shutil.rmtree(side.path)
    return {"seed": seed, "outcomes": sound, "differences": _told(found, true_a, true_b)}


def _told(found: Comparison, true_a: Truth, true_b: Truth) -> dict[str, object]:
    out: dict[str, object] = {}
    for d in found.differences:
        true = true_b[d.name] - true_a[d.name]
        out[d.name] = {"d": d.value, "U": d.U, "true": true, "missed": not d.low <= true <= d.high, "removed": d.removed,
                       "dof": d.dof, "method": d.method, "U_a": d.a.expanded_uncertainty}  # fmt: skip
    return out


def shown(path: Path) -> int:
    """The shares of a journal; 1 where one leaves its band, 0.05 within 3.3 standard deviations of a share of so many."""
    pairs = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    band = 3.3 * math.sqrt(0.05 * 0.95 / len(pairs))
    sys.stdout.write(f"{len(pairs)} pairs; 0.05 within {max(0.0, 0.05 - band):.3f} to {0.05 + band:.3f}\n")
    outside = 0
    for name in pairs[0]["differences"]:
        rows = [p["differences"][name] for p in pairs if name in p["differences"]]
        missed = sum(r["missed"] for r in rows) / len(rows)
        rms = math.sqrt(sum(((r["d"] - r["true"]) / r["U"]) ** 2 for r in rows) / len(rows))
        removed = sum(r["removed"] for r in rows) / len(rows)
        ratio = sum(r["U"] / r["U_a"] for r in rows) / len(rows)
        outside += abs(missed - 0.05) > band
        sys.stdout.write(f"{name:6} {missed:.3f}  rms of the error/U {rms:.3f}  U of the difference/U {ratio:.3f}  "
                         f"variance removed {removed:.4f}\n")  # fmt: skip
    return int(outside > 0)


def main() -> int:
    """Run what is missing, then print; 1 when a share leaves its band."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kind", choices=("visits", "rigs"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--first-seed", type=int, default=0)
    asked = parser.parse_args()
    logging.disable(logging.INFO)
    asked.folder.mkdir(parents=True, exist_ok=True)
    journal = asked.folder / f"{asked.kind}.jsonl"
    lines = journal.read_text(encoding="utf-8").splitlines() if journal.exists() else []
    done = {json.loads(line)["seed"] for line in lines}
    for seed in range(asked.first_seed, asked.first_seed + asked.count):
        if seed not in done:
            line = json.dumps(pair(asked.kind, asked.folder / "runs", seed))
            with journal.open("a", encoding="utf-8") as file:
                file.write(line + "\n")
    return shown(journal)


if __name__ == "__main__":
    sys.exit(main())
