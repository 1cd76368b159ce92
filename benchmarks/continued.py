"""Calibrations that are stopped at a step and continued: how often their intervals hold the truth, what a drift between the
halves does, and from which size on it is told.

    nice python -m benchmarks.continued amb-calibration runs/continued.jsonl --first 0 --count 100
    nice python -m benchmarks.continued torque-constant runs/drifted.jsonl --plants --count 20
    python -m benchmarks.continued amb-calibration runs/continued.jsonl --report

A file is of one procedure, a line of it one run; the same command goes on where it was stopped. Plants change one drawn value
of the machine in its second half alone; their shift is against the same seed without one.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench.campaign.bands import Sample, coverage
from bench.cli.loading import load_procedure
from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, flown
from bench.errors import OperatorAbort
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.progress import Silent
from bench.record.outcomes import Outcome
from bench.run import stopped
from bench.rundir import RunDirectory
from bench.uncertainty import interval
from procedures.shared.continued import DRIFTED
from sim_backend.machine import Truth


@dataclass(frozen=True)
class Case:
    """A procedure on a rig with its plan, stopped when so many `steps` are done. `plants`: by how much a value of the machine
    changes while it is off."""

    rig: str
    steps: int
    plan: Mapping[str, Any]
    plants: Mapping[str, tuple[float, ...]]


CASES: Mapping[str, Case] = {
    "amb-calibration": Case(
        "tsbs12", 60, {"angles": 8, "settle_s": 0.3, "average_s": 0.2},
        {
            "i_yo_p.offset": (0.003, 0.01, 0.03),  # A
            "i_yo_p.gain": (0.001, 0.003, 0.01),  # relative
            "hanger": (0.003, 0.01, 0.03),  # kg
            "position_offset_yo": (1e-6, 3e-6, 1e-5),  # m
        },
    ),
    "torque-constant": Case(
        "tsbs12", 36, {"masses": ["M2", "M3"], "settle_s": 0.7, "average_s": 0.3},
        {
            "alpha_tau": (0.001, 0.003, 0.01),  # N m/A
            "i_m1.gain": (0.001, 0.003, 0.01),  # relative
            "geometry.lever_left": (1e-4, 3e-4, 1e-3),  # m
            "gamma_zero": (1e-4, 3e-4, 1e-3),  # rad
        },
    ),
    "static-characteristics": Case(
        "rlsrm", 200, {"angles_per_position": 2, "levels_A": [2.0, 5.0]},
        {
            "load_cells.x.gain": (0.001, 0.003, 0.01),  # relative
            "load_cells.angle.gain": (0.003, 0.01, 0.03),  # relative
            "i_a1.gain": (0.003, 0.01, 0.03),  # relative
            "stator_zero_1": (1e-3, 3e-3, 1e-2),  # rad
        },
    ),
}  # fmt: skip


class Stopping(Silent):
    """Says stop when one more step than `most` begins."""

    def __init__(self, most: int) -> None:
        self.most = most
        self.begun = 0

    def step(self, text: str) -> None:
        self.begun += 1
        if self.begun > self.most:
            raise OperatorAbort(f"stopped before {text}")


def runs(name: str, seed: int, wanted: Sequence[Mapping[str, float]]) -> Iterator[dict[str, Any]]:
    """Stop a procedure on a rig, and continue it once for each of the changes of its machine; what that measured."""
    case, procedure = CASES[name], load_procedure(name)
    with tempfile.TemporaryDirectory() as folder:
        first = RunDirectory(Path(folder) / "first")
        first.path.mkdir()
        half = flown(name, case.rig, seed, case.plan, first.recording, progress=Stopping(case.steps))
        assert half.machine.ending.stopped is Outcome.ABORTED
        for number, changes in enumerate(wanted):
            earlier = stopped.left_of(first, stopped.opened(first), procedure)
            moved = {key: half.drawn.values[key] + by for key, by in changes.items()}
            path = Path(folder) / f"{number}.mcap"
            whole = flown(name, case.rig, seed, case.plan, path, moved, earlier=earlier)
            assert whole.machine.cause is None
            done = whole.analysed()
            told = [(f.code, f.effect.value) for f in done.results if isinstance(f, Finding)]
            yield {"seed": seed, "changes": dict(changes), "values": values(done, half.drawn), "findings": told}
            path.unlink()


def values(done: Simulated, drawn: Truth) -> dict[str, dict[str, float]]:
    """Values, bounds of their intervals and truths by quantity, of those that have a truth."""
    out, truth = {}, {**drawn.quantities, **truth_of_motion(done)}
    for m in (r for r in done.results if isinstance(r, Measured)):
        found = interval(m.estimate, drawn.seed)
        names = (f"{m.quantity.name}@{m.where}", f"{m.quantity.name}_{m.where[0]}") if m.where else (m.quantity.name,)
        for name in (name for name in names if name in truth):
            out[name] = {"value": m.estimate.value, "low": found.low, "high": found.high, "U": found.U,
                         "truth": truth[name]}  # fmt: skip
    return out


def asked(name: str, plants: bool) -> list[dict[str, float]]:
    """What changes while a machine is off: nothing first."""
    return [{}, *({key: size} for key, sizes in CASES[name].plants.items() if plants for size in sizes)]


def lines(path: Path) -> list[dict[str, Any]]:
    """What is done."""
    return [json.loads(line) for line in path.read_text().splitlines()] if path.is_file() else []


def report(done: list[dict[str, Any]]) -> None:
    """A line for each quantity, code and plant."""
    sound = {d["seed"]: d for d in done if not d["changes"]}
    names = dict.fromkeys(name for d in sound.values() for name in d["values"])
    for name in names:
        of = [d["values"][name] for d in sound.values() if name in d["values"]]
        samples = [Sample(v["value"] - v["truth"], v["low"] - v["truth"], v["high"] - v["truth"], v["U"], (0.0,) * 3)
                   for v in of]  # fmt: skip
        c = coverage(samples, len(sound))
        print(f"{name:9} held {c.hits:4}/{c.rigs} = {c.coverage:.3f} (band {c.band[0]:.3f} to {c.band[1]:.3f}), "
              f"width {c.width or 0:.2f}, greatest |error|/U {max(abs(s.ratio) for s in samples):.2f}")  # fmt: skip
    print("findings of sound ones:", dict(Counter(code for d in sound.values() for code, _ in d["findings"])))
    planted: dict[tuple[str, float], list[dict[str, Any]]] = defaultdict(list)
    for d in done:
        for name, size in d["changes"].items():
            planted[name, size].append(d)
    for (name, size), runs in planted.items():
        caught = [any(effect != Effect.NOTE for _, effect in d["findings"]) for d in runs]
        quiet = [max(abs(v["value"] - sound[d["seed"]]["values"][q]["value"]) / v["U"] for q, v in d["values"].items())
                 for d, c in zip(runs, caught, strict=True) if not c and d["values"]]  # fmt: skip
        codes = dict(Counter(c for d in runs for c, e in d["findings"] if e != Effect.NOTE))
        drifts = sum(any(code == DRIFTED for code, _ in d["findings"]) for d in runs)
        moved = [abs(v["value"] - sound[d["seed"]]["values"][q]["value"]) / v["U"]
                 for d in runs for q, v in d["values"].items() if q in sound[d["seed"]]["values"]]  # fmt: skip
        print(f"{name} +{size:g}: caught {np.sum(caught)}/{len(runs)} {codes}, {DRIFTED} of any effect {drifts}, greatest "
              f"shift {max(moved, default=0.0):.2f} U, quiet {max(quiet, default=0.0):.2f} U")  # fmt: skip


def main() -> None:
    """Run what is not done yet, or report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("procedure", choices=CASES)
    parser.add_argument("file", type=Path)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--plants", action="store_true")
    parser.add_argument("--report", action="store_true")
    chosen = parser.parse_args()
    done = lines(chosen.file)
    if not chosen.report:
        chosen.file.parent.mkdir(parents=True, exist_ok=True)
        known = {(d["seed"], *d["changes"].items()) for d in done}
        for seed in range(chosen.first, chosen.first + chosen.count):
            left = [
                changes for changes in asked(chosen.procedure, chosen.plants) if (seed, *changes.items()) not in known
            ]
            for line in runs(chosen.procedure, seed, left) if left else ():
                done.append(line)
                with chosen.file.open("a") as file:
                    file.write(json.dumps(line) + "\n")
    report(done)


if __name__ == "__main__":
    main()
