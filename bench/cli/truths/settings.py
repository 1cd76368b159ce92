"""What all truths of motion start from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated

Found = Iterator[tuple[str, str, float]]
"""Name, where, value in SI."""


def settings_of(done: Simulated, *more: Mapping[str, float]) -> dict[str, float]:
    """Every parameter of the controller: the rig file's defaults, then what a procedure writes."""
    rig = done.recording.rig
    known = {name: p.default for name, p in rig.parameters.items()}
    for changed in (done.procedure.settings(done.recording.rig, done.recording.plan), *more):
        known |= changed
    return known
