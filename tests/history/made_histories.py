"""Histories made of a stated model: normal scatter of known u about a level that may drift, beside what all runs share."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

from bench.findings import SIMULATED_CONTROLLER, Finding
from bench.quantity import Quantity
from bench.record.limits import Limit
from bench.record.outcomes import Outcome
from bench.record.records import findings_of, measurement, unfinished, write_record
from bench.run.indexrow import Result
from bench.uncertainty import Estimate, Influence

START = datetime(2026, 1, 5, 8, tzinfo=UTC)
OWN, SHARED = 0.05, 0.12  # standard uncertainties, N/A: of a run alone, and of masses and gains that all runs share
K = Quantity("K_i", "N/A", "force constant")
LIMIT = Limit(70.0, 80.0, "N/A", "design", True)


def result(k: int, value: float | None = 75.0, **given: object) -> Result:
    """The k-th day's result, of a real machine unless a seed is given."""
    u = (OWN**2 + SHARED**2) ** 0.5
    plain = Result(
        run_id=f"amb-calibration-{k:04}", procedure="amb-calibration", rig="tsbs12", uut="7",
        started=(START + timedelta(days=k)).isoformat(), seed=None, visit=None, outcome="PASS", name="K_i", quantity="K",
        where="inboard", unit="N/A", value=value, u=u, U=2 * u, dof=None, p=0.95, lower=70.0, upper=80.0, verdict="pass",
        settings="plan", firmware="1", calibrations="c", parameters="p", certificates="m", served=False, overdue="",
        root=Path("runs"),
    )  # fmt: skip
    return plain._replace(**given)


def results(values: Sequence[float], **given: object) -> list[Result]:
    return [result(k, float(v), **given) for k, v in enumerate(values)]


def record(root: Path, k: int, value: float, *, days: float = 1.0, plan: int = 9, seed: int | None = None,
           served: bool = False) -> Path:  # fmt: skip
    """A run directory with the record of the k-th run that measured K_i, scatter and shared influence in its budget."""
    at = START + timedelta(days=days * k)
    path = root / f"amb-calibration-{at:%Y%m%dT%H%M%SZ}-{k:04x}"
    path.mkdir(parents=True)
    own = Influence("scatter/1", "scatter", OWN, "N/A", "A", "normal", 30.0)
    shared = Influence("masses/a", "mass a", SHARED, "N/A", "B", "normal")
    estimate = Estimate.of(value, own) + Estimate.of(0.0, shared)
    blank = unfinished(
        run_id=path.name, procedure="amb-calibration", rig="tsbs12", uut={"serial": "7"}, seed=seed, visit=k,
        plan={"rounds": plan}, started=at.isoformat(), versions={},
    )  # fmt: skip
    told = findings_of([Finding(SIMULATED_CONTROLLER, "it says so", "controller")] if served else ())
    write_record(path / "record.json", dataclasses.replace(
        blank, outcome=Outcome.PASS, ended=at.isoformat(), findings=told,
        measurements=(measurement(K.measured(estimate), LIMIT),)))  # fmt: skip
    return path
