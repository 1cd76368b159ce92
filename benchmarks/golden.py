"""The numbers of two commits beside each other, bit for bit: a short plan of every procedure on the virtual rig of seed 1.

    python benchmarks/golden.py OLD NEW
    python benchmarks/golden.py OLD NEW --only step --seed 7

Both are checked out into a folder of their own and run by this interpreter: results with their budgets, correlations,
findings, and every message of the recordings (raw frames, samples, captures, events). NEW also analyses the recordings of OLD.
The plans are those of planted/; calibrations that a procedure needs are made by OLD. The order of sets is another in OLD than
in NEW, so that no number may depend on it. Status 0 where all is equal, 1 with what differs; nothing is kept.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import zip_longest
from pathlib import Path
from typing import Any

from mcap.reader import make_reader

from bench.catalogue import PROCEDURES

ROOT = Path(__file__).resolve().parents[1]
PLANTED = ROOT / "benchmarks" / "planted"
OF_THE_RUN = (
    "run_id",
    "started",
    "ended",
    "visit",
    "versions",
    "recording",
    "calibrations",
)  # which run it was, not what it found
HASHED = {"old": "1", "new": "2"}
Numbers = dict[str, Any]


def main() -> int:
    """Run both, compare; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old")
    parser.add_argument("new")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", action="append", default=[], metavar="PROCEDURE")
    parser.add_argument("--jobs", type=int, default=2)
    asked = parser.parse_args()
    names = asked.only or planned_procedures()
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(asked.jobs) as workers:
        old, new = (checked_out(Path(folder) / k, c) for k, c in (("old", asked.old), ("new", asked.new)))
        jobs = {name: workers.submit(beside, name, asked.seed, old, new) for name in names}
        different = 0
        for name, job in jobs.items():
            lines = job.result()
            different += bool(lines)
            print(f"{name}: {'equal' if not lines else 'differs'}", *lines, sep="\n  ", flush=True)
    print(f"{len(names) - different} of {len(names)} procedures equal")
    return int(different > 0)


def planned_procedures() -> list[str]:
    """Those that have a short plan; other files of planted/ are of further rigs."""
    known = {entry.name for entry in PROCEDURES}
    return sorted(p.stem for p in PLANTED.glob("*.toml") if p.stem in known)


def checked_out(path: Path, commit: str) -> Path:
    """A clone of this repository at a commit, its core built."""
    named = ["git", "-C", str(ROOT), "rev-parse", "--verify", f"{commit}^{{commit}}"]  # a clone knows no other branches
    digest = subprocess.run(named, check=True, text=True, stdout=subprocess.PIPE).stdout.strip()
    subprocess.run(["git", "clone", "-q", "--shared", str(ROOT), str(path)], check=True)
    subprocess.run(["git", "-C", str(path), "checkout", "-q", "--detach", digest], check=True)
    bench(path, ["list"])
    return path


def bench(tree: Path, words: Sequence[str]) -> str:
    """A command of the checked out commit; the last line that it prints. A status other than 0 is a result like another."""
    env = os.environ | {"PYTHONPATH": str(tree), "PYTHONHASHSEED": HASHED[tree.name]}
    env |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-m", "bench.cli", *words], cwd=tree, env=env, text=True, capture_output=True
    )
    lines = done.stdout.splitlines()
    if not lines:
        raise SystemExit(f"bench {' '.join(words)}: status {done.returncode}\n{done.stderr}")
    return lines[-1]


def beside(procedure: str, seed: int, old: Path, new: Path) -> list[str]:
    """What differs between the two for a procedure, and where NEW finds other numbers in a recording of OLD."""
    told = tomllib.loads((PLANTED / f"{procedure}.toml").read_text(encoding="utf-8"))
    common = ["--rig", told["rig"], "--calibrations", str(old / "runs" / procedure / "calibrations")]
    for name, plan in told.get("chain", {}).items():
        bench(old, ["adopt", str(ran(old, name, plan, seed, common)), *common])
    before, after = (ran(tree, procedure, told.get("plan", ()), seed, common) for tree in (old, new))
    lines = [*differences(record(before), record(after)), *differences(messages(before), messages(after))]
    bench(new, ["analyse", str(before)])
    again = next((before / "analyses").iterdir())
    return lines + [f"analysed again: {line}" for line in differences(record(before), record(again))]


def ran(tree: Path, procedure: str, plan: Sequence[str], seed: int, common: Sequence[str]) -> Path:
    """The folder of a run."""
    settings = [word for text in plan for word in ("--plan", text)]
    return tree / bench(tree, ["run", procedure, "--seed", str(seed), "--no-report", *settings, *common])


def record(run: Path) -> Numbers:
    """What a run found."""
    found: Numbers = json.loads((run / "record.json").read_text(encoding="utf-8"))
    return {name: value for name, value in found.items() if name not in OF_THE_RUN}


def messages(run: Path) -> Numbers:
    """By topic: how many messages, and a digest of all of them with their times."""
    digests: dict[str, Any] = {}
    counts: dict[str, int] = {}
    with (run / "recording.mcap").open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages(log_time_order=False):
            digest = digests.setdefault(channel.topic, hashlib.sha256())
            digest.update(message.log_time.to_bytes(8, "little") + message.data)
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
    return {topic: [counts[topic], digest.hexdigest()[:16]] for topic, digest in digests.items()}


def differences(old: Any, new: Any, where: str = "") -> Iterator[str]:
    """A line for each place where they are not the same."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in old | new:
            yield from differences(old.get(key), new.get(key), f"{where}/{key}")
    elif isinstance(old, list) and isinstance(new, list):
        for k, (a, b) in enumerate(zip_longest(old, new)):
            name = next((x["name"] for x in (a, b) if isinstance(x, dict) and "name" in x), k)
            yield from differences(a, b, f"{where}/{name}")
    elif old != new:
        yield f"{where}: {old!r} -> {new!r}"


if __name__ == "__main__":
    sys.exit(main())
