"""Specs: the acceptance limits of a rig, `specs/<rig>.toml`."""

from __future__ import annotations

import difflib
import math
from collections.abc import Collection, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from bench import catalogue
from bench.errors import ConfigError, Problem
from bench.findings import Effect, Finding
from bench.inputfile import TomlError, parse_toml
from bench.procedure import BenchPlan, Procedure, Quantity
from bench.procedure.plans import field_of
from bench.record.limited import words_of
from bench.record.limits import Limit, Setting
from bench.record.speccheck import wrong_limits
from bench.rigfile import RigFile
from bench.rigfile.aliases import by_names, known_as

SCHEMA = 1
NOT_APPLIED = "limit-not-applied"  # a note: the limit was stated for other settings
LIMIT_UNIT = "limit-unit"
INSTALLED = catalogue.shipped("specs")


_STRICT = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class _Range(BaseModel):
    model_config = _STRICT

    low: float | None = None
    high: float | None = None


class _Entry(BaseModel):
    model_config = _STRICT

    low: float | None = None
    high: float | None = None
    nominal: float | None = None
    relative: float | None = None
    unit: str
    source: str
    verified: bool
    at: dict[str, bool | float | str | list[float] | list[str] | _Range] = Field(default_factory=dict)

    def limit(self) -> Limit:
        at: dict[str, Setting] = {k: _setting(k, v) for k, v in self.at.items()}
        if self.nominal is None and self.relative is None:
            return Limit(self.low, self.high, self.unit, self.source, self.verified, at)
        if self.nominal is None or self.relative is None or not (self.low is None and self.high is None):
            raise ConfigError("low and high, or nominal and relative")
        if self.relative < 0:
            raise ConfigError(f"relative: found {self.relative}; expected 0 or more")
        if not self.nominal:
            raise ConfigError(
                f"relative: found {self.relative} of a nominal 0; expected low and high, as that is no range"
            )
        half = abs(self.nominal) * self.relative
        return Limit(self.nominal - half, self.nominal + half, self.unit, self.source, self.verified, at)


LIMIT_MODEL: type[BaseModel] = _Entry
"""What reads a limit of the file; its schema is made of it."""


def _setting(key: str, value: Any) -> Setting:
    if not isinstance(value, _Range):
        if value == []:
            raise ConfigError(f"at.{key}: found an empty list; expected one value or more")
        return value  # type: ignore[no-any-return]
    ends = {k: v for k, v in (("low", value.low), ("high", value.high)) if v is not None}
    if not ends or list(ends.values()) != sorted(ends.values()):
        raise ConfigError(f"at.{key}: found {ends}; expected low, high or both, low <= high")
    return ends


def load_spec(
    rig_name: str,
    procedure: str,
    of: Procedure | None = None,
    folders: Collection[Path] | None = None,
    *,
    file: Path | None = None,
    rig: RigFile | None = None,
) -> Mapping[str, Limit]:
    """Limits by quantity, or by `quantity@place`, from `./specs`, else the installed `specs/`; empty if the rig or procedure
    has none. `file` is one to be read instead.

    With `of`, the procedure itself, what would judge nothing or be found out after the run only is refused: other names than
    those of its quantities, other units, settings that its plan does not have, and values that such a setting cannot take. With
    `rig` too, places that nothing is called.

    Raises:
        ConfigError: the file cannot be used; every problem is named.
    """
    path, found = _read(rig_name, folders, file)
    limits = found.get(procedure, {})
    if rig is not None:
        limits = _by_names(limits, rig, f"limits.{procedure}", str(path))
        of = of.on(rig) if of is not None else None
    words = words_of(rig, of) if rig is not None and of is not None else ()
    if of is not None and (problems := tuple(wrong_limits(limits, of, str(path), words))):
        raise ConfigError(f"spec {path} cannot be used:", problems)
    return limits


def _by_names(limits: Mapping[str, Limit], rig: RigFile, key: str, path: str) -> Mapping[str, Limit]:
    """Limits by the rig's own names of quantities at its places."""
    named = {name: known_as(rig.aliases, name) for name in limits}
    twice = tuple(Problem(path, f"{key}.{name}", "two limits of the same", f"one of {name}, {own}")
                  for name, own in named.items() if name != own and own in limits)  # fmt: skip
    if twice:
        raise ConfigError(f"spec {path} cannot be used:", twice)
    return by_names(rig.aliases, limits)


def limited(rig_name: str, folders: Collection[Path] | None = None) -> Collection[str]:
    """Procedures, by name, that a rig's spec file has limits for.

    Raises:
        ConfigError: the file cannot be used.
    """
    return _read(rig_name, folders, None)[1].keys()


def misnamed(rig_name: str, folders: Collection[Path] | None = None, *, file: Path | None = None) -> Iterator[Problem]:
    """Tables of limits whose name is nearly a procedure's: each would be void in silence. What is like none of them may be for
    a procedure of another laboratory.

    Raises:
        ConfigError: the file cannot be used.
    """
    path, found = _read(rig_name, folders, file)
    names = [entry.name for entry in catalogue.procedures()]
    for name in found:
        if name not in names and (close := difflib.get_close_matches(name, names, 1)):
            yield Problem(str(path), f"limits.{name}", name, f"the name of a procedure, such as {close[0]}")


def _read(
    rig_name: str, folders: Collection[Path] | None, file: Path | None
) -> tuple[Path | None, Mapping[str, Mapping[str, Limit]]]:
    """A rig's spec file and its limits by procedure and quantity; without any where there is no file."""
    found = [folder / f"{rig_name}.toml" for folder in ((Path("specs"), INSTALLED) if folders is None else folders)]
    path = file or next((p for p in found if p.is_file()), None)
    if path is None:
        return None, {}
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise ConfigError(f"spec {path}: cannot be read: {error}; expected a TOML file") from error
    return path, parse_spec(text, str(path))


def applied(
    limits: Mapping[str, Limit], plan: BenchPlan, left_out: Collection[str] = ()
) -> tuple[Mapping[str, Limit], tuple[Finding, ...]]:
    """The limits that hold for a plan, and a note for those that were stated for other settings, with these, or for a quantity
    of `left_out`, which the plan does not measure."""
    others: dict[str, list[str]] = {}
    for name, limit in limits.items():
        if name.partition("@")[0] in left_out:
            others.setdefault("this plan does not measure it", []).append(name)
        elif differ := "; ".join(_differences(limit, plan)):
            others.setdefault(f"the limit was stated for {differ}", []).append(name)
    notes = tuple(
        Finding(NOT_APPLIED, f"no verdict on {', '.join(names)}: {why}", "spec") for why, names in others.items()
    )
    left_out = {name for names in others.values() for name in names}
    return {name: limit for name, limit in limits.items() if name not in left_out}, notes


def in_unit(
    limits: Mapping[str, Limit], quantities: Collection[Quantity]
) -> tuple[Mapping[str, Limit], tuple[Finding, ...]]:
    """The limits that are in the unit of their quantity, and a finding for each other: a recording keeps the spec of its day,
    and a mistake in that is no reason to withhold what was measured."""
    by_name = {q.name: q.unit for q in quantities}
    units = {name: by_name.get(name.partition("@")[0], limit.unit) for name, limit in limits.items()}
    wrong = [name for name, limit in limits.items() if limit.unit != units[name]]
    found = (
        f"the limit of {name} is in {limits[name].unit!r}, the quantity in {units[name]!r}: it was not judged"
        for name in wrong
    )
    findings = tuple(
        Finding(LIMIT_UNIT, text, "spec", Effect.ERROR, (name,)) for text, name in zip(found, wrong, strict=True)
    )
    return {name: limit for name, limit in limits.items() if name not in wrong}, findings


def _differences(limit: Limit, plan: BenchPlan) -> Iterator[str]:
    """Settings at which a limit was stated and the plan is not, with both."""
    for key, stated in limit.at.items():
        field, scale = field_of(key, tuple(type(plan).model_fields))
        found = getattr(plan, field)
        each = found if isinstance(found, tuple | list) else (found,)
        if not all(_fits(value, stated, scale or 1.0) for value in each):
            shown = [f"{v / (scale or 1.0):g}" if isinstance(v, int | float) else str(v) for v in each]
            yield f"{key} {_stated(stated)}, here it is {', '.join(shown)}"


def _fits(value: Any, stated: Setting, scale: float) -> bool:
    if isinstance(stated, list):
        return any(_fits(value, one, scale) for one in stated)
    if isinstance(stated, Mapping):
        if not isinstance(value, int | float):
            return False
        low, high = (stated.get(k, default) * scale for k, default in (("low", -math.inf), ("high", math.inf)))
        slack = 1e-9 * abs(value)  # a speed in r/min is not exactly one in rad/s
        return bool(low - slack <= value <= high + slack)
    if isinstance(value, str | bool) or value is None or isinstance(stated, str | bool):
        return bool(value == stated)
    return math.isclose(value, stated * scale, rel_tol=1e-9, abs_tol=1e-15)


def _stated(setting: Setting) -> str:
    if isinstance(setting, list):
        return "of " + ", ".join(f"{x:g}" if isinstance(x, float) else str(x) for x in setting)
    if isinstance(setting, Mapping):
        return " to ".join(f"{setting[k]:g}" if k in setting else "any" for k in ("low", "high"))
    return f"= {setting:g}" if isinstance(setting, float) else f"= {setting}"


@lru_cache(maxsize=4)  # a listing asks for the limits of each procedure
def parse_spec(text: str, name: str = "spec") -> Mapping[str, Mapping[str, Limit]]:
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
        told: dict[str, Problem] = {}
        for e in error.errors(include_url=False):
            place = ".".join([key, *(str(x) for x in e["loc"][:2])])  # beyond are the kinds that a setting may be of
            found = "nothing" if e["type"] == "missing" else repr(e["input"])
            expected = f"one of {', '.join(_Entry.model_fields)}" if e["type"] == "extra_forbidden" else str(e["msg"])
            if len(e["loc"]) > 1:
                expected = "finite numbers, words, true or false, a list of these, or { low, high }"
            told.setdefault(place, Problem(name, place, found, expected))
        problems += told.values()
    return None
