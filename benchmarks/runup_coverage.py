"""Coverage of procedures `run-up` and `coast-down` over virtual rigs: the share of 95 % intervals that hold what the shaft does
when its speed stands, without noise: vectors at the captures' speeds, and amplitudes at the greatest; speeds and factors there
are those of the same rig with small orbits, a fiftieth of its unbalance and runout. All greatest amplitudes count, critical
or not.

    python benchmarks/runup_coverage.py --first 4000 --count 24 --law PID --kd 10
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from bench.analysis.vectors import contains
from bench.cli.virtual import simulated_run
from bench.errors import DeviceFault
from bench.findings import Effect, Finding
from bench.rigfile import load_rig
from bench.uncertainty import interval
from bench.units import RPM
from procedures.amb_rotor.conventions import conventions
from sim_backend.machines.amb5dof import truth_passage, truth_unbalance
from sim_backend.truth import draw

RIG = "amb5dof"
PLAN: dict[str, Any] = {"slow_s": 5.0, "settle_s": 1.0, "capture_s": 0.2}
NARROW: dict[str, Any] = {
    "top_rad_s": 7000 / RPM,
    "speeds_rad_s": (2500 / RPM, 5000 / RPM),
}  # where the rigid modes are
Hits = dict[str, list[tuple[bool, float, float]]]
AMB_ROTOR = conventions(load_rig("amb5dof"))


def one(name: str, seed: int, plan: dict[str, Any], folder: Path, hits: Hits) -> None:
    """A rig's vectors and criticals into `hits`: held, error, half width."""
    rig, path = load_rig(RIG), folder / "recording.mcap"
    path.unlink(missing_ok=True)
    try:
        done = simulated_run(name, RIG, seed, plan, path)
    except DeviceFault as error:
        print(f"seed {seed}: {error}")
        return
    serious = [f.code for f in done.results if isinstance(f, Finding) and f.effect is not Effect.NOTE]
    if serious:
        print(f"seed {seed}: {', '.join(serious)}")
        return
    run = done.procedure.evaluated(done.recording).result
    if run is None or run.near is None:
        return
    made, plant = done.recording.plan, draw(rig, seed).plant
    defaults = {n: p.default for n, p in rig.parameters.items()}
    settings = {**defaults, **AMB_ROTOR.variants["off"], **made.parameters, **AMB_ROTOR.select(made.law)}
    true = truth_unbalance.response(plant, settings, np.array([r.dwell.speed for r in run.near.dwells]))
    for r, shaft in zip(run.near.dwells, true, strict=True):
        for k, axis in enumerate(AMB_ROTOR.axes):
            hits["ellipse"].append(
                (contains(r.vectors.one(k), complex(shaft[k])), 1e6 * abs(r.vectors.values[k] - shaft[k]), math.nan)
            )
            _add(hits, "vector, um", r.estimates["vector_cos", axis], float(shaft[k].real), 1e6)
            _add(hits, "vector, um", r.estimates["vector_sin", axis], float(-shaft[k].imag), 1e6)
    if run.peaks:
        _peaks(run, plant, settings, hits)


def _peaks(run: Any, plant: Any, settings: dict[str, float], hits: Hits) -> None:
    """The greatest amplitudes of each probe."""
    low = min(p.low if math.isfinite(p.low) else p.speed.value for p in run.peaks)
    high = max(p.high if math.isfinite(p.high) else p.speed.value for p in run.peaks)
    held = truth_passage.curves(plant, settings, 0.85 * low, 1.1 * high)
    for p in run.peaks:
        speed, amplitude, factor = held.critical(AMB_ROTOR.axes.index(p.axis), p.speed.value)
        if not abs(speed / p.speed.value - 1) < 0.1:
            hits["unmatched"].append((False, 0.0, math.nan))
            continue
        _add(hits, "peak speed, r/min", p.speed, speed, RPM)
        _add(hits, "peak amplitude, um", p.amplitude, amplitude, 1e6)
        if p.factor is not None and math.isfinite(factor):
            _add(hits, "factor", p.factor, factor, 1.0)
        hits["speed with lag"].append((True, RPM * abs(p.speed.value + p.lagged - speed), math.nan))
        hits["speed with bend"].append((True, RPM * abs(p.speed.value + p.bent - speed), math.nan))


def _add(hits: Hits, name: str, e: Any, true: float, scale: float) -> None:
    i = interval(e)
    hits[name].append((i.low <= true <= i.high, scale * abs(e.value - true), scale * (i.high - i.low) / 2))


def main() -> None:
    """Print a line for each quantity."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=24)
    parser.add_argument("--down", action="store_true", help="coast-down")
    parser.add_argument("--rate", type=float, default=60.0, help="rad/s^2")
    parser.add_argument("--law", choices=("PID", "CCS", "CAC"), default="CCS")
    parser.add_argument("--narrow", action="store_true", help="up to 7000 r/min only, where the rigid modes are")
    parser.add_argument("--kd", type=float, default=0.0, help="of the PID; 10 A s/m leaves little damping")
    chosen = parser.parse_args()
    plan = dict(PLAN) | {"deceleration_rad_s2" if chosen.down else "acceleration_rad_s2": chosen.rate}
    plan["bottom_rad_s"] = max(600 / RPM, math.sqrt(2 * math.pi * chosen.rate / 0.1) + 1)
    plan |= {"law": chosen.law} | (NARROW if chosen.narrow else {})
    if chosen.kd:
        plan["parameters"] = {"kd": chosen.kd}
    hits: Hits = defaultdict(list)
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(chosen.first, chosen.first + chosen.count):
            one("coast-down" if chosen.down else "run-up", seed, plan, Path(folder), hits)
    for name, found in hits.items():
        held, away, half = np.array(found).T
        print(f"{name:18s} {held.mean():.3f} of {len(found)} hold the truth; median error {np.median(away):.3f}, 95 % within "
              f"{np.quantile(away, 0.95):.3f}; mean half width {half.mean():.3f}")  # fmt: skip


if __name__ == "__main__":
    main()
