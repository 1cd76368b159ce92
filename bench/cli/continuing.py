"""`bench run --continue RUN`: what was asked for of a stopped run is asked for again, where nothing else is.

What was asked for stands in the run's `asked.json`; procedure, backend, seed, visit, plan, limits and calibrations stand in its
recording, which is what counts.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Final, Literal

from pydantic import ConfigDict, TypeAdapter, ValidationError

from bench import catalogue, rundir
from bench.calibration import Calibration
from bench.calibration.file import attached
from bench.cli.loading import load_procedure
from bench.cli.request import Request
from bench.errors import ConfigError, RecordingError
from bench.procedure import Procedure
from bench.record.limits import Limit
from bench.recording import Recording
from bench.recording.earlier import Earlier
from bench.rigfile import RigFile
from bench.run import stopped
from bench.run.reanalysis import stored_limits
from bench.rundir import RunDirectory
from bench.schema import STRICT, require_schema

SCHEMA: Final = 1
MINUTE_NS: Final = 60_000_000_000


@dataclass(frozen=True)
class Asked:
    """`asked.json`: of a run that can be continued, what its recording does not say of how it was asked for."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    schema: Literal[1]
    rig: str  # path of the rig file
    truth: tuple[str, ...]
    links: tuple[str, ...]
    operator: str | None


_ASKED: TypeAdapter[Asked] = TypeAdapter(Asked)


def asked(request: Request, rig: RigFile) -> dict[str, Any]:
    """What asked.json says of a request."""
    found = Asked(1, str(Path(rig.path).resolve()), request.truth, request.links, request.operator)
    return dataclasses.asdict(found)


def resolved(request: Request, path: Path) -> tuple[Request, Earlier]:
    """The request of a run that goes on with the one at `path`, and what that one left.

    Raises:
        ConfigError: it cannot be continued, or is asked for otherwise than it was.
    """
    run = rundir.existing(path)
    recording = stopped.opened(run)
    procedure = _continuable(recording, run)
    earlier = stopped.left_of(run, recording, procedure)
    before = _read(run, recording)
    if differ := list(_contradicting(request, recording, before)):
        lines = [f"{path}: a stopped run goes on as it was begun; nothing was started:", *differ]
        raise ConfigError("\n  ".join([*lines, "Next: leave these options out, or run it anew"]))
    links = (*before.links, *request.links)  # of two for one link the later one counts
    return replace(
        request, procedure=procedure.name, rig=request.rig or before.rig, backend=_backend(recording),
        seed=recording.seed, visit=recording.visit, truth=before.truth, links=links if _backend(recording) == "live" else (),
        operator=request.operator or before.operator,
    ), earlier  # fmt: skip


def _continuable(recording: Recording[Any], run: RunDirectory) -> Procedure:
    """The procedure of a recording.

    Raises:
        ConfigError: it cannot go on in the middle.
    """
    found = load_procedure(recording.procedure)
    if found.continues:
        return found
    able = ", ".join(e.name for e in catalogue.PROCEDURES if load_procedure(e.name).continues)
    raise ConfigError(
        f"{run.path}: {found.name} cannot be continued: what the machine does between its steps matters, or they take no "
        f"operator's work; expected one of {able}. Nothing was started. Next: "
        f"{stopped.anew(recording)} anew"
    )


def _read(run: RunDirectory, recording: Recording[Any]) -> Asked:
    """What asked.json says; of an older run that has none, what its recording does.

    Raises:
        ConfigError: it cannot be read, or is of a newer schema.
    """
    if not run.asked.is_file():
        return Asked(1, recording.wall.get("rig_file", recording.run.get("rig", "")), (), (), None)
    try:
        text = run.asked.read_text(encoding="utf-8")
        require_schema(text, str(run.asked), "request", SCHEMA)
        return _ASKED.validate_json(text)
    except (OSError, ValueError, ValidationError) as error:
        raise ConfigError(f"{run.asked}: cannot be read: {error}; expected what was asked for") from error


def _contradicting(request: Request, recording: Recording[Any], before: Asked) -> Iterator[str]:
    """Options that say something else than the stopped run was asked for, a line each."""
    then = {
        "PROCEDURE": (request.procedure, recording.procedure), "--backend": (request.backend, _backend(recording)),
        "--seed": (request.seed, recording.seed), "--visit": (request.visit, recording.visit),
        "--truth": (request.truth, before.truth),
    }  # fmt: skip
    for option, (typed, stored) in then.items():
        if typed not in ("", None, (), stored):
            yield f"{option}: found {_told(typed)}; the stopped run has {_told(stored)}"
    given = {"--spec": request.spec, "--calibrations": request.calibrations, "--model": request.model}
    for name in (name for name, path in given.items() if path is not None):
        yield f"{name}: expected none; limits and calibrations are those of the stopped run"
    if request.require_verdict and not recording.verdict_required:
        yield "--require-verdict: the stopped run was not to give one"


def _told(value: object) -> str:
    if value in (None, ()):
        return "none"
    return " ".join(map(str, value)) if isinstance(value, tuple) else str(value)


def _backend(recording: Recording[Any]) -> str:
    return recording.run.get("backend", "sim")


def as_stored(earlier: Earlier) -> tuple[dict[str, Limit], tuple[Calibration, ...], bool]:
    """Limits and calibrations of the stopped run, and whether it was to give a verdict.

    Raises:
        ConfigError: they cannot be read.
    """
    recording = earlier.recording
    try:
        used = attached(recording.attachment("calibrations.json"), f"recording {recording.path}")
        return stored_limits(recording), tuple(used), recording.verdict_required
    except RecordingError as error:
        raise ConfigError(f"{error}; nothing was started") from error


def switched_on_ns(earlier: Earlier) -> int:
    """When a simulated machine is switched on again: at the second full minute after the stopped run ended."""
    return (earlier.last_ns // MINUTE_NS + 2) * MINUTE_NS
