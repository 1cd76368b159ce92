"""What a run was made with, beside its plan: the rig file, the parameters of the controller, and of the numbers that results
rest on what the rig file said. Two runs are compared by it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar

from pydantic import ConfigDict

from bench.rigfile import RigFile
from bench.rigfile.certificates import certified_numbers
from bench.rigfile.toleranced import Toleranced
from bench.schema import STRICT


@dataclass(frozen=True)
class Certified:
    """What the rig file says of an influence: value and standard uncertainty in `unit`, SI; `certificate` is the one that it
    goes by, in words, "" where the file names none."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    value: float
    standard_uncertainty: float
    unit: str
    distribution: str
    certificate: str


@dataclass(frozen=True)
class Setup:
    """`rig_sha256` is the digest of rig file and DBC; `firmware` what the controller says of itself, as the rig file has
    it, "" where that expects nothing; `parameters` of the controller as the run set them, in the rig file's unit; `aliases` the
    rig's own names of quantities; `certified` the rig file's numbers that the results rest on, by the influence's identity."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    rig_sha256: str
    firmware: str
    parameters: Mapping[str, float]
    aliases: Mapping[str, str]
    certified: Mapping[str, Certified] = field(default_factory=dict)


def setup_of(rig: RigFile, settings: Mapping[str, float]) -> Setup:
    """Of a run that sets `settings`; every other parameter has the rig file's default."""
    defaults = {name: p.default for name, p in rig.parameters.items()}
    return Setup(rig.digest, firmware_of(rig), {**defaults, **settings}, dict(rig.aliases))


def firmware_of(rig: RigFile) -> str:
    """What the handshake has found the controller to say, since it would have refused anything else."""
    device = rig.devices["controller"]
    stated = {"protocol": device.protocol, "map version": device.map_version}
    return ", ".join(f"{name} {number}" for name, number in stated.items() if number is not None)


def certified_of(rig: RigFile, identities: Iterable[str]) -> dict[str, Certified]:
    """What the rig file says of those of the influences that stand in it."""
    known = {**certified_numbers(rig), "masses/density": rig.mass_density, "masses/hanger": rig.hanger}
    return {i: _certified(rig, known[i]) for i in sorted(set(identities)) if i in known}


def _certified(rig: RigFile, number: Toleranced) -> Certified:
    c = rig.certificates.get(number.certificate)
    words = "" if c is None else ", ".join(filter(None, (c.number, c.laboratory, c.date)))
    return Certified(number.value, number.standard_uncertainty, number.unit, number.distribution, words)
