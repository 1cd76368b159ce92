"""What two runs differ in beside their results: plan, machine, parameters, certificates, calibrations, versions."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from bench.record.records import Record
from bench.record.setup import Certified

NOT_SAID = "not said"


@dataclass(frozen=True)
class Differs:
    """One thing: `what` it belongs to (`plan`, `rig`, `parameters`, `firmware`, `certificates`, `calibrations`, `versions`),
    its key there, and what each run has. A record of before schema 3 says neither parameters nor firmware nor certificates."""

    what: str
    key: str
    a: str
    b: str


def differing(a: Record, b: Record) -> tuple[Differs, ...]:
    """All that the records of two runs say."""
    return tuple(_differing(a, b))


def _differing(a: Record, b: Record) -> Iterator[Differs]:
    yield from _of("plan", a.plan, b.plan)
    yield from _of("rig", _machine(a), _machine(b))
    if a.setup is not None and b.setup is not None:
        yield from _of("parameters", a.setup.parameters, b.setup.parameters)
        yield from _of("firmware", {"": a.setup.firmware}, {"": b.setup.firmware})
        yield from _certificates(a.setup.certified, b.setup.certified)
    used = ({c.procedure: c.run_id for c in record.calibrations} for record in (a, b))
    yield from _of("calibrations", *used)
    yield from _of("versions", a.versions, b.versions)


def _machine(record: Record) -> dict[str, Any]:
    digest = {} if record.setup is None else {"file": record.setup.rig_sha256[:12]}
    return {"name": record.rig, **record.uut, "seed": record.seed, "visit": record.visit, **digest}


def _certificates(a: Mapping[str, Certified], b: Mapping[str, Certified]) -> Iterator[Differs]:
    """Of those that both results rest on: another certificate of the same number says so by its name alone."""
    for identity in sorted(a.keys() & b.keys()):
        one, other = a[identity], b[identity]
        if one != other:
            yield Differs("certificates", identity, _told(one), _told(other))


def _told(c: Certified) -> str:
    number = f"{c.value:.8g}{'' if c.unit == '1' else f' {c.unit}'}, u {c.standard_uncertainty:.3g} ({c.distribution})"
    return f"{number}, {c.certificate}" if c.certificate else number


def _of(what: str, a: Mapping[str, Any], b: Mapping[str, Any]) -> Iterator[Differs]:
    for key in dict.fromkeys((*a, *b)):
        if a.get(key) != b.get(key):
            yield Differs(what, key, _text(a, key), _text(b, key))


def _text(found: Mapping[str, Any], key: str) -> str:
    value = found.get(key)
    if value is None or value == "":
        return NOT_SAID if key not in found or value == "" else "none"
    return value if isinstance(value, str) else json.dumps(value, default=dict)
