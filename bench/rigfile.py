"""The rig file: a rig as data. TOML for what the nameplate and the certificates say, a DBC for the message map.

The `[simulation]` table is parsed like the rest and read by the simulated backend alone.
"""

from __future__ import annotations

import hashlib
import math
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from bench import catalogue, units
from bench.errors import ConfigError, Problem
from bench.messages import MessageMap, load_messages

SCHEMA = 1
MIGRATIONS: dict[int, Callable[[dict[str, Any]], dict[str, Any]]] = {}
"""From an older schema to the next one."""


class Part(BaseModel):
    """A table of the rig file: frozen, no unknown keys, no NaN."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


Distribution = Literal["normal", "rectangular", "triangular", "arcsine"]
DIVISOR = {"rectangular": math.sqrt(3), "triangular": math.sqrt(6), "arcsine": math.sqrt(2)}


class Toleranced(Part):
    """A number with what is known of its error: `u` (with its coverage factor `k`), or `half_width`. SI after reading."""

    value: float
    unit: str
    u: float | None = Field(None, ge=0)
    k: float = Field(1.0, gt=0)
    half_width: float | None = Field(None, ge=0)
    distribution: Distribution
    source: str = Field(min_length=1)

    @model_validator(mode="before")
    @classmethod
    def _si(cls, data: Any) -> Any:
        if isinstance(data, dict) and isinstance(data.get("unit"), str):
            try:
                unit = units.unit(data["unit"])
            except ConfigError as error:  # a ValueError is reported with its key and next to the other problems
                raise ValueError(str(error)) from None
            scaled = {n: data[n] * unit.factor for n in ("u", "half_width") if isinstance(data.get(n), int | float)}
            if isinstance(data.get("value"), int | float):
                scaled["value"] = data["value"] * unit.factor + unit.offset
            return {**data, **scaled, "unit": unit.si}
        return data

    @model_validator(mode="after")
    def _one_width(self) -> Toleranced:
        if (self.u is None) == (self.half_width is None):
            raise ValueError("expected either u (normal) or half_width (rectangular, triangular, arcsine)")
        if (self.u is not None) != (self.distribution == "normal"):
            raise ValueError(
                f"distribution {self.distribution!r} goes with {'u' if self.distribution == 'normal' else 'half_width'}"
            )
        return self

    @property
    def standard_uncertainty(self) -> float:
        """One standard deviation, SI."""
        if self.u is not None:
            return self.u / self.k
        return (self.half_width or 0.0) / DIVISOR[self.distribution]


def _simulated(value: Any) -> Any:
    """Tables with a `distribution` become Toleranced, at any depth; everything else stays."""
    if isinstance(value, dict):
        return (
            Toleranced.model_validate(value)
            if "distribution" in value
            else {k: _simulated(v) for k, v in value.items()}
        )
    return value


class Uut(Part):
    model: str
    serial: str


class Site(Part):
    place: str
    latitude_deg: float = Field(ge=-90, le=90)
    elevation_m: float
    gravity: Toleranced
    air_density: Toleranced


class LinkSpec(Part):
    kind: Literal["can"]
    url: str
    bitrate: float = Field(gt=0)
    data_bitrate: float | None = Field(None, gt=0)
    dbc: str
    encoding: str = "utf-8"


class Device(Part):
    link: str
    roles: tuple[Literal["levitation", "rotation", "operator"], ...]


class Channel(Part):
    signal: str
    unit: str
    about: str = ""


class Parameter(Part):
    index: int = Field(ge=0, le=65535)
    unit: str
    default: float
    low: float
    high: float
    when: Literal["any", "resting"] = "any"
    about: str = ""


class Sensor(Part):
    gain: Toleranced
    offset: Toleranced


class Envelope(Part):
    """Protection range. `telemetry` bounds |value| of channels in SI; `levitated` only while the rotor is levitated."""

    max_hung_kg: float = Field(gt=0)
    max_current_A: float = Field(gt=0)
    max_speed_rad_s: float = Field(gt=0)
    max_temperature_K: float = Field(gt=0)
    max_levitated_position_m: float = Field(gt=0)


class RigFile(Part):
    """A whole rig file. Lengths of `geometry` are distances, all positive."""

    schema_: int = Field(alias="schema")
    name: str
    title: str
    uut: Uut
    site: Site
    laboratory: Mapping[str, str] = {}
    links: Mapping[str, LinkSpec]
    devices: Mapping[str, Device]
    channels: Mapping[str, Channel]
    parameters: Mapping[str, Parameter]
    geometry: Mapping[str, Toleranced]
    masses: Mapping[str, Toleranced]
    mass_density: Toleranced
    hanger: Toleranced
    hook_seat: Toleranced
    sensors: Mapping[str, Sensor]
    envelope: Envelope
    plans: Mapping[str, Mapping[str, Any]] = {}
    simulation: Annotated[Mapping[str, Any], BeforeValidator(_simulated)] = {}
    toml_text: str = Field("", exclude=True)
    dbc_text: str = Field("", exclude=True)
    path: str = Field("", exclude=True)

    @classmethod
    def parse(cls, toml_text: str, dbc_text: str, path: str = "rig.toml") -> RigFile:
        """A rig file from its text.

        Raises:
            ConfigError: it is not TOML, of a newer schema, or breaks a rule; every problem is in it.
        """
        data = migrated(_toml(toml_text, path), path)
        try:
            return cls.model_validate({**data, "toml_text": toml_text, "dbc_text": dbc_text, "path": path})
        except ValidationError as error:
            problems = tuple(_problem(e, path) for e in error.errors(include_url=False))
            raise ConfigError(f"rig file {path} cannot be used:", problems) from error

    @property
    def digest(self) -> str:
        """SHA-256 over the TOML and the DBC text."""
        return hashlib.sha256(self.toml_text.encode() + b"\0" + self.dbc_text.encode()).hexdigest()

    @cached_property
    def messages(self) -> MessageMap:
        """The message map of the rig's DBC."""
        return load_messages(self.dbc_text, self.link.dbc)

    @property
    def link(self) -> LinkSpec:
        """The controller's link."""
        return self.links[self.devices["controller"].link]


def _toml(text: str, path: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"rig file {path}: not TOML: {error}") from error


def migrated(data: dict[str, Any], path: str) -> dict[str, Any]:
    """The data in today's schema.

    Raises:
        ConfigError: no schema, a newer one, or one that no migration reaches.
    """
    schema = data.get("schema")
    if not isinstance(schema, int) or schema > SCHEMA:
        newer = "; it was written for a newer Levbench" if isinstance(schema, int) else ""
        raise ConfigError(f"rig file {path}: schema: found {schema!r}; expected {SCHEMA}{newer}")
    while schema < SCHEMA:
        if schema not in MIGRATIONS:
            raise ConfigError(f"rig file {path}: schema: found {schema}; no way from there to {SCHEMA}")
        data = {**MIGRATIONS[schema](data), "schema": schema + 1}
        schema += 1
    return data


def _problem(error: Any, path: str) -> Problem:
    key = ".".join(str(part) for part in error["loc"] if part != "schema_") or "(file)"
    found = "nothing" if error["type"] == "missing" else repr(error.get("input"))
    if error["type"] != "missing" and isinstance(error.get("input"), dict):
        found = "a table with " + ", ".join(error["input"])
    expected = {"missing": "a value", "extra_forbidden": "no such key"}.get(error["type"], error["msg"])
    return Problem(path, key, found, expected)


@dataclass(frozen=True)
class RigText:
    """A rig file's two texts and where it lies."""

    path: Path
    toml: str
    dbc: str


def read_rig(rig: str) -> RigText:
    """The texts of a rig: a path, else a name in `./rigs`, else in the installed `rigs/`.

    Raises:
        ConfigError: unknown rig, unreadable file, or a DBC that is not there.
    """
    path = catalogue.rig_path(rig)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"rig file {path}: cannot be read: {error}") from error
    data = _toml(text, str(path))
    links = data.get("links", {})
    dbc, encoding = "", "utf-8"
    for link in links.values() if isinstance(links, dict) else ():
        if isinstance(link, dict) and isinstance(link.get("dbc"), str):
            dbc, encoding = link["dbc"], str(link.get("encoding", "utf-8"))
    if not dbc:
        raise ConfigError(f'rig file {path}: links: found no dbc; expected [links.NAME] with dbc = "FILE.dbc"')
    try:
        return RigText(path, text, (path.parent / dbc).read_text(encoding=encoding))
    except (OSError, UnicodeDecodeError, LookupError) as error:
        raise ConfigError(f"rig file {path}: dbc: cannot read {path.parent / dbc}: {error}") from error


def load_rig(rig: str) -> RigFile:
    """A rig, checked in full (see `bench.rigcheck`).

    Raises:
        ConfigError: with every problem that was found.
    """
    from bench.rigcheck import problems_of

    text = read_rig(rig)
    loaded = RigFile.parse(text.toml, text.dbc, str(text.path))
    problems = problems_of(loaded)
    if problems:
        raise ConfigError(f"rig file {text.path} cannot be used:", tuple(problems))
    return loaded
