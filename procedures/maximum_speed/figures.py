"""What a run to the maximum speed draws."""

from __future__ import annotations

from collections.abc import Iterator

from bench.figures import Figure
from bench.recording import Recording
from procedures.maximum_speed.estimates import Result
from procedures.maximum_speed.plan import Plan


def all_figures(result: Result, recording: Recording[Plan], limit_A: float) -> Iterator[Figure]:
    """In the order of the report."""
    return iter(())
