"""Planted defects by size: from which size on a procedure says that something is wrong, and how far a smaller one shifts it.

    nohup python benchmarks/plants.py spindown step --seeds 20 --jobs 2 &
    python benchmarks/plants.py spindown --table

What is planted in PROCEDURE, and the short plan that it runs with, is in planted/PROCEDURE.toml; a run is that of `bench run`.
A file for another rig has a name of its own and says which `procedure` it is for, as planted/spindle-step.toml does.
Each size is tried on a few seeds first; then the sizes that may be the smallest one caught go on to all seeds. What is done is
appended to FOLDER/PROCEDURE.jsonl, and the same command goes on from there. Caught is a run with a finding above a note, one
that ended early, or one that lacks a result it declares. A shift is the error (value less truth) of a quiet run less that of
the same rig without the plant, in the latter's U: what a plant truly changes is no error. Of a procedure that has no truth the
values themselves are taken, unless the plant `changes` what is measured. Beside it stands that result's error in the U that the
run itself states.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.calibration import Calibration
from bench.cli.campaign.fleet import pool
from bench.cli.compose import load_procedure
from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, flown
from bench.errors import BenchError
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.procedure.plans import assemble
from bench.rigfile import load_rig
from bench.uncertainty import interval

SURE = 0.95  # of the seeds
FEW = 10  # seeds that every size is tried on, where nobody says
PLANTED = Path(__file__).with_name("planted")
Line = dict[str, Any]


@dataclass(frozen=True)
class Plant:
    """A value `size` of the truth's `name`, with what else it needs; no name: the sound rig under that plan."""

    name: str
    size: float
    plan: tuple[str, ...] = ()
    truth: tuple[str, ...] = ()
    says: str = ""  # of it, beside its name
    changes: bool = False  # what is measured, so that a value without a truth says nothing

    @property
    def sound(self) -> Plant:
        """The same without what is planted."""
        return Plant("", 0.0, self.plan, self.truth)

    @property
    def overrides(self) -> dict[str, float]:
        """What is told to the simulator's truth."""
        told = {name: float(value) for name, value in (text.split("=") for text in self.truth)}
        return told | ({self.name: self.size} if self.name else {})

    def key(self, seed: int) -> str:
        """By which a line is found again."""
        return json.dumps([self.name, self.size, self.plan, self.truth, seed])


@dataclass(frozen=True)
class Bed:
    """What a procedure's plants are planted in: rig, short plan, and the procedures before it with theirs."""

    procedure: str
    rig: str
    plan: tuple[str, ...]
    chain: Mapping[str, Sequence[str]]
    plants: tuple[tuple[Plant, ...], ...]  # by defect, from harmless to gross
    units: Mapping[str, str]


def bed_of(name: str) -> Bed:
    """Read from its file, which is called as its procedure is, or says which that is."""
    found = tomllib.loads((PLANTED / f"{name}.toml").read_text(encoding="utf-8"))
    plants = tuple(
        tuple(
            Plant(p["name"], float(s), tuple(p.get("plan", ())), tuple(p.get("truth", ())), p.get("says", ""),
                  p.get("changes", False))
            for s in p["sizes"]
        )
        for p in found["plant"]
    )  # fmt: skip
    units = {p["name"]: "" if p["unit"] == "1" else f" {p['unit']}" for p in found["plant"]}
    return Bed(
        found.get("procedure", name), found["rig"], tuple(found.get("plan", ())), found.get("chain", {}), plants, units
    )


def fly(bed: Bed, procedure: str, plan: Sequence[str], seed: int, truth: Mapping[str, float],
        known: Mapping[str, Calibration], folder: Path) -> Simulated | Line:  # fmt: skip
    """A run, or the line of one that ended early.

    Raises:
        ConfigError: the plan, the truth or the chain cannot be used.
    """
    path = folder / "recording.mcap"
    path.unlink(missing_ok=True)
    rig = load_rig(bed.rig)
    settings = assemble(load_procedure(procedure).plan, (rig.name, rig.plans.get(procedure, {})), None, plan)
    done = flown(procedure, bed.rig, seed, settings.model_dump(exclude_unset=True), path, truth, known)
    if done.machine.cause is None:
        try:
            return done.analysed()
        except BenchError as error:
            return {"codes": [type(error).__name__], "values": {}}
    if not isinstance(done.machine.cause, BenchError):
        raise done.machine.cause
    codes = sorted({f.code for f in done.machine.ending.findings if f.effect is not Effect.NOTE})
    return {"codes": codes or [type(done.machine.cause).__name__], "values": {}}


def run_seed(bed: Bed, seed: int, todo: Sequence[Plant]) -> list[Line]:
    """The plants on one rig: codes of the findings above a note, and error and U by `name@where`."""
    known: dict[str, Calibration] = {}
    out = []
    with tempfile.TemporaryDirectory() as folder:
        for before, plan in bed.chain.items():
            done = fly(bed, before, plan, seed, {}, known, Path(folder))
            if not isinstance(done, Simulated):
                raise BenchError(f"{before} on the sound rig of seed {seed}: {', '.join(done['codes'])}")
            known[before] = done.calibration()
        for plant in todo:
            done = fly(bed, bed.procedure, (*bed.plan, *plant.plan), seed, plant.overrides, known, Path(folder))
            line = line_of(done) if isinstance(done, Simulated) else done
            out.append({"key": plant.key(seed), "plant": plant.name, "size": plant.size, "seed": seed, **line})
    return out


def line_of(done: Simulated) -> Line:
    """What a run that reached its end is noted with."""
    measured = [r for r in done.results if isinstance(r, Measured)]
    codes = {r.code for r in done.results if isinstance(r, Finding) and r.effect is not Effect.NOTE}
    lacking = {q.name for q in done.procedure.measures if q not in done.procedure.optional}
    codes |= {f"no {name}" for name in lacking - {m.quantity.name for m in measured}}
    if codes:  # no shift is asked of it, and its truth may take longer than the run
        return {"codes": sorted(codes), "values": {}}
    truth = {**done.truth, **truth_of_motion(done)}
    values: dict[str, list[float | None]] = {}
    for m in measured:
        name, U = f"{m.quantity.name}@{m.where}", interval(m.estimate, done.seed).U
        true = truth.get(name, truth.get(m.quantity.name))
        if true is not None:
            values[name] = [m.estimate.value - true, U]
    if not values:
        values = {
            f"{m.quantity.name}@{m.where}": [m.estimate.value, interval(m.estimate, done.seed).U, None]
            for m in measured
        }
    return {"codes": sorted(codes), "values": values}


def read(path: Path) -> dict[str, Line]:
    """Lines of a file by their keys; half a line, of a run that was killed, is none."""
    lines = path.read_text(encoding="utf-8").split("\n")[:-1] if path.is_file() else []
    return {line["key"]: line for line in map(json.loads, lines)}


def run_all(bed: Bed, seeds: Sequence[int], few: int, path: Path, workers: Executor) -> None:
    """Every size on the first `few` seeds, then what may be the smallest one caught on the others."""
    path.parent.mkdir(parents=True, exist_ok=True)
    everything = [p for sizes in bed.plants for p in sizes]
    do(bed, seeds[:few], everything, path, workers)
    for start in range(few, len(seeds), few):
        do(bed, seeds[start : start + few], edges(bed, len(seeds), read(path)), path, workers)


def edges(bed: Bed, many: int, known: Mapping[str, Line]) -> list[Plant]:
    """Of each defect the smallest size that may still prove to be caught."""
    allowed = int((1 - SURE) * many + 1e-9)
    quiet = {(line["plant"], line["size"]): 0 for line in known.values()}
    for line in known.values():
        quiet[line["plant"], line["size"]] += not line["codes"]
    found = (next((p for p in sizes if quiet[p.name, p.size] <= allowed), None) for sizes in bed.plants)
    return [p for p in found if p is not None]


def do(bed: Bed, seeds: Sequence[int], plants: Sequence[Plant], path: Path, workers: Executor) -> None:
    """What the file lacks, the sound rig first; a seed is a job."""
    known, wanted = read(path), list(dict.fromkeys([*(p.sound for p in plants), *plants]))
    left = {seed: [p for p in wanted if p.key(seed) not in known] for seed in seeds}
    for job in [workers.submit(run_seed, bed, seed, todo) for seed, todo in left.items() if todo]:
        with path.open("a", encoding="utf-8") as file:
            file.writelines(json.dumps(line) + "\n" for line in job.result())


def shift(line: Line, sound: Line, changes: bool) -> tuple[float, float, str]:
    """The greatest of a quiet run's errors against the sound one's, in U of that, then its error in its own U (NaN without a
    truth), and which result it is."""
    new, old = line["values"], sound["values"]
    both = [k for k in new if k in old and old[k][1] and new[k][1] and len(new[k]) == len(old[k])]
    both = [k for k in both if not (changes and len(new[k]) > 2)]
    own = {k: abs(new[k][0]) / new[k][1] if len(new[k]) == 2 else math.nan for k in both}
    moved = [(abs(new[k][0] - old[k][0]) / old[k][1], own[k], k) for k in both]
    return max(moved, default=(0.0, 0.0, ""))


def rows(bed: Bed, known: Mapping[str, Line]) -> Iterator[str]:
    """The table's lines: how many of the seeds each size is caught on, and what the quiet ones are shifted by."""
    yield "| plant | size: caught of runs | smallest caught | largest quiet shift | error in its own U |"
    yield "|---|---|---|---|---|"
    seeds = sorted({line["seed"] for line in known.values()})
    for sizes in bed.plants:
        shares, smallest, worst = [], "none", (0.0, 0.0, "", 0.0)
        for plant in sizes:
            lines = [(known[plant.key(s)], known[plant.sound.key(s)]) for s in seeds if plant.key(s) in known]
            if not lines:
                continue
            caught = sum(bool(line["codes"]) for line, _ in lines)
            shares.append(f"{plant.size:.10g}: {caught}/{len(lines)}")
            if caught < SURE * len(lines):
                smallest = "none"
            elif smallest == "none":
                smallest = f"{plant.size:.10g}"
            quiet = [
                shift(line, sound, plant.changes) for line, sound in lines if not line["codes"] and not sound["codes"]
            ]
            worst = max([worst, *((*found, plant.size) for found in quiet)])
        by, own, what, size = worst
        what = what.rstrip("@").replace("@", ", ")
        none = "changes what is measured" if sizes[0].changes else "none quiet"
        text = f"{by:.1f} U ({what}, {size:.10g}) | {'' if math.isnan(own) else f'{own:.1f}'}" if what else f"{none} | "
        name = f"`{sizes[0].name}`{bed.units[sizes[0].name]}" + (f", {sizes[0].says}" if sizes[0].says else "")
        yield f"| {name} | {', '.join(shares)} | {smallest} | {text} |"


def main() -> None:
    """Run, or print the tables of what was run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("procedures", nargs="*", help="by default every one that has a file")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--few", type=int, default=FEW, help="seeds that every size is tried on")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=Path("runs/plants"))
    parser.add_argument("--table", action="store_true", help="print what is there, run nothing")
    asked = parser.parse_args()
    for procedure in asked.procedures or sorted(p.stem for p in PLANTED.glob("*.toml")):
        bed, path = bed_of(procedure), asked.folder / f"{procedure}.jsonl"
        if not asked.table:
            with pool(asked.jobs) as (workers, _):
                run_all(bed, range(asked.first, asked.first + asked.seeds), asked.few, path, workers)
        lines = read(path)
        many, sound = len({line["seed"] for line in lines.values()}), [x for x in lines.values() if not x["plant"]]
        loud = [x for x in sound if x["codes"]]
        print(f"{procedure}: {many} seeds, {len(loud)} of {len(sound)} sound runs with a finding", end="\n\n")
        told = [f"sound, seed {x['seed']}: {', '.join(x['codes'])}" for x in loud]
        print("\n".join([*told, *rows(bed, lines)]), end="\n\n")


if __name__ == "__main__":
    main()
