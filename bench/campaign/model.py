"""The model of a machine that a campaign ends in: `model.json`. `model.schema.json` beside this file describes it.

Correlations between constants of different runs come from the influences that their budgets share, by identity: what
stands in the rig file is the same in every run, what a run invents (its scatter) is that run's own.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Literal

from pydantic import ConfigDict, TypeAdapter

from bench.calibration import of_the_rig
from bench.campaign.file import Equation
from bench.record.forms import certified_in, in_units, is_number
from bench.record.records import Measurement, Record
from bench.rigfile.toleranced import Toleranced
from bench.rundir import NAME
from bench.schema import STRICT

SCHEMA = 1
SCHEMA_FILE = Path(__file__).with_name("model.schema.json")
LARGEST = 5  # terms of a budget that the model repeats


@dataclass(frozen=True)
class Term:
    """One influence on a constant: its standard uncertainty in the constant's unit, and its share of the variance."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    name: str
    influence: str
    contribution: float
    share: float


@dataclass(frozen=True)
class StatedEquation:
    """What a constant means: its equation, and where that is printed."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    text: str
    source: str


@dataclass(frozen=True)
class Constant:
    """One measured constant, SI. `dof` None is infinite; `interval` has the coverage probability.

    `standard_uncertainty` and `coverage_factor` are None where the interval alone is stated. `holds_for` are the settings at
    which it was measured. `terms` are the largest of its budget, `rest` the standard uncertainty of all others together.
    """

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    name: str
    unit: str
    about: str
    value: float
    standard_uncertainty: float | None
    dof: float | None
    coverage_factor: float | None
    coverage_probability: float
    expanded_uncertainty: float
    interval: tuple[float, float]
    method: Literal["gum", "monte-carlo"]
    verdict: str
    equation: StatedEquation | None
    holds_for: Mapping[str, float]
    procedure: str
    run_id: str
    date: str
    terms: tuple[Term, ...]
    rest: float


@dataclass(frozen=True)
class Given:
    """A number that no step measured: from the rig file (`geometry.amb_gap`) or the campaign file (`mass`), SI."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    name: str
    unit: str
    value: float
    standard_uncertainty: float
    distribution: str
    source: str


@dataclass(frozen=True)
class Matrix:
    """Correlation coefficients in the order of `names`."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    names: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Model:
    """`model.json`."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    schema: Literal[1]
    name: str
    title: str
    rig: str
    uut: Mapping[str, Any]
    rig_sha256: str
    simulated: bool
    seed: int | None
    visit: int | None = field(default=None, kw_only=True)
    created: str
    complete: bool
    constants: tuple[Constant, ...]
    correlations: Matrix
    given: tuple[Given, ...]


MODEL: TypeAdapter[Model] = TypeAdapter(Model)


def json_schema() -> dict[str, Any]:
    """The JSON Schema that ships as `model.schema.json`."""
    found = MODEL.json_schema(mode="serialization")
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **found}


@dataclass(frozen=True)
class Source:
    """A run that gave constants: its record, the definitions of its quantities, and the settings they hold for."""

    record: Record
    about: Mapping[str, str]
    holds_for: Mapping[str, float]


def constants_of(sources: Sequence[Source], equations: Mapping[str, Equation]) -> tuple[Constant, ...]:
    """Every measured quantity of the runs; of one that two runs measured, the later."""
    found: dict[str, Constant] = {}
    for source in sources:
        for m in source.record.measurements:
            if m.value is not None:
                found[label(m)] = _constant(m, source, equations.get(m.name))
    return tuple(found.values())


def label(m: Measurement) -> str:
    """A constant's name; `K_i@upper` where its place is no part of that."""
    return f"{m.name}@{m.where}" if m.where else m.name


def _constant(m: Measurement, source: Source, equation: Equation | None) -> Constant:
    assert m.value is not None
    assert m.expanded_uncertainty is not None
    assert m.interval is not None
    assert m.method is not None
    variance = m.variance
    largest = sorted(m.budget, key=lambda e: -e.contribution)
    terms = tuple(
        Term(e.name, e.influence, e.contribution, e.contribution**2 / variance if variance > 0 else 0.0)
        for e in largest[:LARGEST]
        if e.contribution > 0
    )
    return Constant(
        name=label(m), unit=m.unit, about=source.about.get(m.name, ""), value=m.value,
        standard_uncertainty=m.standard_uncertainty, dof=m.dof, coverage_factor=m.coverage_factor,
        coverage_probability=m.coverage_probability or 0.95, expanded_uncertainty=m.expanded_uncertainty,
        interval=m.interval, method=m.method, verdict=m.verdict.value,
        equation=None if equation is None else StatedEquation(equation.text, equation.source),
        holds_for=dict(source.holds_for), procedure=source.record.procedure, run_id=source.record.run_id,
        date=source.record.started, terms=terms,
        rest=math.hypot(m.together, *(e.contribution for e in largest[LARGEST:])),
    )  # fmt: skip


def correlations_of(sources: Sequence[Source]) -> Matrix:
    """Correlations of all constants along the chain, from the influences that their budgets share."""
    parts: dict[str, dict[str, float]] = {}
    for source in sources:
        for m in in_units(source.record).measurements:
            if m.value is not None:
                parts[label(m)] = _parts(m, source.record)
    names = tuple(parts)
    matrix = tuple(tuple(_coefficient(parts[a], parts[b]) if a != b else 1.0 for b in names) for a in names)
    return Matrix(names, matrix)


def _parts(m: Measurement, record: Record) -> dict[str, float]:
    """Signed contributions to a constant by identity beyond its run; the rig file's numbers keep theirs, in whatever form."""
    certified = certified_in(record)
    return {e.influence if is_number(e, certified) else identity(e.influence, record): e.linear for e in m.budget}


def identity(influence: str, record: Record) -> str:
    """An influence's identity beyond its run, of what is no whole number of the rig file: the rule of
    `bench.calibration.adopted`. One that came with a calibration has its own run's name in front already."""
    if of_the_rig(influence) or NAME.fullmatch(influence.partition("/")[0]):
        return influence
    return f"{record.run_id}/{influence}"


def _coefficient(a: Mapping[str, float], b: Mapping[str, float]) -> float:
    scale = math.hypot(*a.values()) * math.hypot(*b.values())
    shared = math.fsum(a[i] * b[i] for i in a.keys() & b.keys())
    return max(-1.0, min(1.0, shared / scale)) if scale > 0 else 0.0


def given(tables: Mapping[str, Toleranced]) -> tuple[Given, ...]:
    """Numbers of the rig file and the campaign file by name."""
    return tuple(
        Given(name, t.unit, t.value, t.standard_uncertainty, t.distribution, t.source) for name, t in tables.items()
    )


def to_content(model: Model) -> dict[str, Any]:
    """The model as plain data."""
    return dataclasses.asdict(model)


def shares_by_kind(m: Measurement) -> dict[str, float]:
    """Share of the variance by what an influence is: the first part of its identity, `run` for what a run invents."""
    variance = m.variance
    found: dict[str, float] = {}
    for e in m.budget:
        kind = e.influence.partition("/")[0] if of_the_rig(e.influence) else "run"
        found[kind] = found.get(kind, 0.0) + (e.contribution**2 / variance if variance > 0 else 0.0)
    return found
