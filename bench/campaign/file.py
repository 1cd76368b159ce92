"""The campaign file: procedures and their plans in order, on one rig or on many virtual ones. TOML, strict.

A file is checked in full before anything starts: every problem of it is in one error. Plans are checked later, where
the procedures are known (`bench.cli.campaign.steps`).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from bench import catalogue
from bench.errors import ConfigError, Problem
from bench.inputfile import TomlError, parse_toml
from bench.rigfile.toleranced import Toleranced, simulated
from bench.rundir import LARGEST
from bench.schema import expected_of

SCHEMA = 1


class _Table(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)


class Step(_Table):
    """One procedure. `virtual_plan` goes over `plan` on many virtual rigs, where bench time costs computing time.

    `adopt` makes the result a calibration of the rig for later steps; None is: if a later step needs it. `judged` are
    the quantities whose coverage decides over many rigs; None is all of them.
    """

    procedure: str
    plan: Mapping[str, Any] = {}
    virtual_plan: Mapping[str, Any] = {}
    adopt: bool | None = None
    judged: tuple[str, ...] | None = Field(None, strict=False)


class Virtual(_Table):
    """Many virtual rigs: seeds `first_seed` to `first_seed + count - 1`."""

    first_seed: int = Field(0, ge=0, le=LARGEST)
    count: int = Field(ge=1)


class Equation(_Table):
    """What a constant means in the model: its equation, and where that is printed."""

    text: str = Field(min_length=1)
    source: str = Field(min_length=1)


class Campaign(_Table):
    """A campaign file. Without `virtual` it is one rig: the real one, or the simulated one of `seed`. `visit` is the day of
    virtual rigs."""

    schema_: int = Field(alias="schema")
    name: str = Field(pattern=r"^[a-z0-9][a-z0-9-]*$", max_length=60)
    title: str = ""
    rig: str = Field(min_length=1)
    backend: Literal["sim", "live"] = "sim"
    seed: int | None = Field(None, ge=0, le=LARGEST)
    visit: int | None = Field(None, ge=0, le=LARGEST)
    virtual: Virtual | None = None
    truth: Mapping[str, float] = {}
    step: tuple[Step, ...] = Field((), strict=False)
    equations: Mapping[str, Equation] = {}
    given: Annotated[Mapping[str, Toleranced], BeforeValidator(simulated)] = {}

    @classmethod
    def parse(cls, text: str, path: str = "campaign.toml") -> Campaign:
        """A campaign from its text.

        Raises:
            ConfigError: not TOML, a newer schema, or broken rules; every problem is in it.
        """
        data = _toml(text, path)
        problems: list[Problem] = []
        made = None
        try:
            made = cls.model_validate(data)
        except ValidationError as error:
            problems += [_problem(e, path) for e in error.errors(include_url=False)]
        except RecursionError:
            problems.append(Problem(path, "(file)", "tables too deep to read", "a campaign"))
        problems += _unknown_procedures(data, path)
        if made is not None:
            problems += _contradictions(made, path)
        if problems or made is None:
            raise ConfigError(f"campaign file {path} cannot be used:", tuple(problems))
        return made


def load(campaign: str) -> tuple[Campaign, Path]:
    """The campaign of that path or name (`./campaigns`, then the installed ones), and its file.

    Raises:
        ConfigError: there is none, or it cannot be used.
    """
    path = catalogue.campaign_path(campaign)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"campaign file {path}: cannot be read: {error}; expected a TOML file") from error
    return Campaign.parse(text, str(path)), path


def _toml(text: str, path: str) -> dict[str, Any]:
    try:
        data = parse_toml(text)
    except TomlError as error:
        raise ConfigError(f"campaign file {path}: {error}") from error
    schema = data.get("schema")
    if type(schema) is not int or schema != SCHEMA:
        newer = " It was written for a newer Levbench" if type(schema) is int and schema > SCHEMA else ""
        found = "none" if schema is None else repr(schema)
        raise ConfigError(f"campaign file {path}: schema: found {found}; expected schema = {SCHEMA}.{newer}")
    return data


def _problem(error: Any, path: str) -> Problem:
    key = ".".join(str(part + 1) if isinstance(part, int) else part for part in error["loc"]) or "(file)"
    found = "nothing" if error["type"] == "missing" else _short(error.get("input"))
    return Problem(path, key, found, expected_of(error))


def _short(value: Any) -> str:
    if isinstance(value, dict):
        return "a table with " + (", ".join(map(str, value)) or "nothing")
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."


def _unknown_procedures(data: Mapping[str, Any], path: str) -> list[Problem]:
    known = [p.name for p in catalogue.procedures()]
    found = data.get("step")
    steps = found if isinstance(found, list) else []
    named = [(n, s["procedure"]) for n, s in enumerate(steps, 1) if isinstance(s, dict) and "procedure" in s]
    return [
        Problem(path, f"step.{n}.procedure", repr(name), f"one of {', '.join(known)}")
        for n, name in named
        if isinstance(name, str) and name not in known
    ]


def _contradictions(c: Campaign, path: str) -> list[Problem]:
    """What each key allows and the keys together do not."""
    found: list[Problem] = []
    if not c.step:
        found.append(Problem(path, "step", "none", "at least one [[step]]"))
    if c.virtual is not None and c.seed is not None:
        found.append(Problem(path, "seed", str(c.seed), "none beside [virtual], which has first_seed"))
    if c.backend == "live":
        given = {"virtual": c.virtual is not None, "seed": c.seed is not None, "visit": c.visit is not None,
                 "truth": bool(c.truth)}  # fmt: skip
        found += [
            Problem(path, key, "one", "none: a real rig has no seed, no visit and no truth")
            for key, is_set in given.items()
            if is_set
        ]
    return found
