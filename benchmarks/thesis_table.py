"""Our identification of the nominal rig against the thesis: one virtual rig with every value at the centre of its tolerance,
through the whole chain. Prints the table of docs/explanation/thesis.md.

    python benchmarks/thesis_table.py

Ends with 1 if a printed value lies outside the interval that the chain states for it.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from bench.calibration import Calibration
from bench.campaign import file
from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.uncertainty import interval, round_to_uncertainty
from sim_backend.truth import nominal

SEED = 0  # of the noise; nothing else is drawn


@dataclass(frozen=True)
class Printed:
    """A value that the thesis prints: quantity, number, factor from its unit to SI, its unit, where."""

    quantity: str
    value: float
    factor: float
    unit: str
    where: str


PRINTED = (
    Printed("K_i", 73.2, 1.0, "N/A", "(6.12a)"),
    Printed("K_o", 74.4, 1.0, "N/A", "(6.12b)"),
    Printed("alpha_d", 12.1, 1.0, "N/A", "Table 6.2"),
    Printed("alpha_c", 14.3, 1.0, "N/A", "Table 6.2"),
    Printed("alpha_ratio", 0.85, 1.0, "1", "6.6.3"),
    Printed("alpha_x_prime", 322.3, 1e3, "N/mm", "Table 6.2"),
    Printed("alpha_tau", 2.87, 1.0, "N m/A", "Table 6.2"),
    Printed("B", 0.081, 1.0, "N m s/rad", "Table 6.2"),
)


def chain() -> Mapping[str, Measured]:
    """What the chain measures on the nominal rig, by quantity.

    Raises:
        SystemExit: a step finds something wrong.
    """
    chosen, _ = file.load("tsbs-identification")
    truth = nominal(load_rig(chosen.rig))
    facts: dict[str, Calibration] = {}
    found: dict[str, Measured] = {}
    with tempfile.TemporaryDirectory() as folder:
        for step in chosen.step:
            path = Path(folder) / f"{len(facts)}-{step.procedure}.mcap"
            done = simulated_run(
                step.procedure, chosen.rig, SEED, {**step.plan, **step.virtual_plan}, path, truth, facts
            )
            wrong = [r for r in done.results if isinstance(r, Finding) and r.effect is not Effect.NOTE]
            if wrong:
                raise SystemExit(f"{step.procedure}: {wrong}")
            facts[step.procedure] = done.calibration()
            found |= {m.quantity.name: m for m in done.results if isinstance(m, Measured) and not m.where}
            if all(p.quantity in found for p in PRINTED):
                break
    return found


def main() -> int:
    found, inside = chain(), True
    print("| quantity | thesis | ours, nominal rig | printed value inside |")
    print("|---|---|---|---|")
    for p in PRINTED:
        bounds = interval(found[p.quantity].estimate, seed=SEED)
        # what is printed is rounded: half of its last digit belongs to it
        half = 0.5 * 10 ** -len(str(p.value).partition(".")[2])
        held = bounds.low <= (p.value + half) * p.factor and (p.value - half) * p.factor <= bounds.high
        inside = inside and held
        value, expanded = round_to_uncertainty(found[p.quantity].estimate.value / p.factor, bounds.U / p.factor)
        print(
            f"| {p.quantity} | {p.value:g} {p.unit}, T {p.where} | {value} ± {expanded} | {'yes' if held else 'NO'} |"
        )
    return 0 if inside else 1


if __name__ == "__main__":
    sys.exit(main())
