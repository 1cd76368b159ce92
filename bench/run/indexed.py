"""What the index keeps of a run, from its record."""

from __future__ import annotations

import hashlib
import json

from bench.errors import ConfigError
from bench.findings import CERTIFICATE_OVERDUE, SIMULATED_CONTROLLER
from bench.record.records import Measurement, Record, read_record
from bench.record.setup import Setup
from bench.record.told import with_unit
from bench.rigfile.aliases import in_full
from bench.rigfile.certificates import numbers_told
from bench.run.indexrow import IndexEntry, MadeWith, Row
from bench.rundir import LARGEST, RunDirectory
from bench.uncertainty import PROBABILITY

DIGITS = 16  # of a digest: of a million different plans two agree once in 4e7


def row(run: RunDirectory) -> Row:
    """A run with its results, as the tables have it.

    Raises:
        ConfigError: it holds no readable record, or one of a seed or visit that the tables cannot hold.
    """
    record = read_record(run.record)
    for key, number in (("seed", record.seed), ("visit", record.visit)):
        if number is not None and abs(number) > LARGEST:
            raise ConfigError(f"{run.record}: {key}: found {number}; expected {LARGEST} at most")
    setup = record.setup
    # The directory's name, not the record's: a copied directory is another run to whoever looks for it.
    entry = IndexEntry(
        run_id=run.run_id, procedure=record.procedure, rig=record.rig, outcome=record.outcome.value, started=record.started,
        ended=record.ended, seed=record.seed, visit=record.visit,
        served=any(f.code == SIMULATED_CONTROLLER for f in record.findings), uut=_uut(record),
    )  # fmt: skip
    made_with = MadeWith(
        settings=digest({k: v for k, v in record.plan.items() if v is not None}),
        parameters="" if setup is None else digest(setup.parameters), firmware="" if setup is None else setup.firmware,
        calibrations=digest([(c.procedure, c.run_id) for c in record.calibrations]),
    )  # fmt: skip
    return Row(entry, made_with, [_result(m, record) for m in record.measurements])


def digest(content: object) -> str:
    """Of plain data, the same whatever the order of its keys."""
    text = json.dumps(content, sort_keys=True, default=dict)
    return hashlib.sha256(text.encode()).hexdigest()[:DIGITS]


def _result(m: Measurement, record: Record) -> tuple[tuple[str, ...], tuple[str | None, ...]]:
    setup = record.setup
    name = f"{m.name}@{m.where}" if m.where else m.name
    full = in_full({} if setup is None else setup.aliases, name)
    kind, _, place = full.partition("@")
    value, half = m.value, m.expanded_uncertainty
    told = "missing" if value is None or half is None else with_unit(value, half, m.unit)
    return (name, full, kind, place, m.unit), (told, _as_json(m), _certificates(m, setup), _overdue(m, record))


def _as_json(m: Measurement) -> str:
    """As `bench runs --json` shows it."""
    low, high = (None, None) if m.limit is None else (m.limit.low, m.limit.high)
    data = {
        "value": m.value, "unit": m.unit, "standard_uncertainty": m.standard_uncertainty,
        "expanded_uncertainty": m.expanded_uncertainty, "dof": m.dof,
        "coverage_probability": m.coverage_probability or PROBABILITY, "low": low, "high": high, "verdict": m.verdict.value,
    }  # fmt: skip
    return json.dumps(data, ensure_ascii=False)


def _certificates(m: Measurement, setup: Setup | None) -> str:
    """Of the numbers and not of the words: another wording makes no other certificate. Of this result alone: what another one
    of the run rests on, or lacks where that one is missing, is no change of its own."""
    if setup is None:
        return ""
    stated = {e.influence: setup.certified[e.influence] for e in m.budget if e.influence in setup.certified}
    return digest({i: (c.value, c.standard_uncertainty, c.distribution) for i, c in stated.items()}) if m.budget else ""


def _overdue(m: Measurement, record: Record) -> str | None:
    """Keys of the certificates past their due dates that this very result rests on, as the run told them on its day."""
    influences = {e.influence for e in m.budget}
    told = (f for f in record.findings if f.code == CERTIFICATE_OVERDUE)
    found = [f.where.rpartition(".")[2] for f in told if not influences.isdisjoint(numbers_told(f.text))]
    return ", ".join(dict.fromkeys(found)) if found or record.setup is not None else None


def _uut(record: Record) -> str:
    """The machine's serial number, else its model."""
    return str(record.uut.get("serial") or record.uut.get("model") or "")
