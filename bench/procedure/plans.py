"""Plans are put together from the rig file's defaults, a plan file and `--plan KEY=VALUE`, the later ones winning.

Values are TOML literals in SI. A key may carry another unit as a suffix (`settle_ms=800` sets `settle_s`); what a field
of the plan is called always comes first.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from bench import units
from bench.errors import ConfigError, Problem
from bench.inputfile import TomlError, parse_toml
from bench.plan import BenchPlan
from bench.schema import expected_of

P = TypeVar("P", bound=BenchPlan)
SCHEMA = 1


def assemble(
    plan: type[P],
    defaults: tuple[str, Mapping[str, Any]],
    file: Path | None = None,
    assignments: Iterable[str] = (),
) -> P:
    """The plan, with every problem named at once.

    `defaults` are the rig file's name and its `[plans.<procedure>]`.

    Raises:
        ConfigError: an unknown key or unit, a value that is not TOML or out of its range, an unreadable plan file.
    """
    fields = tuple(plan.model_fields)
    values: dict[str, Any] = {}
    origin: dict[str, str] = {}
    problems: list[Problem] = []
    sources = [(defaults[0], defaults[1])]
    if file is not None:
        sources.append((str(file), plan_file(file)))
    sources.extend(("--plan", {key: value}) for key, value in map(assignment, assignments))
    for source, table in sources:
        for key, value in table.items():
            try:
                name, scale = field_of(key, fields)
                values[name], origin[name] = _scaled(value, scale), source
            except ConfigError as error:
                problems.append(Problem(source, key, repr(value), str(error)))
    try:
        made = plan.model_validate(_tuples(values), strict=True)
    except ValidationError as error:
        problems += [_problem(e, origin) for e in _causes(error.errors(include_url=False))]
    if problems:
        raise ConfigError("the plan cannot be used; nothing was started:", tuple(problems))
    return made


def assignment(text: str) -> tuple[str, Any]:
    """`KEY=VALUE` with VALUE a TOML literal.

    Raises:
        ConfigError: it is not of that form.
    """
    key, equals, literal = text.partition("=")
    key = key.strip()
    if not equals or not key:
        raise ConfigError(f"found {text!r}; expected KEY=VALUE")
    try:
        table = parse_toml(f"value = {literal.strip()}")
    except TomlError as error:
        raise ConfigError(
            f"{key}: found {literal!r}, which is not a TOML value ({error}); expected a number, true or false, "
            f'a quoted string or a list, as in {key}=0.5 or {key}=\'["M1", "M2"]\''
        ) from error
    if set(table) != {"value"}:
        raise ConfigError(f"{key}: found {literal!r}; expected one TOML value")
    return key, table["value"]


def plan_file(path: Path) -> dict[str, Any]:
    """The keys of a plan file, without its `schema`.

    Raises:
        ConfigError: it cannot be read, is not TOML, or is of another schema.
    """
    try:
        table = parse_toml(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"plan file {path}: {error.strerror or error}; expected a readable TOML file") from error
    except TomlError as error:
        raise ConfigError(f"plan file {path}: {error}") from error
    except ValueError as error:
        raise ConfigError(f"plan file {path}: not TOML: {error}") from error
    schema = table.pop("schema", None)
    if schema != SCHEMA:
        newer = " It was written for a newer Levbench" if isinstance(schema, int) and schema > SCHEMA else ""
        found = "none" if schema is None else repr(schema)
        raise ConfigError(f"plan file {path}: schema: found {found}; expected schema = {SCHEMA}.{newer}")
    return table


def field_of(key: str, fields: tuple[str, ...]) -> tuple[str, float | None]:
    """The field that a key sets, and the factor to SI (None: the value is taken as it is).

    `settle_ms` names `settle` or, where fields carry their own unit, `settle_s`.

    Raises:
        ConfigError: no field has that name, or its unit is of another kind.
    """
    if key in fields:
        return key, None
    base, scale, unit = _suffix(key)
    if unit:
        for field in fields:
            field_base, field_scale, field_unit = _suffix(field)
            if field == base or (field_base == base and field_unit == unit):
                return field, scale / field_scale if field_unit else scale
    close = difflib.get_close_matches(base, {_suffix(field)[0]: field for field in fields}, 1)
    meant = [field for field in fields if _suffix(field)[0] in close]
    hint = f". Did you mean {meant[0]}?" if meant else ""
    raise ConfigError(f"one of {', '.join(fields)}, in SI or with a unit suffix of the same kind{hint}")


def _suffix(key: str) -> tuple[str, float, str]:
    """Base name, factor to SI and SI unit of a key; a key without a known suffix is its own base."""
    try:
        base, scale, unit = units.split_suffix(key)
    except ConfigError:
        return key, 1.0, ""
    return base, scale, unit


def _scaled(value: Any, scale: float | None) -> Any:
    if scale is None or isinstance(value, bool):
        return value
    if isinstance(value, int | float):
        return value * scale
    if isinstance(value, list):
        return [_scaled(v, scale) for v in value]
    return value


def _tuples(values: Mapping[str, Any]) -> dict[str, Any]:
    """TOML has lists, plans have tuples: equal plans must compare equal."""
    return {key: tuple(v) if isinstance(v, list) else v for key, v in values.items()}


def _causes(errors: Iterable[Any]) -> list[Any]:
    """Without lists that are called too short because an entry was refused: the entry is what is wrong."""
    some = list(errors)
    within = {e["loc"][0] for e in some if len(e["loc"]) > 1}
    return [e for e in some if not (e["type"] == "too_short" and len(e["loc"]) == 1 and e["loc"][0] in within)]


def _problem(error: Any, origin: Mapping[str, str]) -> Problem:
    key = ".".join(str(part) for part in error["loc"])
    source = origin.get(str(error["loc"][0]) if error["loc"] else "", "plan")
    value = list(error["input"]) if isinstance(error["input"], tuple) else error["input"]
    found = "nothing" if error["type"] == "missing" else repr(value)
    return Problem(source, key, found, expected_of(error))
