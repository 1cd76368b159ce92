"""Planted defects by size: from which size on a procedure says that something is wrong, and how far a smaller one shifts it.

    nohup python benchmarks/plants.py spindown step --seeds 60 --folder plants &
    python benchmarks/plants.py spindown --folder plants --table

Every run is that of `bench run`, with the short plan of plants.toml. What is done is appended to FOLDER/PROCEDURE.jsonl; the
same command goes on from there. Caught is a run with a finding above a note, or one that ended before it had results; a shift
is that of a quiet run's results against the same rig without the plant, in the latter's U.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import tempfile
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.cli.adopt import adopt
from bench.cli.compose import Request
from bench.cli.run import execute
from bench.errors import BenchError
from bench.findings import Effect
from bench.records import Outcome

SURE = 0.95  # of the seeds
STOPPED = (Outcome.ERROR, Outcome.ABORTED)
Line = dict[str, Any]


@dataclass(frozen=True)
class Plant:
    """A value `size` of the truth's `name`, with what else it needs; no name: the sound rig under that plan."""

    name: str
    size: float
    plan: tuple[str, ...] = ()
    truth: tuple[str, ...] = ()

    @property
    def sound(self) -> Plant:
        """The same without what is planted."""
        return Plant("", 0.0, self.plan, self.truth)

    def key(self, seed: int) -> str:
        """By which a line is found again."""
        return json.dumps([self.name, self.size, self.plan, self.truth, seed])


def plants_of(section: Mapping[str, Any]) -> list[Plant]:
    """Every plant of a procedure, in the file's order."""
    return [
        Plant(p["name"], float(size), tuple(p.get("plan", ())), tuple(p.get("truth", ())))
        for p in section["plant"] for size in p["sizes"]
    ]  # fmt: skip


def run_one(procedure: str, section: Mapping[str, Any], plant: Plant, seed: int) -> Line:
    """One run: its outcome, the findings above a note, and value and U by `name@where`."""
    rig, truth = section["rig"], (*plant.truth, *((f"{plant.name}={plant.size!r}",) if plant.name else ()))
    with tempfile.TemporaryDirectory() as folder:
        out, calibrations = Path(folder) / "runs", Path(folder) / "calibrations"
        try:
            for before in section.get("chain", ()):
                done = execute(Request(before, rig, seed=seed, out=out, report=False, calibrations=calibrations))
                adopt(done.directory, calibrations=calibrations, anyway=True)
            request = Request(procedure, rig, seed=seed, plan=(*section["plan"], *plant.plan), truth=truth, out=out,
                              report=False, calibrations=calibrations)  # fmt: skip
            record = execute(request).record
        except BenchError as error:
            return {"outcome": Outcome.ERROR.value, "codes": [str(error)[:80]], "values": {}}
    values = {
        f"{m.name}@{m.where}": [m.value, m.expanded_uncertainty] for m in record.measurements if m.value is not None
    }
    codes = sorted({f.code for f in record.findings if f.effect is not Effect.NOTE})
    return {"outcome": record.outcome.value, "codes": codes, "values": values}


def done_before(path: Path) -> dict[str, Line]:
    """Lines of a file by their keys; half a line, of a run that was killed, is none."""
    out = {}
    for text in path.read_text().splitlines() if path.is_file() else ():
        with contextlib.suppress(json.JSONDecodeError):
            line = json.loads(text)
            out[line["key"]] = line
    return out


def run_all(procedure: str, section: Mapping[str, Any], seeds: Sequence[int], path: Path) -> None:
    """Seed by seed, the sound rig first; what is in the file is left out."""
    known, planted = done_before(path), plants_of(section)
    todo = list(dict.fromkeys([*(p.sound for p in planted), *planted]))
    path.parent.mkdir(parents=True, exist_ok=True)
    for seed in seeds:
        for plant in todo:
            key = plant.key(seed)
            if key in known:
                continue
            with open(os.devnull, "w") as nowhere, contextlib.redirect_stderr(nowhere):
                line = run_one(procedure, section, plant, seed)
            if "signal" in line["codes"]:  # the run was stopped with this script: it says nothing, and is done again
                return
            with path.open("a") as file:
                file.write(
                    json.dumps({"key": key, "plant": plant.name, "size": plant.size, "seed": seed, **line}) + "\n"
                )


def caught(line: Line) -> bool:
    """A finding above a note, or no results."""
    return bool(line["codes"]) or line["outcome"] in [o.value for o in STOPPED]


def shift(line: Line, sound: Line) -> tuple[float, str]:
    """The greatest of a quiet run's results against the sound one's, in U, and which it is."""
    both = [k for k in line["values"] if k in sound["values"] and sound["values"][k][1]]
    moved = [(abs(line["values"][k][0] - sound["values"][k][0]) / sound["values"][k][1], k) for k in both]
    return max(moved, default=(0.0, ""))


def rows(section: Mapping[str, Any], known: Mapping[str, Line]) -> Iterator[str]:
    """The table's lines: each size's share of seeds that are caught, and what the quiet ones are shifted by."""
    yield "| plant | size: caught | smallest caught | largest quiet shift |"
    yield "|---|---|---|---|"
    seeds = sorted({line["seed"] for line in known.values()})
    by_name: dict[str, list[Plant]] = {}
    for plant in plants_of(section):
        by_name.setdefault(plant.name, []).append(plant)
    units = {p["name"]: "" if p["unit"] == "1" else f" {p['unit']}" for p in section["plant"]}
    for name, sizes in by_name.items():
        shares, smallest, worst = [], "none", (0.0, "", 0.0)
        for plant in sizes:
            lines = [(known[plant.key(s)], known.get(plant.sound.key(s))) for s in seeds if plant.key(s) in known]
            if not lines:
                continue
            share = sum(caught(line) for line, _ in lines) / len(lines)
            shares.append(f"{plant.size:g}: {share:.0%}")
            smallest = (
                smallest if share >= SURE and smallest != "none" else f"{plant.size:g}" if share >= SURE else "none"
            )
            quiet = [shift(a, b) for a, b in lines if b is not None and not caught(a) and not caught(b)]
            worst = max([worst, *((by, what, plant.size) for by, what in quiet)])
        text = (
            f"{worst[0]:.1f} U ({worst[1].rstrip('@').replace('@', ', ')}, {worst[2]:g})" if worst[1] else "none quiet"
        )
        yield f"| `{name}`{units[name]} | {', '.join(shares)} | {smallest} | {text} |"


def main() -> None:
    """Run, or print the tables of what was run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("procedures", nargs="+")
    parser.add_argument("--seeds", type=int, default=60)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--folder", type=Path, default=Path("plants"))
    parser.add_argument("--table", action="store_true", help="print what is there, run nothing")
    args = parser.parse_args()
    known = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
    for procedure in args.procedures:
        path = args.folder / f"{procedure}.jsonl"
        if not args.table:
            run_all(procedure, known[procedure], range(args.first, args.first + args.seeds), path)
        lines = done_before(path)
        many, sound = len({line["seed"] for line in lines.values()}), [x for x in lines.values() if not x["plant"]]
        loud = sum(map(caught, sound))
        print(f"{procedure}: {many} seeds, {loud} of {len(sound)} sound runs with a finding", end="\n\n")
        print("\n".join(rows(known[procedure], lines)), end="\n\n")


if __name__ == "__main__":
    main()
