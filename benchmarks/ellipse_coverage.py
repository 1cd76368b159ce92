"""How often 95 % ellipses hold the truth: of the vectors of `unbalance` and `compensation`, of the unbalances of `balance`.

    python benchmarks/ellipse_coverage.py balance --first 1000 --count 20 --plan 'speeds_rpm=[10000]' --plan leave=true

Intervals of single components are the campaign amb-motion's; a vector's region is not the square of two of them. The ellipses
of a rig share its certificates, so that shares come with their standard error over the rigs.
"""

from __future__ import annotations

import argparse
import importlib
import math
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bench import catalogue
from bench.analysis.vectors import Vectors, contains
from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.procedure.plans import assemble
from bench.rigfile import load_rig
from bench.uncertainty import Estimate, correlation, welch_satterthwaite

RIG = "amb5dof"
KINDS = ("vector", "unbalance", "residual")


def held(run: Simulated) -> Iterator[tuple[str, bool]]:
    """Kind of vector, and whether its ellipse holds the truth, for each one of a run."""
    true = truth_of_motion(run)
    found = {(m.quantity.name, m.where): m.estimate for m in run.results if isinstance(m, Measured)}
    for (name, where), c in found.items():
        kind = name.removesuffix("_cos")
        if kind in KINDS and kind != name:
            s = found[f"{kind}_sin", where]
            at = [true[f"{kind}_{part}@{where}"] for part in ("cos", "sin")]
            yield kind, contains(_vector(c, s), complex(*at))


def _vector(c: Estimate, s: Estimate) -> Vectors:
    both = correlation(c, s) * c.u * s.u
    covariance = np.array([[c.u**2, both], [both, s.u**2]])
    return Vectors(np.array([complex(c.value, s.value)]), covariance, min(map(welch_satterthwaite, (c, s))))


def main() -> None:
    """Print how the runs ended, and a line for each kind of vector."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("procedure", choices=("unbalance", "compensation", "balance"))
    parser.add_argument("--first", type=int, default=3000)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--plan", action="append", default=[], metavar="KEY=VALUE")
    chosen = parser.parse_args()
    procedure, rig = importlib.import_module(catalogue.entry(chosen.procedure).module).procedure, load_rig(RIG)
    plan = assemble(procedure.plan, (rig.path, rig.plans.get(chosen.procedure, {})), assignments=chosen.plan)
    shares: dict[str, list[float]] = defaultdict(list)
    ends: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(chosen.first, chosen.first + chosen.count):
            path = Path(folder) / "recording.mcap"
            path.unlink(missing_ok=True)
            run = simulated_run(chosen.procedure, RIG, seed, plan.model_dump(), path)
            serious = {f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE}
            ends[", ".join(sorted(serious)) or "no finding"] += 1
            hits = defaultdict(list)
            for kind, hit in held(run):
                hits[kind].append(hit)
            for kind, some in hits.items():
                shares[kind].append(float(np.mean(some)))
    print("; ".join(f"{n} rigs: {end}" for end, n in ends.most_common()))
    for kind, some in shares.items():
        print(f"{kind:10s} {np.mean(some):.3f} +- {np.std(some) / math.sqrt(len(some)):.3f} on {len(some)} rigs")


if __name__ == "__main__":
    main()
