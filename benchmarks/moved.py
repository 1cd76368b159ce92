"""Every drawn number of the simulator's truth moved by three half widths, one at a time: what becomes of the results.

    python -m benchmarks.moved torque-constant --seed 5
    python -m benchmarks.moved --all runs/moved.jsonl

Each must be caught (a finding above a note, or a run that is stopped), or do nothing that matters (2 U), or be covered by its
share of the budget, or stand in the report's list of what no data can show. What is none of these is printed last and makes
the exit status 1. Shifts are of value less truth, against the run of the same seed with nothing moved, in U of that run. Beside
them stands the moved run's own error, in its own U: a result that the moved machine gives less well and says so is no quiet
wrong one, and fails only beyond 1.5 of them.

A moved machine is another one for the noise too, and a phase that is moved turns an error that was there: the difference of two
errors is beyond 2 U once in 200 results by chance. What would fail is moved on two more seeds, and fails where the root mean
squares of that result's three shifts and of its own errors are beyond both (by chance once in 40 000).
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from bench.calibration import Calibration
from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.errors import BenchError
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import RigFile, load_rig
from bench.rigfile.toleranced import Toleranced
from bench.uncertainty import Estimate, Influence, interval
from benchmarks.cases import FOREIGN, RIGS, load, needed_by
from reports.unseen import is_reached
from sim_backend.machines.table import machine_of

HALF_WIDTHS = 3.0
MATTERS = 2.0  # U of the run with nothing moved
ITSELF = 1.5  # of its own U: how far the moved run's result may be off its truth
MORE_SEEDS = (1, 2)  # beside the first, for what would fail on it
ORDER = ("nothing", "budget", "listed", "FAILS")
LINEAR = 1.5  # how far a shift may exceed the linear share of three half widths, beside the scatter of two runs
RPM = math.pi / 30
TWINS = {rig: (*names, "tracking", *(["spindown"] if "balance" in names else [])) for rig, names in FOREIGN.items()}
"""Rigs of the examples, by their twins."""
QUICK: Mapping[str, Mapping[str, Any]] = {
    "amb-calibration": {"settle_s": 0.3, "average_s": 0.2},
    "force-constant": {"levels_A": (-1.5, -0.75, 0.0, 0.75, 1.5), "ramp_A_s": 5, "settle_s": 0.15, "average_s": 0.2},
    "negative-stiffness": {"levels_m": (-40e-6, -20e-6, 0.0, 20e-6, 40e-6), "settle_s": 0.3, "average_s": 0.3},
    "force-coupling": {"settle_s": 0.3, "average_s": 0.2},
    "torque-constant": {"masses": ("M2", "M3"), "wiring_A": 0.5, "settle_s": 0.5, "average_s": 0.2},
    "spindown": {"repeats": 2, "speed_rad_s": 50},
    "maximum-speed": {"repeats": 3, "average_s": 1.0, "dwell_s": 1.2},
    "balance": {"slow_s": 4.2, "dwell_s": 0.5, "capture_s": 0.3, "settle_s": 0.8, "speeds_rad_s": (10000 * RPM,)},
}
"""Short plans; the others run with their defaults."""
KINDS = {"position_gain_": "sensors/pos_{}/gain", "position_offset_": "sensors/pos_{}/offset", "amb_gap_": "geometry/amb_gap",
         "asymmetry_": "machine/amb_asymmetry/{}", "coupling_offset_": "machine/coupling_offset"}  # fmt: skip
NAMES = {"hanger": "masses/hanger", "mass_density": "masses/density", "polar_inertia": "machine/polar_inertia",
         "ring_inertia": "machine/ring_inertia", "roll": "machine/radial_axes", "beta_4": "machine/torque_ripple",
         **{f"segment_gain_{k}": f"machine/segment_gain/{k + 1}" for k in range(4)}}  # fmt: skip

WEIGHTS = {"weight_mass": "kg", "weight_angle": "angle"}  # how budgets call what a weight has by itself


@dataclass(frozen=True)
class Moved:
    """What became of one number: `shift` of the result that moved most, in U of the run with nothing moved; `own`, the moved
    run's error of it in its own U; `end` caught, nothing, budget, listed or FAILS."""

    rig: str
    procedure: str
    name: str
    end: str
    shift: float
    result: str
    told: str
    own: float = 0.0


def identity(name: str) -> str:
    """The identity that the influence of a drawn number has in budgets, if it is in one."""
    if name in NAMES:
        return NAMES[name]
    for start, kind in KINDS.items():
        if name.startswith(start):
            return kind.format(name.removeprefix(start))
    table, _, rest = name.partition(".")
    return f"sensors/{table}/{rest}" if rest in ("gain", "offset") else name.replace(".", "/")


def shares(name: str, estimate: Estimate) -> list[tuple[Influence, float]]:
    """The influences of a drawn number on a result, each with its sensitivity: one, but of what every weight of a plane has by
    itself (`balancing.PLANE.weight_mass`) one for each trial weight in it."""
    table, _, rest = name.partition(".")
    plane, _, key = rest.rpartition(".")
    if table == "balancing" and key in WEIGHTS:
        ends = f"/{WEIGHTS[key]}"
        return [(i, c) for i, c in estimate.sensitivities.items()
                if i.id.startswith("weight/") and i.id.endswith(ends) and i.name.endswith(f", {plane}")]  # fmt: skip
    return [(i, c) for i, c in estimate.sensitivities.items() if i.id == identity(name)]


def numbers(rig: RigFile) -> dict[str, float]:
    """Every drawn number of a rig that has a width, at its stated value and three half widths."""

    def width(t: Toleranced) -> float:
        return t.half_width if t.half_width is not None else 2 * t.standard_uncertainty

    return {name: t.value + HALF_WIDTHS * width(t) for name, t in machine_of(rig).stated(rig).items() if width(t) > 0}


def attempt(procedure: str, rig: str, seed: int, truth: Mapping[str, float], folder: Path) -> Simulated:
    """The run with what it needs before it, all on the same machine; on a twin, what of that its rig can do.

    Raises:
        BenchError: one of them is stopped.
    """
    known: dict[str, Calibration] = {}
    path = folder / "recording.mcap"
    before = {name: switches for name, switches in needed_by(procedure).items() if name in TWINS.get(rig, (name,))}
    for name, switches in {**before, procedure: {}}.items():
        path.unlink(missing_ok=True)
        done = simulated_run(name, rig, seed, {**_quick(name, rig), **switches}, path, truth, known)
        if name != procedure:
            if serious(done):
                raise BenchError(f"{name}: {', '.join(serious(done))}")
            known[name] = done.calibration()
    return done


def _quick(procedure: str, rig: str) -> dict[str, Any]:
    """The short plan; a twin has speeds and captures of its own."""
    return {
        k: v
        for k, v in QUICK.get(procedure, {}).items()
        if rig not in TWINS or k not in ("speed_rad_s", "speeds_rad_s", "capture_s")
    }


def serious(done: Simulated) -> list[str]:
    """Codes of the findings above a note."""
    return [f.code for f in done.results if isinstance(f, Finding) and f.effect is not Effect.NOTE]


def errors(done: Simulated) -> dict[str, tuple[float, Measured]]:
    """Value less truth by result, of those that have one."""
    truth = {**done.truth, **truth_of_motion(done)}
    out = {}
    for m in done.results:
        if isinstance(m, Measured):
            true = truth.get(f"{m.quantity.name}@{m.where}", truth.get(m.quantity.name))
            if true is not None and math.isfinite(m.estimate.value):
                out[f"{m.quantity.name} {m.where}".strip()] = (m.estimate.value - true, m)
    return out


@dataclass(frozen=True)
class Sound:
    """A run with nothing moved: its results' errors, and their U."""

    rig: str
    run: Simulated
    base: Mapping[str, tuple[float, Measured]]
    wide: Mapping[str, float]

    @classmethod
    def of(cls, procedure: str, rig: str, seed: int, folder: Path) -> Sound:
        """On the rig of a seed."""
        run = attempt(procedure, rig, seed, {}, folder)
        base = errors(run)
        return cls(rig, run, base, {key: interval(m.estimate, seed).U for key, (_, m) in base.items()})

    def shifts(self, name: str, value: float, folder: Path) -> dict[str, tuple[float, float]] | str:
        """By result with a number moved its shift in U of this run and its error in its own U, or what caught it."""
        try:
            done = attempt(self.run.procedure.name, self.rig, self.run.seed, {name: value}, folder)
        except BenchError as error:
            return str(error)
        if found := serious(done):
            return ", ".join(found)
        return {
            key: (
                abs(e - self.base[key][0]) / self.wide[key],
                abs(e) / max(interval(m.estimate, self.run.seed).U, 1e-300),
            )
            for key, (e, m) in errors(done).items()
            if key in self.base
        }

    def end(self, name: str, key: str, shift: float, own: float) -> str:
        """nothing, budget, listed or FAILS: a result's shift by a number, and its error in its own U."""
        if shift <= MATTERS or own <= ITSELF:
            return "nothing"
        found = shares(name, self.base[key][1].estimate)
        if found and not any(is_reached(i.id, self.run.procedure.reached) for i, _ in found):
            return "listed"
        drawn = interval(self.base[key][1].estimate, self.run.seed).contributions  # at a kink a derivative is no share
        linear = sum(
            drawn.get(i.id, abs(c) * i.u) * HALF_WIDTHS * (2.0 if i.distribution == "normal" else math.sqrt(3))
            for i, c in found
        )
        return "budget" if found and shift * self.wide[key] <= LINEAR * linear + self.wide[key] else "FAILS"


def moved(procedure: str, rig: str, seed: int, names: Mapping[str, float], folder: Path) -> Iterator[Moved]:
    """What becomes of each of `names` at its moved value."""
    rigs = {seed: Sound.of(procedure, rig, seed, folder)}
    for name, value in names.items():
        shifts = rigs[seed].shifts(name, value, folder)
        if isinstance(shifts, str):
            yield Moved(rig, procedure, name, "caught", 0.0, "", shifts)
            continue
        ends = {key: rigs[seed].end(name, key, *both) for key, both in shifts.items()}
        worst = max(shifts, key=lambda key: (ORDER.index(ends[key]), shifts[key]), default="")
        shift, own = shifts.get(worst, (0.0, 0.0))
        end = ends.get(worst, "nothing")
        if end == "FAILS":
            several = [(shift, own)]
            for more in (seed + k for k in MORE_SEEDS):
                if more not in rigs:
                    rigs[more] = Sound.of(procedure, rig, more, folder)
                again = rigs[more].shifts(name, value, folder)
                several += [again[worst]] if not isinstance(again, str) and worst in again else []
            shift, own = (math.sqrt(sum(x * x for x in xs) / len(xs)) for xs in zip(*several, strict=True))
            end = "FAILS" if shift > MATTERS and own > ITSELF else "nothing"
        yield Moved(rig, procedure, name, end, round(shift, 2), worst, "", round(own, 2))


def main() -> int:
    """Print a line for each number, what fails last."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("procedures", nargs="*")
    parser.add_argument(
        "--all",
        type=Path,
        metavar="FILE",
        help="every procedure, or those named; the lines go to a file, what it has is not done again",
    )
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--rig", help="this one alone")
    asked = parser.parse_args()
    lines = [json.loads(x) for x in asked.all.read_text().splitlines()] if asked.all and asked.all.exists() else []
    done = {(e["rig"], e["procedure"], e["name"]) for e in lines}
    for rig, procedures in {**RIGS, **TWINS}.items():
        for procedure in procedures:
            if asked.rig and asked.rig != rig:
                continue
            if procedure not in asked.procedures and (asked.procedures or not asked.all):
                continue
            load(procedure)
            left = {n: v for n, v in numbers(load_rig(rig)).items() if (rig, procedure, n) not in done}
            with tempfile.TemporaryDirectory() as folder:
                for line in moved(procedure, rig, asked.seed, left, Path(folder)) if left else ():
                    lines.append(asdict(line))
                    print(
                        f"{Path(line.rig).stem:13} {line.procedure:18} {line.name:34} {line.end:8} {line.shift:6.2f} U, "
                        f"{line.own:5.2f} of its own {line.result} {line.told[:90]}"
                    )
                    if asked.all:
                        with asked.all.open("a", encoding="utf-8") as out:
                            out.write(json.dumps(asdict(line)) + "\n")
    failed = [e for e in lines if e["end"] == "FAILS"]
    for e in failed:
        print(
            f"FAILS: {e['rig']} {e['procedure']} {e['name']}: {e['result']} by {e['shift']} U, {e.get('own', 0.0)} of its own, "
            "quiet, in no budget and in no list"
        )
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
