"""Truths of a reluctance machine's map: as encoders read places."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bench.cli.truths.settings import Found

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated


def inductances(done: Simulated) -> Found:
    """Constants of the map."""
    of = done.drawn.machine.motions.inductances
    if of is not None:
        for (name, where), value in of(done.recording.rig, done.drawn).items():
            yield name, where, value


def zeros(done: Simulated) -> Found:
    """Zeros of stators. The band is what was seen: it has no truth but itself."""
    of = done.drawn.machine.motions.stators
    if of is not None:
        for (name, where), value in of(done.recording.rig, done.drawn).items():
            yield name, where, value
