"""What the speed knobs of a simulated run do to its results: every procedure, some seeds, with and without them.

    python benchmarks/run_paths.py measure run.json --whole                        # as `bench run` does
    python benchmarks/run_paths.py measure one.json --like run.json --substeps 1   # with its calibrations
    python benchmarks/run_paths.py compare run.json one.json

The differences are in standard uncertainties of the first file's results, the greatest of all quantities and seeds; so
are findings that only one of the two has. Target: 0.1 wherever a campaign uses a knob.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from bench.calibration import Calibration
from bench.calibration.file import attached, attachment
from bench.cli.virtual import Knobs, simulated_run
from bench.findings import Effect
from bench.procedure import Measured

RPM = math.pi / 30
TURNED = {"slow_s": 4.2, "settle_s": 1.0, "dwell_s": 0.8, "capture_s": 0.2, "repeat": False}
SWEPT = {"bottom_rad_s": 115.0, "slow_s": 4.2, "settle_s": 0.5, "capture_s": 0.2,
         "top_rad_s": 4000 * RPM, "speeds_rad_s": [2500 * RPM]}  # fmt: skip
RIGS: Mapping[str, Mapping[str, Mapping[str, Any]]] = {
    "tsbs12": {
        "amb-calibration": {"settle_s": 0.3, "average_s": 0.2},
        "force-constant": {"levels_A": [-1.5, -0.75, 0.0, 0.75, 1.5], "ramp_A_s": 5, "settle_s": 0.15, "average_s": 0.2},
        "negative-stiffness": {"levels_m": [-40e-6, -20e-6, 0.0, 20e-6, 40e-6], "settle_s": 0.3, "average_s": 0.3},
        "force-coupling": {"settle_s": 0.3, "average_s": 0.2},
        "torque-constant": {"masses": ["M2", "M3"], "wiring_A": 0.5, "settle_s": 0.5, "average_s": 0.2},
        "spindown": {"repeats": 2, "speed_rad_s": 50},
        "force-map": {"ramp_A_s": 5.0, "settle_s": 0.25, "average_s": 0.2},
        "angle-step": {"repeats": 2, "standstill_s": 0.3, "record_s": 0.8, "settle_s": 1.5},
        "slew": {"frequencies_hz": [0.2, 2.0], "periods": 4},
    },
    "amb5dof": {
        "bearing-model": {},
        "step": {"axes": ["y", "z"], "record_s": 0.5, "a": {"law": 1}},
        "unbalance": {**TURNED, "speeds_rad_s": [3000 * RPM, 10000 * RPM]},
        "compensation": {**TURNED, "speeds_rad_s": [3000 * RPM]},
        "balance": {**TURNED, "speeds_rad_s": [10000 * RPM]},
        "sensitivity": {"law": "PID", "axes": ["yi", "zo"], "speeds_rad_s": [0], "modes_hz": [], "refined_periods": 4,
                        "start_s": 0.3, "settle_s": 3},
        "tracking": {"revolutions": 8, "settle_s": 1.5},
        "run-up": {**SWEPT, "acceleration_rad_s2": 200.0},
        "coast-down": {**SWEPT, "deceleration_rad_s2": 200.0},
    },
}  # fmt: skip
"""Short plans, those of the campaigns where they have the procedure; what gives a calibration comes before what needs it."""


def measure(
    like: Mapping[str, Any] | None, seeds: Sequence[int], names: Sequence[str], knobs: Mapping[str, Any]
) -> Any:
    """Every procedure on every seed. Calibrations are made on the way, or are those of `like`."""
    found: dict[str, Any] = {"calibrations": {}, "runs": {}}
    for rig, seed in ((rig, seed) for rig in RIGS for seed in seeds):
        known: dict[str, Calibration] = {}
        if like is not None:
            known = {c.procedure: c for c in attached(like["calibrations"][f"{rig} {seed}"], "--like")}
        for name, plan in RIGS[rig].items():
            if names and name not in names:
                continue
            with tempfile.TemporaryDirectory() as folder:
                began = time.process_time()
                run = simulated_run(name, rig, seed, plan, Path(folder) / "recording.mcap", None, known, knobs=knobs)
                took = time.process_time() - began
                if like is None:
                    known[name] = run.calibration()
            measured = [m for m in run.results if isinstance(m, Measured)]
            found["runs"][f"{name} {seed}"] = {
                "cpu_s": took,
                "values": {f"{m.quantity.name}@{m.where}": (m.estimate.value, m.estimate.u) for m in measured},
                "findings": sorted({f.code for f in run.results if not isinstance(f, Measured) and f.effect != Effect.NOTE}),
            }  # fmt: skip
            print(f"{name} seed {seed}: {len(measured)} results, {took:.2f} s", file=sys.stderr)
        found["calibrations"][f"{rig} {seed}"] = attachment(tuple(known.values()))
    return found


def compare(base: Mapping[str, Any], other: Mapping[str, Any]) -> Iterator[str]:
    """A line of a table for each procedure."""
    yield "| procedure | results | greatest difference, u | median | of | findings of one alone | time |"
    yield "|---|---|---|---|---|---|---|"
    for name in dict.fromkeys(key.rpartition(" ")[0] for key in base["runs"]):
        keys = [k for k in base["runs"] if k.rpartition(" ")[0] == name and k in other["runs"]]
        pairs = [(base["runs"][k], other["runs"][k], k) for k in keys]
        off = sorted(
            (abs(b["values"][q][0] - a["values"][q][0]) / a["values"][q][1], f"{q.strip('@')}, seed {k.rpartition(' ')[2]}")
            for a, b, k in pairs for q in a["values"] if q in b["values"] and a["values"][q][1] > 0
        )  # fmt: skip
        alone = {f for a, b, _ in pairs for f in set(a["findings"]) ^ set(b["findings"])}
        alone |= {f"no {q}" for a, b, _ in pairs for q in set(a["values"]) ^ set(b["values"])}
        ratio = sum(b["cpu_s"] for _, b, _ in pairs) / sum(a["cpu_s"] for a, _, _ in pairs)
        most, where = off[-1] if off else (math.nan, "")
        middle = off[len(off) // 2][0] if off else math.nan
        yield f"| {name} | {len(off)} | {most:.3g} | {middle:.2g} | {where} | {', '.join(sorted(alone))} | {ratio:.2f} |"


def main() -> int:
    """Measure or compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    one = commands.add_parser("measure")
    one.add_argument("out", type=Path)
    one.add_argument("--like", type=Path, help="a file of `measure` whose calibrations are used")
    one.add_argument("--substeps", type=int, default=Knobs.substeps)
    one.add_argument("--slice", type=float, default=Knobs.slice_s, dest="slice_s")
    one.add_argument("--whole", action="store_true", help="with the recorder of `bench run`")
    one.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    one.add_argument("--only", nargs="+", default=[], metavar="PROCEDURE")
    two = commands.add_parser("compare")
    two.add_argument("base", type=Path)
    two.add_argument("other", type=Path)
    asked = parser.parse_args()
    if asked.command == "compare":
        print("\n".join(compare(json.loads(asked.base.read_text()), json.loads(asked.other.read_text()))))
        return 0
    knobs = Knobs(asked.substeps, asked.slice_s, plain=not asked.whole)
    like = json.loads(asked.like.read_text()) if asked.like else None
    asked.out.write_text(json.dumps(measure(like, asked.seeds, asked.only, knobs)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
