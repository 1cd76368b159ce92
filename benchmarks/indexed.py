"""Speed of the index of runs: processor time of reading it with very many runs in it, and of making it from their records.

    python benchmarks/indexed.py FOLDER [--runs 100000] [--influences 4]

Writes the records as files into FOLDER where they are missing (a run of six quantities every six hours, on four rigs, by two
procedures), makes the index anew, then has `bench runs` and `bench trend` ask it, each in a process of its own, and beside
them the interpreter alone. Targets: 500 records/s, 0.5 s of processor time.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import resource
import subprocess
import sys
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

from bench.quantity import Quantity
from bench.record.outcomes import Outcome
from bench.record.records import correlations_of, measurement, to_json, unfinished
from bench.record.setup import Certified, Setup
from bench.run import index
from bench.rundir import stamp
from bench.uncertainty import Estimate, Influence

QUANTITIES = ("K_i", "K_o", "K2_i", "K2_o", "Kw_i", "Kw_o")
PROCEDURES = ("amb-calibration", "force-constant")
RIGS = ("stand-1", "stand-2", "stand-3", "stand-4")
VALUE = 73.015625
"""Stands in the text of the one record that the others are made of, where each has its own value."""


def text_of(influences: int) -> str:
    """A record with that many influences on each of its quantities."""
    gains = [Influence(f"sensors/i_{k}/gain", f"gain {k}", 1e-3, "1", "B", "rectangular") for k in range(influences)]
    estimate = Estimate(VALUE, "N/A", {gain: 50.0 + k for k, gain in enumerate(gains)})
    made = [Quantity(name, "N/A", "force constant").measured(estimate) for name in QUANTITIES]
    setup = Setup("ab" * 32, "protocol 1, map version 2", {"bias_i": 3.0}, {"K_i": "K@inboard", "K_o": "K@outboard"},
                  {g.id: Certified(1.0, g.u, g.unit, g.distribution, "SIM-1") for g in gains})  # fmt: skip
    start = unfinished(
        run_id="RUN", procedure="PROCEDURE", rig="RIG", uut={"model": "stand", "serial": "RIG"}, started="STARTED", seed=None,
        plan={"masses": ["M1", "M2"], "angles": 9}, versions={"levbench": "0.1.0"}, setup=setup,
    )  # fmt: skip
    return to_json(dataclasses.replace(
        start, outcome=Outcome.DONE, ended="STARTED", findings=(), measurements=tuple(measurement(m, None) for m in made),
        correlations=correlations_of(made),
    ))  # fmt: skip


def made(folder: Path, runs: int, influences: int) -> None:
    """The run directories with their records, those that are missing."""
    text = text_of(influences)
    for k in range(runs):
        at = datetime(2000, 1, 1, tzinfo=UTC) + timedelta(hours=6 * k)
        procedure, rig = PROCEDURES[k // 4 % 2], RIGS[k % 4]
        path = folder / f"{procedure}-{stamp(at)}-{k % 65536:04x}"
        if path.exists():
            continue
        path.mkdir(parents=True)
        own = {
            "RUN": path.name,
            "PROCEDURE": procedure,
            "RIG": rig,
            "STARTED": at.isoformat(),
            f"{VALUE}": f"{73 + k % 1009 / 7919}",
        }
        record = text
        for word, value in own.items():
            record = record.replace(word, value)
        (path / "record.json").write_text(record, encoding="utf-8")


def seconds_of(*arguments: str) -> float:
    """Processor seconds of the interpreter with these arguments."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> int:
    """Run and print; 1 when a target is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--runs", type=int, default=100_000)
    parser.add_argument("--influences", type=int, default=4)
    asked = parser.parse_args()
    made(asked.folder, asked.runs, asked.influences)
    start = time.process_time()
    index.rebuild(asked.folder)
    rate = asked.runs / (time.process_time() - start)
    out = ("--out", str(asked.folder))
    last, shown, as_json = ("--last", "20"), ("--show", "K_i"), ("--json",)
    of_one = ("--rig", RIGS[0], "--procedure", PROCEDURES[0])
    lines = {
        "all runs": ("runs", *out),
        "last 20 runs": ("runs", *out, *last, *shown),
        "all runs with a result": ("runs", *out, *shown),
        "all runs with two results": ("runs", *out, "--show", "K"),
        "all runs as JSON": ("runs", *out, *as_json),
        "all runs with a result as JSON": ("runs", *out, *as_json, *shown),
        "runs of a procedure": ("runs", *out, "--procedure", PROCEDURES[0]),
        "runs of a rig": ("runs", *out, "--rig", RIGS[0]),
        "failed runs": ("runs", *out, "--failed"),
        "trend": ("trend", "K_i", *out, *of_one),
        "trend as JSON": ("trend", "K_i", *out, *of_one, *as_json),
    }
    found = {name: min(seconds_of("-m", "levbench", *line) for _ in range(3)) for name, line in lines.items()}
    missed = rate < 500 or max(found.values()) > 0.5
    found |= {"records_per_s": rate, "interpreter": min(seconds_of("-c", "pass") for _ in range(3))}
    sys.stdout.write(json.dumps(found) + "\n")
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
