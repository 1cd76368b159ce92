"""A run that was stopped: what is left of it, whether it can be continued, and what must be as it was.

Refused, before anything starts: a run that is still being written, one that came to its end, one in which nothing was
completed, a procedure that cannot go on in the middle; another rig, plan or controller than then.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import asdict, replace
from datetime import UTC, datetime
from typing import Any, Final

from bench import lock
from bench.errors import ConfigError, RecordingError
from bench.inputfile import parse_toml
from bench.procedure import Procedure
from bench.record.records import read_record
from bench.recording import Recording, layout
from bench.recording.earlier import Earlier, left_in
from bench.rigfile import RigFile
from bench.run.continued import identity
from bench.run.evaluation import TRUNCATED, Ending
from bench.run.provenance import versions
from bench.rundir import RunDirectory

NOTHING: Final = "; nothing was started."
OF_THE_END: Final = ("make-safe-failed", "controller-fault", "drive-fault", "state-contradicts", "interlock")
"""Codes of what is seen while a machine is made safe: nothing of it is in a completed step."""
MOST_TOLD = 8


def opened(run: RunDirectory) -> Recording[Any]:
    """The recording of a run that nobody writes any more.

    Raises:
        ConfigError: somebody does, there is none, or it cannot be read.
    """
    if not run.recording.is_file():
        raise ConfigError(
            f"{run.path}: holds no recording.mcap; expected one. The run ended before it could record{NOTHING} "
            "Next: run it anew"
        )
    try:
        if lock.is_held(run.recording):
            raise ConfigError(
                f"{run.path}: this run is still being written; expected one that was stopped{NOTHING} Next: wait for its end, "
                "or stop it"
            )
        found: Recording[Any] = Recording.open(run.recording)
    except (RecordingError, OSError) as error:
        raise ConfigError(f"{run.path}: cannot be continued{NOTHING} {error}") from error
    if found.version != layout.VERSION:
        raise ConfigError(
            f"{run.path}: recorded by an older Levbench: layout version: found {found.version}; expected {layout.VERSION}"
            f"{NOTHING} Next: run it anew"
        )
    return found


def left_of(run: RunDirectory, recording: Recording[Any], procedure: Procedure) -> Earlier:
    """What was completed of a run of this procedure.

    Raises:
        ConfigError: it came to its end, or nothing was completed.
    """
    try:
        whole = procedure.whole(recording.rig, recording.plan_as(procedure.plan))
        earlier = left_in(recording, procedure.continues, whole)
        ending = Ending.read(recording)
        done = [s for s in earlier.steps if s.kind == procedure.continues]
        if ending.stopped is None:
            raise ConfigError(
                f"{run.path}: this run came to its end; expected one that was stopped{NOTHING} Next: its report, or "
                f"`bench analyse {shlex.quote(str(run.path))}`"
            )
        if not done:
            kind = procedure.continues
            found = f"no step {kind!r} that was" if whole == 1 else f"no {whole} steps {kind!r} in a row that were"
            raise ConfigError(
                f"{run.path}: found {found} completed: there is nothing to continue{NOTHING} Next: {anew(recording)}"
            )
        return replace(earlier, told=_told(run, earlier, ending))
    except RecordingError as error:
        raise ConfigError(f"{run.path}: cannot be continued{NOTHING} {error}") from error


def anew(recording: Recording[Any]) -> str:
    """The command that makes such a run anew, on the same kind of rig."""
    live = " --backend live" if recording.run.get("backend") == "live" else ""
    return f"`bench run {recording.procedure} --rig {recording.rig.name}{live}`"


def _told(run: RunDirectory, earlier: Earlier, ending: Ending) -> dict[str, Any]:
    """What the seam says: provenance, why it was stopped, and what it had found that concerns its steps."""
    recording = earlier.recording
    killed = ending.findings[0].code == TRUNCATED
    others = [] if killed else [f for f in ending.findings[1:] if f.code not in (*OF_THE_END, ending.findings[0].code)]
    now = versions()
    return {
        "run_id": recording.wall.get("run_id", run.run_id),
        "file": run.recording.name,
        "sha256": recording.digest(),
        "steps": len(earlier.steps),
        "end_ns": earlier.end_ns,
        "started": _started(run, recording),
        "stopped": "killed" if killed else ending.findings[0].code,
        "findings": [asdict(f) for f in others],
        "versions": {k: v for k, v in recording.versions.items() if k in now and now[k] != v},
    }


def _started(run: RunDirectory, recording: Recording[Any]) -> str:
    if recording.wall.get("started"):
        return recording.wall["started"]
    try:
        return read_record(run.record).started
    except ConfigError:
        return datetime.fromtimestamp(recording.start_ns * 1e-9, UTC).isoformat(timespec="seconds")


def require_same_rig(recording: Recording[Any], rig: RigFile) -> None:
    """Raises ConfigError where the rig file says anything else than when the run was made."""
    stored = recording.attachment("rig.toml"), recording.attachment("rig.dbc")
    found = list(differences(parse_toml(stored[0]), parse_toml(rig.toml_text)))
    if rig.dbc_text != stored[1]:
        found.append("its DBC differs")
    _refuse(recording, f"rig file {rig.path}", found, "give the rig file as it was, or run it anew")


def require_same_plan(recording: Recording[Any], plan: Mapping[str, Any]) -> None:
    """Raises ConfigError where a plan has other settings than the run was made with; both in SI."""
    found = list(differences(recording.plan_dict, json.loads(json.dumps(plan))))
    _refuse(recording, "plan", found, "leave --plan and --plan-file out, or run it anew")


def require_same_controller(earlier: Earlier, said: Mapping[str, float]) -> None:
    """Raises ConfigError where the controller says that it is another one than then: its firmware, or its number."""
    then = identity(earlier.recording)
    if then is not None and (found := list(differences(then, said))):
        told = "; ".join(f"controller: {text}" for text in found)
        raise ConfigError(
            f"{earlier.recording.path.parent}: cannot be continued on this controller{NOTHING} {told}. Next: connect that "
            "one with the firmware that it had, or run it anew"
        )


def require_later(earlier: Earlier, now_ns: int) -> None:
    """Raises ConfigError where the clock says that the stopped run has not ended yet."""
    if now_ns <= earlier.last_ns:
        late = (earlier.last_ns - now_ns) * 1e-9
        raise ConfigError(
            f"{earlier.recording.path.parent}: ends {late:.0f} s from now by this clock{NOTHING} Next: set the clock of this "
            "host"
        )


def differences(then: Mapping[str, Any], now: Mapping[str, Any], key: str = "") -> Iterator[str]:
    """Keys of which two tables say different things, a text each."""
    for name in dict.fromkeys((*then, *now)):
        a, b, where = then.get(name), now.get(name), f"{key}{name}"
        if isinstance(a, Mapping) and isinstance(b, Mapping):
            yield from differences(a, b, f"{where}.")
        elif a != b:
            yield f"{where}: found {_shown(b)}; the stopped run has {_shown(a)}"


def _shown(value: Any) -> str:
    if value is None:
        return "none"
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _refuse(recording: Recording[Any], what: str, found: list[str], then: str) -> None:
    if found:
        more = [f"and {len(found) - MOST_TOLD} more"] if len(found) > MOST_TOLD else []
        lines = [
            f"{recording.path.parent}: cannot be continued with another {what}{NOTHING} Next: {then}",
            *found[:MOST_TOLD],
            *more,
        ]
        raise ConfigError("\n  ".join(lines))


def can_continue(procedure: Procedure, run: RunDirectory) -> bool:
    """Whether a run that has just ended was stopped and left steps to go on from."""
    if not procedure.continues:
        return False
    try:
        return left_of(run, opened(run), procedure) is not None
    except ConfigError:
        return False
