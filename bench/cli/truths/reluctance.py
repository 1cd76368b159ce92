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
    """Zeros of stators, and what friction leaves of them at the greatest level."""
    of = done.drawn.machine.motions.stators
    if of is not None:
        most = max(done.recording.plan.levels_A)
        for (name, where), value in of(done.recording.rig, done.drawn, most).items():
            yield name, where, value
