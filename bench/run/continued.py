"""What the recording of a continued run says of the runs before it: entries of the record, and findings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from bench.errors import RecordingError
from bench.findings import Effect, Finding
from bench.record.sources import ContinuedRun
from bench.recording import Recording
from bench.recording.earlier import CONTINUED

IDENTITY: Final = "identity"
"""Event: what the controller says that it is."""


def continued_runs(recording: Recording[Any]) -> tuple[ContinuedRun, ...]:
    """The stopped runs whose steps it took over, oldest first.

    Raises:
        RecordingError: what it says of them cannot be understood.
    """
    return tuple(_understood(recording, e) for e in recording.events(CONTINUED))


def findings(recording: Recording[Any]) -> Iterator[Finding]:
    """A note for each seam, and what the runs before it had found on their way.

    Raises:
        RecordingError: as for `continued_runs`.
    """
    for event, run in zip(recording.events(CONTINUED), continued_runs(recording), strict=True):
        yield Finding(CONTINUED, _told(event, run), run.run_id)
        for name, then in event.get("versions", {}).items():
            text = f"{run.run_id} was recorded with {name} {then}; this run with {recording.versions.get(name)}"
            yield Finding("continued-by-another-version", text, run.run_id)
        for f in event.get("findings", ()):
            where = f"{f['where']}, {run.run_id}" if f["where"] else run.run_id
            yield Finding(f["code"], f["text"], where, Effect(f["effect"]), tuple(f["concerns"]))


def identity(recording: Recording[Any]) -> Mapping[str, float] | None:
    """What the controller said that it is when its newest part began; None of an older recording."""
    said = recording.events(IDENTITY)
    return said[-1].get("said", {}) if said else None


def _understood(recording: Recording[Any], event: Mapping[str, Any]) -> ContinuedRun:
    try:
        for f in event["findings"]:
            Finding(f["code"], f["text"], f["where"], Effect(f["effect"]), tuple(f["concerns"]))
        return ContinuedRun(
            run_id=str(event["run_id"]), file=str(event["file"]), sha256=str(event["sha256"]), steps=int(event["steps"]),
            started=str(event["started"]), stopped=str(event["stopped"]),
        )  # fmt: skip
    except (KeyError, TypeError, ValueError) as error:
        raise RecordingError(f"{recording.path}: its event {CONTINUED} cannot be read: {error!r}") from error


def _told(event: Mapping[str, Any], run: ContinuedRun) -> str:
    waited = (event["t_ns"] - int(event["end_ns"])) * 1e-9
    long = (
        f"{waited:.0f} s" if waited < 120 else f"{waited / 60:.0f} min" if waited < 7200 else f"{waited / 3600:.1f} h"
    )
    known = "" if run.stopped != "killed" else " What its link did is not known: it could not write that any more."
    return (
        f"the first {run.steps} steps are those of {run.run_id}, which was stopped ({run.stopped}); it went on "
        f"{long} after the last of them, on a machine that was brought up again.{known}"
    )
