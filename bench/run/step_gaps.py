"""Steps that miss samples: each is named, so that nobody takes a mean over a gap for a mean over the step."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from bench.display_units import of_labels
from bench.findings import Effect, Finding
from bench.procedure import Procedure
from bench.recording import Recording
from bench.recording.earlier import AGAIN

NAMED = 12  # more are counted together


def incomplete_steps(recording: Recording[Any]) -> Iterator[Finding]:
    """A finding for each step in which samples of a stream are missing."""
    if not any((recording.integrity or {}).get("lost", {}).values()):
        return
    found = [
        f"step {number} ({step.kind} {of_labels(step.labels)}): {lost} of {max(lost, step.expected(stream))} samples of "
        f"{stream} are missing"
        for number, step in enumerate(recording.all_steps(), 1)
        for stream in recording.streams
        if (lost := step.lost(stream))
    ]
    yield from (Finding("step-incomplete", text, "acquire") for text in found[:NAMED])
    if len(found) > NAMED:
        yield Finding("step-incomplete", f"{len(found) - NAMED} more steps miss samples", "acquire")


def missing_steps(procedure: Procedure, recording: Recording[Any]) -> Iterator[Finding]:
    """A finding where the recording has fewer steps than its plan asks for: what is concluded holds for another plan."""
    former = procedure.former_steps if recording.plan_schema == 1 else None
    planned = (former or procedure.fewest_steps or procedure.step_count)(recording.plan)
    if procedure.steps_on is not None:
        planned = min(planned, procedure.steps_on(recording.rig, recording.plan))
    there = sum(not step.kind.endswith(AGAIN) for step in recording.all_steps())
    if there < planned:
        text = f"the plan asks for {planned} steps or more; the recording has {there}"
        yield Finding("steps-missing", text, "acquire", Effect.INDETERMINATE)
