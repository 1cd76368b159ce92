"""What can be wrong with what was recorded of a stage, whatever was done then: its axes were not held, telemetry came late."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.recording import Step
from bench.rigfile import RigFile
from bench.rigfile.binding import STAGE_HELD


def few(where: str, found: str, expected: int, step: Step) -> AnalysisError:
    """A step `where` so few samples were `found` that it tells nothing, and what to do if telemetry came late. A machine that
    is served, and falls behind the clock, takes a command at once and goes by its own time, which is earlier: by as much its
    motion lies before the step that was to hold it."""
    text = f"{where}: found {found}; expected {expected} or more"
    count, most = step.late()
    if count:
        text += (
            f". Telemetry came late: {count} of the step's {step.expected()} samples, up to {most:.1f} s. Most likely the "
            "controller had fallen behind the host's clock, so that by its own time the motion began as much before the step. "
            "Free the computer that serves it (a real controller: look at its link), and run again"
        )
    return AnalysisError(text)


def not_held(told: Iterable[tuple[str, Collection[str]]], rig: RigFile) -> Finding | None:
    """The first of the steps, each by where it was and the states that the controller was in, in which it did not hold its
    axes."""
    for where, states in told:
        if other := [s for s in states if rig.binding.mode(s) not in STAGE_HELD]:
            text = f"the controller was in {', '.join(other)}: it did not hold the axes"
            return Finding("axis-not-held", text, where, Effect.ERROR)
    return None
