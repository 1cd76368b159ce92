"""Calibrations as JSON: the file beside the rig, and the attachment of a recording. Read strictly, written whole.

An adopted one carries the SHA-256 of its content. It tells a slip (an edited number, a bad merge) and no forgery: whoever
changes the content can compute the digest again.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import date, datetime
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Literal

from pydantic import ConfigDict, TypeAdapter, ValidationError

from bench.calibration.calibration import Backend, Calibration, Certificate, Used
from bench.errors import ConfigError, Problem
from bench.schema import STRICT, require_schema
from bench.uncertainty import Distribution, Estimate, Influence
from bench.wholefile import write_whole

SCHEMA = 1
SHOWN = 12  # digits of a digest in a message


@dataclass(frozen=True)
class _Influence:
    """An influence; its identity is its key. `dof` None is infinite."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    name: str
    u: float
    unit: str
    kind: Literal["A", "B"]
    distribution: Distribution
    dof: float | None
    source: str


@dataclass(frozen=True)
class _Value:
    """A value with its sensitivities by identity."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    value: float
    unit: str
    sensitivities: Mapping[str, float]


@dataclass(frozen=True)
class _File:
    """The file, schema 1. `digest` is None where it has none."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    schema: Literal[1]
    procedure: str
    rig: str
    uut: str
    backend: Backend
    seed: int | None
    run_id: str
    date: str
    due: str
    outcome: str
    sha256: str
    levbench: str
    settings: Mapping[str, float]
    used: tuple[Used, ...]
    certificates: Mapping[str, Certificate]
    influences: Mapping[str, _Influence]
    values: Mapping[str, _Value]
    digest: str | None = None


@cache
def _adapter() -> TypeAdapter[_File]:
    """Made when a file is read: most of what imports this reads none."""
    return TypeAdapter(_File)


def to_json(calibration: Calibration) -> str:
    """The calibration as the text of its file.

    Raises:
        ValueError: a number is NaN or infinite.
    """
    return json.dumps(content(calibration), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def content(calibration: Calibration) -> dict[str, Any]:
    """The calibration as plain data, with its digest where it is sealed.

    Raises:
        ValueError: it is sealed, and a number is NaN or infinite.
    """
    c = calibration
    influences = {
        i.id: _Influence(i.name, i.u, i.unit, i.kind, i.distribution, None if math.isinf(i.dof) else i.dof, i.source)
        for i in sorted(c.influences.values(), key=lambda i: i.id)
    }
    values = {
        name: _Value(e.value, e.unit, {i.id: x for i, x in sorted(e.sensitivities.items(), key=lambda s: s[0].id)})
        for name, e in c.values.items()
    }
    file = _File(
        schema=1, procedure=c.procedure, rig=c.rig, uut=c.uut, backend=c.backend, seed=c.seed, run_id=c.run_id, date=c.date,
        due=c.due, outcome=c.outcome, sha256=c.sha256, levbench=c.levbench, settings=dict(c.settings), used=c.used,
        certificates=dict(c.certificates), influences=influences, values=values,
    )  # fmt: skip
    found = dataclasses.asdict(file)
    del found["digest"]
    return found | ({"digest": digest_of(found)} if c.sealed else {})


def digest_of(content: Mapping[str, Any]) -> str:
    """SHA-256 of a file's content without its digest: JSON with sorted keys, no spaces, other than ASCII as escapes, every
    number as a float, so that it does not depend on how the file is set.

    Raises:
        ValueError: a number is NaN or infinite.
    """
    bare = _canonical({key: value for key, value in content.items() if key != "digest"})
    text = json.dumps(bare, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode("ascii")).hexdigest()


def _canonical(value: Any) -> Any:
    """Plain data with its numbers as floats; 3 and 3.0 are the same, -0.0 and 0 too."""
    if isinstance(value, Mapping):
        return {key: _canonical(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_canonical(part) for part in value]
    if isinstance(value, float) or (type(value) is int and abs(value) < 1 << 53):
        return float(value) + 0.0
    return value


def from_json(text: str, name: str = "calibration") -> Calibration:
    """The calibration in `text`; `name` stands in the messages.

    Raises:
        ConfigError: not a calibration, a newer one, unknown or missing keys, NaN, numbers that cannot be.
    """
    require_schema(text, name, "calibration", SCHEMA)
    try:
        file = _adapter().validate_json(text)
    except (ValidationError, UnicodeEncodeError) as error:
        listed = [str(error)]
        if isinstance(error, ValidationError):
            listed = [f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors(include_url=False)]
        raise ConfigError("\n  ".join([f"{name}: not a calibration of schema {SCHEMA}:", *listed])) from error
    made = _calibration(file, name)
    if file.digest is not None:
        _require_digest(file.digest, digest_of(json.loads(text)), file.run_id, name)
    return made


def _require_digest(carried: str, found: str, run_id: str, name: str) -> None:
    """Raises ConfigError where the content is not that which the digest was taken of."""
    if carried != found:
        expected = f"sha256 {carried[:SHOWN]}..., which the file carries; adopt run {run_id} again"
        problem = Problem(name, "digest", f"content with sha256 {found[:SHOWN]}...", expected)
        raise ConfigError(f"{name}: the file was changed since it was adopted; it is not used", (problem,))


def _calibration(file: _File, name: str) -> Calibration:
    try:
        influences = {
            key: Influence(
                key, i.name, i.u, i.unit, i.kind, i.distribution, math.inf if i.dof is None else i.dof, i.source
            )
            for key, i in file.influences.items()
        }
        values = {key: _estimate(key, v, influences) for key, v in file.values.items()}
        for text in (file.date, *(u.date for u in file.used)):
            if datetime.fromisoformat(text).tzinfo is None:
                raise ConfigError(f"date: found {text!r}; expected a time with its zone, as 2026-11-21T10:00:00+00:00")
        for text in (file.due, *(u.due for u in file.used)):
            date.fromisoformat(text)
        for text in (file.sha256, *(u.sha256 for u in file.used)):
            if len(text) != 64 or set(text) - set("0123456789abcdef"):
                raise ConfigError(f"sha256: found {text!r}; expected 64 hexadecimal digits")
        if (file.backend == "sim") != (file.seed is not None):
            raise ConfigError(f"seed: found {file.seed} with backend {file.backend}; expected one where it is sim")
    except Exception as error:
        raise ConfigError(f"{name}: {error}") from error
    return Calibration(
        procedure=file.procedure, values=values, settings=file.settings, run_id=file.run_id, date=file.date, due=file.due,
        rig=file.rig, uut=file.uut, backend=file.backend, seed=file.seed, outcome=file.outcome, sha256=file.sha256,
        levbench=file.levbench, used=file.used, certificates=file.certificates,
        sealed=file.digest is not None,
    )  # fmt: skip


def _estimate(key: str, stored: _Value, influences: Mapping[str, Influence]) -> Estimate:
    unknown = set(stored.sensitivities) - set(influences)
    if unknown:
        raise ConfigError(
            f"values.{key}: found sensitivities to {', '.join(sorted(unknown))}; expected influences listed"
        )
    estimate = Estimate(stored.value, stored.unit, {influences[i]: c for i, c in stored.sensitivities.items()})
    if not math.isfinite(estimate.u):
        raise ConfigError(f"values.{key}: found an infinite uncertainty; expected finite contributions")
    return estimate


def read(path: Path) -> Calibration:
    """The calibration in a file.

    Raises:
        ConfigError: it cannot be read, or is not a calibration that this version knows.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}; expected a calibration file") from error
    return from_json(text, str(path))


def write(path: Path, calibration: Calibration) -> None:
    """Write or replace the file, whole or not at all.

    Raises:
        OSError, ValueError: nothing was replaced.
    """
    write_whole(path, to_json(calibration))


def attachment(calibrations: Iterable[Calibration]) -> str:
    """The calibrations that a run uses, whole, as its recording carries them."""
    entries = [{"state": c.state, "calibration": content(c)} for c in calibrations]
    return json.dumps(entries, ensure_ascii=False, allow_nan=False)


def attached(text: str, name: str) -> tuple[Calibration, ...]:
    """The calibrations in a recording's attachment; `name` stands in the messages.

    Raises:
        ConfigError: it cannot be understood.
    """
    try:
        entries = json.loads(text)
        if not isinstance(entries, list):
            raise TypeError(f"found a {type(entries).__name__}; expected a list")
        parts = [(e["state"], json.dumps(e["calibration"])) for e in entries]
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise ConfigError(f"{name}: calibrations.json cannot be understood: {error!r}") from error
    out = []
    for state, part in parts:
        if state not in ("current", "expired"):
            raise ConfigError(f"{name}: calibrations.json: state: found {state!r}; expected current or expired")
        out.append(dataclasses.replace(from_json(part, name), expired=state == "expired"))
    return tuple(out)
