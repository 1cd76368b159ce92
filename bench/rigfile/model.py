"""The rig file: a rig as data. TOML for what the nameplate and the certificates say, a DBC for the message map.

The `[simulation]` table is parsed like the rest and read by the simulated backend alone.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from functools import cached_property, lru_cache
from typing import Annotated, Any, Literal
from urllib.parse import parse_qsl

from pydantic import BeforeValidator, Field, ValidationError, model_validator

from bench import units
from bench.errors import ConfigError, Problem
from bench.rigfile.binding import Binding
from bench.rigfile.capabilities import Capabilities
from bench.rigfile.capture import CaptureSpec
from bench.rigfile.commandline import CommandLine
from bench.rigfile.elements import FORMS, MachineTables, Name
from bench.rigfile.former_names import with_aliases
from bench.rigfile.former_parameters import with_capabilities
from bench.rigfile.messages import MessageMap, load_messages
from bench.rigfile.part import Part
from bench.rigfile.people import Customer, Laboratory
from bench.rigfile.registers import Bounds, Register
from bench.rigfile.text import SCHEMA, migrated, parse_text
from bench.rigfile.toleranced import UNKNOWN_UNIT, Toleranced, simulated
from bench.schema import expected_of


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
    """A link by its URL (see `bench.rigfile.linkurl`); `dbc` where messages travel, bit rates where it is a CAN bus."""

    url: str
    bitrate: float | None = Field(None, gt=0)
    data_bitrate: float | None = Field(None, gt=0)
    dbc: str = ""
    encoding: str = "utf-8"
    options: Mapping[str, str | int | float | bool] = {}  # passed on to the interface's library as they are
    reconnect_s: float = Field(0.0, ge=0, le=30)  # how long to try again after the link was lost; 0: not at all
    heartbeat: Literal["process", "thread"] = "process"

    @property
    def classic(self) -> bool:
        """A CAN bus without CAN FD: a bit rate, no data bit rate, and no setting `fd` of the interface."""
        scheme, _, rest = self.url.partition(":")
        fd = self.options.get("fd", dict(parse_qsl(rest.partition("?")[2])).get("fd", "false"))
        asked = str(fd).lower() not in ("false", "0")
        return (
            scheme.lower() not in ("serial", "cli")
            and self.bitrate is not None
            and self.data_bitrate is None
            and not asked
        )


Role = Literal["levitation", "rotation", "motion", "operator", "drive", "supply", "thermal"]


class Device(Part):
    """A device in its roles. `protocol` and `map_version` are what a controller's Identity must say; `registers`,
    `commands` and `faults` are a Modbus device's."""

    link: str
    roles: tuple[Role, ...]
    protocol: int | None = None
    map_version: int | None = None
    tick_s: float = Field(1e-4, gt=0)
    binding: Binding = Binding()
    unit: int = Field(1, ge=0, le=255)
    word_order: Literal["big", "little"] = "big"
    poll_s: float = Field(0.2, ge=0.02)
    registers: Mapping[str, Register] = {}
    commands: Mapping[str, Mapping[str, int]] = {}
    faults: Mapping[str, str] = {}


class Channel(Part):
    """`noise`: the least standard deviation of its readings while the rotor is held, SI. `protect`: a limit of its own, in
    place of its kind's; `unprotected`: why it has none (see `bench.rigfile.protection`)."""

    signal: str
    unit: str
    about: str = ""
    noise: float | None = Field(None, gt=0)
    protect: Bounds | None = None
    unprotected: str = ""


class Parameter(Part):
    """What the controller lets the host set: by `index` (ParamSet), or by a `signal` of one of its own messages."""

    index: int | None = Field(None, ge=0, le=65535)
    signal: str = ""
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
    """Protection range: limits of kinds; what the machine does not have needs none. `positions` are the channels that
    `max_levitated_position_m` bounds while the rotor is held (None: every position); the supply's voltage, channel `supply`,
    is bounded then too."""

    max_hung_kg: float = Field(ge=0)
    max_current_A: float = Field(math.inf, gt=0)
    max_speed_rad_s: float = Field(math.inf, gt=0)
    max_temperature_K: float = Field(math.inf, gt=0)
    max_levitated_position_m: float = Field(math.inf, gt=0)
    max_trial_weight_kg: float = Field(0.0, ge=0)  # in a balancing plane
    max_injection_A: float = Field(0.0, ge=0)  # into the current reference of an axis, greatest value of the sum
    min_supply_V: float | None = Field(None, gt=0)
    max_supply_V: float | None = Field(None, gt=0)
    max_drive_torque_Nm: float | None = Field(None, gt=0)
    positions: tuple[str, ...] | None = None
    supply: str = "supply"


class CalibrationTable(Part):
    """For how many days a calibration by each procedure holds."""

    interval_days: Mapping[str, int] = {}


class RigFile(MachineTables):
    """A whole rig file. Lengths of `geometry` are distances, all positive. A rig without `masses` may leave out what
    belongs to them."""

    schema_: int = Field(alias="schema")
    name: str
    title: str
    uut: Uut
    site: Site
    laboratory: Laboratory | None = None
    customer: Customer | None = None
    links: Mapping[str, LinkSpec]
    devices: Mapping[str, Device]
    channels: Mapping[str, Channel]
    parameters: Mapping[str, Parameter] = {}
    geometry: Mapping[str, Toleranced] = {}
    masses: Mapping[str, Toleranced] = {}
    mass_density: Toleranced
    hanger: Toleranced
    hook_seat: Toleranced
    sensors: Mapping[str, Sensor] = {}
    machine: Mapping[str, Toleranced] = {}
    calibration: CalibrationTable = CalibrationTable()
    capture: CaptureSpec | None = None
    commandline: CommandLine | None = None
    envelope: Envelope
    capabilities: Capabilities = Capabilities()
    aliases: Mapping[Name, Annotated[str, Field(pattern=r"^[^@]+@[^@]+$")]] = {}
    plans: Mapping[str, Mapping[str, Any]] = {}
    simulation: Annotated[Mapping[str, Any], BeforeValidator(simulated)] = {}
    toml_text: str = Field("", exclude=True)
    dbc_text: str = Field("", exclude=True)
    path: str = Field("", exclude=True)
    written_in: int = Field(SCHEMA, exclude=True)  # the schema that the text has

    @model_validator(mode="before")
    @classmethod
    def _nothing_hangs(cls, data: Any) -> Any:
        if not isinstance(data, dict) or data.get("masses"):
            return data
        none = {"value": 0, "half_width": 0, "distribution": "rectangular", "source": "nothing hangs on this rig"}
        absent = {"mass_density": none | {"unit": "kg/m^3"}, "hanger": none | {"unit": "kg"},
                  "hook_seat": none | {"unit": "m"}}  # fmt: skip
        envelope = data.get("envelope")
        if isinstance(envelope, dict):
            absent["envelope"] = {"max_hung_kg": 0.0, **envelope}
        return {**data, **{k: v for k, v in absent.items() if k == "envelope" or k not in data}}

    @classmethod
    def parse(cls, toml_text: str, dbc_text: str, path: str = "rig.toml") -> RigFile:
        """A rig file from its text.

        Raises:
            ConfigError: it is not TOML, of a newer schema, or breaks a rule; every problem is in it.
        """
        return _parsed(toml_text, dbc_text, path)

    @property
    def digest(self) -> str:
        """SHA-256 over the TOML and the DBC text."""
        return hashlib.sha256(self.toml_text.encode() + b"\0" + self.dbc_text.encode()).hexdigest()

    @cached_property
    def messages(self) -> MessageMap:
        """The message map of the rig's DBC."""
        return load_messages(self.dbc_text, self.link.dbc, classic=self.link.classic)

    @property
    def binding(self) -> Binding:
        """How the controller's messages are used."""
        return self.devices["controller"].binding

    def link_of(self, role: Role) -> str | None:
        """The name of the link of the device in a role; None without one."""
        return next((d.link for d in self.devices.values() if role in d.roles), None)

    def choices(self, channel: str) -> Mapping[int, str]:
        """The names of a channel's codes, from the DBC's value table."""
        message, _, signal = self.channels[channel].signal.partition(".")
        return self.messages[message].signal(signal).choices

    def noisy(self, channel: str) -> bool:
        """Whether the readings of a channel must differ while the rotor is held: its stated noise is above one count."""
        c = self.channels[channel]
        message, _, signal = c.signal.partition(".")
        s = self.messages[message].signal(signal)
        return c.noise is not None and c.noise > abs(s.scale * units.UNITS[s.unit].factor)

    @property
    def link(self) -> LinkSpec:
        """The controller's link."""
        return self.links[self.devices["controller"].link]


@lru_cache(maxsize=8)
def _parsed(toml_text: str, dbc_text: str, path: str) -> RigFile:
    """A rig file is frozen, and a chain of virtual runs reads the same one a dozen times."""
    stated = parse_text(toml_text, path)
    data = with_aliases(with_capabilities(migrated(stated, path)))
    around = {"toml_text": toml_text, "dbc_text": dbc_text, "path": path, "written_in": stated["schema"]}
    try:
        return RigFile.model_validate({**data, **around})
    except ValidationError as error:
        problems = tuple(_problem(e, path) for e in error.errors(include_url=False))
        raise ConfigError(f"rig file {path} cannot be used:", problems) from error


def _problem(error: Any, path: str) -> Problem:
    key = ".".join(str(part) for part in error["loc"] if part not in ("schema_", "[key]", *FORMS)) or "(file)"
    if error["type"] == UNKNOWN_UNIT:
        symbol = error["ctx"]["symbol"]
        return Problem(path, f"{key}.unit", repr(symbol), units.expected(symbol))
    found = "nothing" if error["type"] == "missing" else repr(error.get("input"))
    if error["type"] != "missing" and isinstance(error.get("input"), dict):
        found = "a table with " + ", ".join(error["input"])
    return Problem(path, key, found, expected_of(error))
