"""Recordings and calibrations of an older commit, read by this one: does what was measured then still say the same?

    python benchmarks/former_recordings.py 937c3b9
    python benchmarks/former_recordings.py 937c3b9 --only step --seed 7 --keep /tmp/former

The commit is checked out into a folder of its own. There every procedure is run with the short plan of planted/, on the virtual
rig of a seed, after the calibrations that it needs have been made and adopted there. This commit analyses each recording (with
the calibrations in it), and looks at each adopted file as `bench run` would. Told of each procedure: outcome then and now, how
many results are the same bit for bit, how far the others moved in units of their U, and findings that only one of both has.
Status 1 where a recording cannot be analysed, or a calibration is not taken.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from bench.calibration.file import read
from bench.calibration.lookup import Lookup
from bench.calibration.store import Store
from bench.cli.loading import load_procedure
from bench.errors import ConfigError
from bench.rigfile import load_rig
from benchmarks import golden

LIKE = 1e-9  # of a result's U: rounding
Result = tuple[str, str]


@dataclass(frozen=True)
class Compared:
    """Of one recording: `lines` to print, whether it was `read` at all."""

    lines: tuple[str, ...]
    read: bool


def main() -> int:
    """Make, analyse, compare; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", action="append", default=[], metavar="PROCEDURE")
    parser.add_argument("--keep", type=Path, help="where the recordings stay; by default nothing is kept")
    asked = parser.parse_args()
    names = asked.only or golden.planned_procedures()
    failed = False
    with tempfile.TemporaryDirectory() as scratch:
        old = (asked.keep or Path(scratch)).resolve() / "old"
        tree = old if old.is_dir() else golden.checked_out(old, asked.old)
        for name in names:
            if not list((tree / "procedures").glob(f"{name.replace('-', '_')}*")):
                print(f"{name}: not in that commit", flush=True)
                continue
            found = compared(name, tree, asked.seed)
            failed |= not found.read
            print(*found.lines, sep="\n  ", flush=True)
    return int(failed)


def compared(procedure: str, tree: Path, seed: int) -> Compared:
    """A recording of that commit, analysed by this one."""
    told = tomllib.loads((golden.PLANTED / f"{procedure}.toml").read_text(encoding="utf-8"))
    folder = tree / "runs" / procedure / "calibrations"
    common = ["--rig", told["rig"], "--calibrations", str(folder)]
    for name, plan in told.get("chain", {}).items():
        golden.bench(tree, ["adopt", str(golden.ran(tree, name, plan, seed, common)), *common])
    run = golden.ran(tree, procedure, told.get("plan", ()), seed, common)
    refused = list(not_taken(told["rig"], folder, seed))
    words = [sys.executable, "-m", "bench.cli", "analyse", str(run)]
    done = subprocess.run(words, cwd=golden.ROOT, text=True, capture_output=True)
    analyses = sorted((run / "analyses").glob("*/record.json"))
    if not analyses:
        return Compared((f"{procedure}: NOT ANALYSED", *done.stderr.splitlines()[-3:], *refused), read=False)
    then, now = golden.record(run), golden.record(analyses[-1].parent)
    return Compared((f"{procedure}: {summary(then, now)}", *differing(then, now), *refused), read=not refused)


def not_taken(rig: str, folder: Path, seed: int) -> Iterator[str]:
    """What a run would say of the adopted calibrations, on the day on which they were made."""
    file = load_rig(rig)
    store = Store.of(file, seed, folder)
    for path in store.current_files():
        try:
            c = read(path)
            lookup = Lookup(store, file, datetime.fromisoformat(c.date), lambda need: need.procedure)
            lookup.found("run", [need for need in _needs() if need.procedure == c.procedure])
        except ConfigError as error:
            yield f"calibration not taken: {error}"


def _needs() -> Iterator[object]:
    for name in golden.planned_procedures():
        procedure = load_procedure(name)
        yield from procedure.needs(procedure.plan())


def results(record: golden.Numbers) -> dict[Result, golden.Numbers]:
    """Measurements by name and place."""
    return {(m["name"], m["where"]): m for m in record["measurements"]}


def summary(then: golden.Numbers, now: golden.Numbers) -> str:
    """In a line."""
    a, b = results(then), results(now)
    same = sum(m["value"] == b[key]["value"] for key, m in a.items() if key in b)
    outcome = then["outcome"] if then["outcome"] == now["outcome"] else f"{then['outcome']} -> {now['outcome']}"
    return f"{outcome}, {same} of {len(a)} values equal"


def differing(then: golden.Numbers, now: golden.Numbers) -> Iterator[str]:
    """A line for each result that moved or is in one alone, the ratios of U, and the findings of one alone."""
    a, b = results(then), results(now)
    ratios = []
    for key in {**a, **b}:
        name = "@".join(filter(None, key))
        one, other = a.get(key), b.get(key)
        if one is None or other is None:
            yield f"{name}: only {'now' if one is None else 'then'}"
        elif one["value"] != other["value"] and None not in (one["value"], other["value"]):
            moved = (other["value"] - one["value"]) / (one["expanded_uncertainty"] or float("nan"))
            if not abs(moved) < LIKE:
                yield f"{name}: {one['value']:.9g} -> {other['value']:.9g}, {moved:+.3g} U"
        elif one["value"] != other["value"]:
            yield f"{name}: {one['value']} -> {other['value']}"
        if one and other and one["expanded_uncertainty"] and other["expanded_uncertainty"]:
            ratios.append(other["expanded_uncertainty"] / one["expanded_uncertainty"])
    if ratios and (min(ratios) < 1 - LIKE or max(ratios) > 1 + LIKE):
        yield f"U now over U then: {min(ratios):.6g} to {max(ratios):.6g}"
    codes = [{f["code"] for f in record["findings"]} for record in (then, now)]
    yield from (f"finding only then: {code}" for code in sorted(codes[0] - codes[1]))
    yield from (f"finding only now: {code}" for code in sorted(codes[1] - codes[0]))


if __name__ == "__main__":
    sys.exit(main())
