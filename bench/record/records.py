"""`record.json`: the data of one run. `record.schema.json` beside this file describes it for other readers."""

from __future__ import annotations

import dataclasses
import json
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Literal

from pydantic import ConfigDict, TypeAdapter, ValidationError

from bench.calibration import Calibration, Used
from bench.errors import ConfigError
from bench.findings import Effect, Finding
from bench.link.counts import LinkCounts
from bench.quantity import Measured, Quantity
from bench.record.limits import Limit, Verdict, judge
from bench.record.outcomes import Outcome
from bench.record.setup import Setup
from bench.record.sources import ContinuedRun, RecordingFile
from bench.schema import STRICT, require_schema
from bench.uncertainty import PROBABILITY, Estimate, Interval, budget, correlation_matrix, interval
from bench.wholefile import write_whole

SCHEMA: Literal[3] = 3
"""2: outcome DONE, findings with `concerns`. 3: `setup`, `continues`. Older records are read as they stand."""
SCHEMA_FILE = Path(__file__).with_name("record.schema.json")


@dataclass(frozen=True)
class BudgetEntry:
    """One influence of a measurement; `contribution` in the measurement's unit, `dof` None is infinite. `sensitivity` is the
    derivative at the inputs' values; records of before 2026-11-23 do not say the influence's `standard_uncertainty`."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    name: str
    influence: str
    contribution: float
    sensitivity: float
    type: Literal["A", "B"]
    distribution: str
    dof: float | None
    unit: str = ""  # of the influence
    standard_uncertainty: float | None = None  # of the influence, in its unit

    @property
    def linear(self) -> float:
        """Signed contribution c u to the linear model: what results that share the influence have in common by it."""
        u = self.standard_uncertainty
        return math.copysign(self.contribution, self.sensitivity) if u is None else self.sensitivity * u


@dataclass(frozen=True)
class LimitEntry:
    """The acceptance range, in the measurement's unit; None is open."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    low: float | None
    high: float | None
    unit: str
    source: str
    verified: bool


@dataclass(frozen=True)
class Measurement:
    """One quantity of a run. All numbers are None where it is missing; `dof` None is infinite.

    `standard_uncertainty` and `coverage_factor` are None too where the interval alone is stated (see `Interval`)."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    name: str
    unit: str
    value: float | None
    standard_uncertainty: float | None
    dof: float | None
    coverage_factor: float | None
    expanded_uncertainty: float | None
    method: Literal["gum", "monte-carlo"] | None
    verdict: Verdict
    limit: LimitEntry | None
    where: str
    interval: tuple[float, float] | None
    coverage_probability: float | None
    budget: tuple[BudgetEntry, ...]

    @property
    def variance(self) -> float:
        """What squares of contributions are shares of: their sum; by Monte Carlo u², of which they may fall short."""
        whole = math.fsum(e.contribution**2 for e in self.budget)
        return max(whole, (self.standard_uncertainty or 0.0) ** 2) if self.method == "monte-carlo" else whole

    @property
    def together(self) -> float:
        """What no influence contributes by itself, in the unit."""
        return math.sqrt(self.variance - math.fsum(e.contribution**2 for e in self.budget))


@dataclass(frozen=True)
class FindingEntry:
    """A finding, with its effect on the outcome and the quantities that it concerns; empty is all."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    code: str
    text: str
    where: str
    effect: Effect
    concerns: tuple[str, ...] = ()


@dataclass(frozen=True)
class Correlations:
    """Correlation coefficients of the measured quantities, in the order of `names`."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    names: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Record:
    """`record.json`. Times are ISO 8601 UTC; `seed` and `visit` are None for a real rig; `plan` is in SI. Older records of
    virtual rigs do not say the visit, which was 0, and those before schema 3 no `setup`. `continues` are the stopped runs that
    it goes on with, oldest first."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    schema: Literal[1, 2, 3]
    run_id: str
    procedure: str
    rig: str
    uut: Mapping[str, Any]
    outcome: Outcome
    started: str
    ended: str | None
    seed: int | None
    visit: int | None = field(default=None, kw_only=True)
    setup: Setup | None = field(default=None, kw_only=True)
    plan: Mapping[str, Any]
    calibrations: tuple[Used, ...]
    versions: Mapping[str, str]
    recording: RecordingFile | None
    continues: tuple[ContinuedRun, ...] = field(default=(), kw_only=True)
    link: LinkCounts
    findings: tuple[FindingEntry, ...]
    measurements: tuple[Measurement, ...]
    correlations: Correlations


_RECORD: TypeAdapter[Record] = TypeAdapter(Record)


def json_schema() -> dict[str, Any]:
    """The JSON Schema that ships as `record.schema.json`."""
    found = _RECORD.json_schema(mode="serialization")
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **found}


def to_json(record: Record) -> str:
    """The record as text.

    Raises:
        ValueError: a number is NaN or infinite.
        TypeError: a value of the plan, the UUT or a calibration has no JSON form.
    """
    return json.dumps(dataclasses.asdict(record), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def from_json(text: str, name: str = "record") -> Record:
    """The record in `text`; `name` stands in the messages.

    Raises:
        ConfigError: not a record, a newer one, unknown or missing keys, NaN.
    """
    require_schema(text, name, "record", SCHEMA, oldest=1)
    try:
        found = _RECORD.validate_json(text)
    except ValidationError as error:
        listed = [f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors(include_url=False)]
        raise ConfigError("\n  ".join([f"{name}: not a record of schema {SCHEMA}:", *listed])) from error
    return found if found.seed is None or found.visit is not None else replace(found, visit=0)


def write_record(path: Path, record: Record) -> None:
    """Write or replace the file; a reader sees the old or the new one, never a part, also after a crash.

    Raises:
        OSError, ValueError, TypeError: nothing was replaced.
    """
    write_whole(path, to_json(record))


def read_record(path: Path) -> Record:
    """The record in a file.

    Raises:
        ConfigError: it cannot be read, or is not a record this version knows.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}; expected a record.json") from error
    return from_json(text, str(path))


def unfinished(
    *, run_id: str, procedure: str, rig: str, uut: Mapping[str, Any], started: str, seed: int | None,
    plan: Mapping[str, Any], versions: Mapping[str, str], calibrations: Sequence[Calibration] = (), visit: int = 0,
    setup: Setup | None = None,
) -> Record:  # fmt: skip
    """What is written before anything moves: if the run dies, this is what it says."""
    text = "The run did not end: its process was killed, lost power or could write nothing any more."
    said = Finding("unfinished", text, "", Effect.ERROR)
    return Record(
        schema=SCHEMA, run_id=run_id, procedure=procedure, rig=rig, uut=uut, outcome=Outcome.ERROR, started=started,
        ended=None, seed=seed, visit=None if seed is None else visit, plan=plan, setup=setup,
        calibrations=tuple(c.summary for c in calibrations), versions=versions, recording=None, link=LinkCounts(),
        findings=findings_of([said]), measurements=(), correlations=Correlations((), ()),
    )  # fmt: skip


def findings_of(findings: Iterable[Finding]) -> tuple[FindingEntry, ...]:
    """Findings as a record holds them."""
    return tuple(FindingEntry(f.code, f.text, f.where, f.effect, f.concerns) for f in findings)


def measurement(measured: Measured, limit: Limit | None, seed: int | None = 0) -> Measurement:
    """A measured quantity with its interval, verdict and budget. A number that is not finite is a missing one.

    Raises:
        ConfigError: the limit is in another unit.
        AnalysisError: the Monte Carlo of its interval fails.
    """
    quantity, estimate = measured.quantity, measured.estimate
    if limit is not None and limit.unit != quantity.unit:
        raise ConfigError(f"limit of {quantity.name}: found unit {limit.unit!r}; expected {quantity.unit!r}")
    if not (math.isfinite(estimate.value) and math.isfinite(estimate.u)):
        return missing(quantity, limit, measured.where)
    found = interval(estimate, seed or 0)
    return replace(
        missing(quantity, limit, measured.where), value=estimate.value, standard_uncertainty=found.u,
        dof=_finite(found.dof), coverage_factor=found.k, expanded_uncertainty=found.U, method=found.method,
        verdict=_judged(estimate, found, limit), interval=(found.low, found.high), coverage_probability=PROBABILITY,
        budget=tuple(BudgetEntry(r.name, r.id, r.contribution, r.sensitivity, r.kind, r.distribution, _finite(r.dof), r.unit,
                                 r.u) for r in budget(estimate, found)),
    )  # fmt: skip


def _judged(estimate: Estimate, found: Interval, limit: Limit | None) -> Verdict:
    """As `judge`; what has influences none of which moves it is not judged: its uncertainty is not nought but unknown."""
    unknown = found.U == 0 and any(i.u > 0 for i in estimate.sensitivities)
    return Verdict.INDETERMINATE if unknown and limit is not None else judge(found, limit)


def missing(quantity: Quantity, limit: Limit | None = None, where: str = "") -> Measurement:
    """The entry of a quantity that was declared but not measured."""
    bounds = None if limit is None else LimitEntry(limit.low, limit.high, limit.unit, limit.source, limit.verified)
    return Measurement(
        name=quantity.name, unit=quantity.unit, value=None, standard_uncertainty=None, dof=None, coverage_factor=None,
        expanded_uncertainty=None, method=None, verdict=Verdict.MISSING, limit=bounds, where=where, interval=None,
        coverage_probability=None, budget=(),
    )  # fmt: skip


def correlations_of(measured: Sequence[Measured]) -> Correlations:
    """Correlations of the measured quantities, from the influences that they share. A quantity that was measured at
    several places is named with its place (`K_i@upper`)."""
    finite = [m for m in measured if math.isfinite(m.estimate.value) and math.isfinite(m.estimate.u)]
    matrix = correlation_matrix([m.estimate for m in finite])
    times = Counter(m.quantity.name for m in finite)
    names = (m.quantity.name if times[m.quantity.name] == 1 else f"{m.quantity.name}@{m.where}" for m in finite)
    return Correlations(tuple(names), tuple(tuple(row) for row in matrix))


def _finite(x: float) -> float | None:
    return x if math.isfinite(x) else None
