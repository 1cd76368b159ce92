"""Specs: the acceptance limits of a rig, `specs/<rig>.toml`."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from bench.errors import ConfigError, Problem
from bench.inputfile import TomlError, parse_toml
from bench.limits import Limit

SCHEMA = 1
INSTALLED = Path(__file__).resolve().parent.parent / "specs"


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    low: float | None = None
    high: float | None = None
    nominal: float | None = None
    relative: float | None = None
    unit: str
    source: str
    verified: bool

    def limit(self) -> Limit:
        if self.nominal is None and self.relative is None:
            return Limit(self.low, self.high, self.unit, self.source, self.verified)
        if self.nominal is None or self.relative is None or not (self.low is None and self.high is None):
            raise ConfigError("low and high, or nominal and relative")
        if self.relative < 0:
            raise ConfigError(f"relative: found {self.relative}; expected 0 or more")
        half = abs(self.nominal) * self.relative
        return Limit(self.nominal - half, self.nominal + half, self.unit, self.source, self.verified)


def load_spec(
    rig_name: str, procedure: str, quantities: Collection[str] | None = None, folders: Collection[Path] | None = None
) -> Mapping[str, Limit]:
    """Limits by quantity name, from `./specs`, else the installed `specs/`; empty if the rig or procedure has none.

    With `quantities`, a limit of any other name is refused: a misspelt one would be silently void.

    Raises:
        ConfigError: the file cannot be used; every problem is named.
    """
    for folder in (Path("specs"), INSTALLED) if folders is None else folders:
        path = folder / f"{rig_name}.toml"
        if path.is_file():
            try:
                text = path.read_text(encoding="utf-8")
            except (OSError, ValueError) as error:
                raise ConfigError(f"spec {path}: cannot be read: {error}; expected a TOML file") from error
            limits = parse_spec(text, str(path)).get(procedure, {})
            _refuse_unknown(limits, quantities, f"{path}: limits.{procedure}")
            return limits
    return {}


def parse_spec(text: str, name: str = "spec") -> dict[str, dict[str, Limit]]:
    """Procedure -> quantity -> limit.

    Raises:
        ConfigError: not TOML, another schema, unknown or missing keys, wrong limits; every problem is named.
    """
    try:
        table = parse_toml(text)
    except TomlError as error:
        raise ConfigError(f"spec {name}: {error}") from error
    schema = table.pop("schema", None)
    if type(schema) is not int or schema != SCHEMA:
        newer = " It was written for a newer Levbench." if isinstance(schema, int) and schema > SCHEMA else ""
        raise ConfigError(f"spec {name}: schema: found {schema!r}; expected schema = {SCHEMA}.{newer}")
    problems: list[Problem] = []
    limits = table.pop("limits", {})
    problems += [Problem(name, key, repr(value), "only schema and limits") for key, value in table.items()]
    out: dict[str, dict[str, Limit]] = {}
    for procedure, entries in _tables(limits, name, "limits", problems):
        out[procedure] = {}
        for quantity, entry in _tables(entries, name, f"limits.{procedure}", problems):
            key = f"limits.{procedure}.{quantity}"
            limit = _limit(entry, name, key, problems)
            if limit is not None:
                out[procedure][quantity] = limit
    if problems:
        raise ConfigError(f"spec {name} cannot be used:", tuple(problems))
    return out


def _tables(found: Any, name: str, key: str, problems: list[Problem]) -> list[tuple[str, Any]]:
    if isinstance(found, dict):
        return list(found.items())
    problems.append(Problem(name, key, repr(found), "a table"))
    return []


def _limit(entry: Any, name: str, key: str, problems: list[Problem]) -> Limit | None:
    try:
        return _Entry.model_validate(entry).limit()
    except ConfigError as error:
        problems.append(Problem(name, key, repr(entry), str(error)))
    except ValidationError as error:
        for e in error.errors(include_url=False):
            place = ".".join([key, *(str(x) for x in e["loc"])])
            found = "nothing" if e["type"] == "missing" else repr(e["input"])
            expected = f"one of {', '.join(_Entry.model_fields)}" if e["type"] == "extra_forbidden" else str(e["msg"])
            problems.append(Problem(name, place, found, expected))
    return None


def _refuse_unknown(limits: Mapping[str, Limit], quantities: Collection[str] | None, key: str) -> None:
    unknown = [] if quantities is None else [q for q in limits if q not in quantities]
    if unknown:
        raise ConfigError(f"{key}: found {', '.join(unknown)}; expected one of {', '.join(quantities or ())}")
