"""Load balancing on drawn rigs, with facts that are the machine's own constants, for the tests."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bench.calibration import Calibration
from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.uncertainty import Estimate, Influence
from sim_backend.truth import draw

SHORT = {"ways": ["forward"], "turns": 2, "repeats": 2}
KNOWN = {"force-constant": {"alpha_d": 2e-3, "alpha_dx": 2e-3}, "negative-stiffness": {"alpha_x_prime": 5e-3},
         "force-coupling": {"alpha_ratio": 5e-4, "alpha_c": 2e-3, "gamma_0": 2e-4}}  # fmt: skip
"""By procedure its facts, with what they are known to: a share of themselves, gamma_0 in rad."""


def facts(rig: str, seed: int, truth: Mapping[str, float] | None = None) -> dict[str, Calibration]:
    """What the procedures before it would have found of the machine, at its centre."""
    known = draw(load_rig(rig), seed, truth).quantities

    def one(procedure: str, name: str, u: float) -> Estimate:
        size = u if name == "gamma_0" else u * known[name]
        return Estimate.of(
            known[name], Influence(f"{procedure}/scatter/{name}", name, size, "1", "A", "normal", 20.0, "a test's")
        )

    return {
        p: Calibration(
            p, {name: one(p, name, u) for name, u in of.items()}, run_id=f"{p}-of-a-test", seed=seed, sha256="0" * 64
        )
        for p, of in KNOWN.items()
    }


def run(
    rig: str, seed: int, path: Path, plan: Mapping[str, Any] | None = None, truth: Mapping[str, float] | None = None,
    sound: Mapping[str, float] | None = None,
) -> Simulated:  # fmt: skip
    """A run; the facts are of the machine with `sound` in place of `truth`."""
    known = facts(rig, seed, truth if sound is None else sound)
    return simulated_run("load-balancing", rig, seed, {**SHORT, **(plan or {})}, path / "run.mcap", truth, known)


def codes(done: Simulated) -> set[str]:
    """Codes of its findings."""
    return {r.code for r in done.results if isinstance(r, Finding)}


def values(done: Simulated) -> dict[str, Measured]:
    """What was measured, by `name@where`."""
    found = [r for r in done.results if isinstance(r, Measured)]
    return {f"{m.quantity.name}@{m.where}": m for m in found}
