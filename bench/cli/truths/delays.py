"""Truths of how late positions are read."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bench.cli.truths.settings import Found

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated


def probes(done: Simulated) -> Found:
    """The machine's own low-pass, alike in all of them: positions and currents of a row of a capture are of one tick."""
    from procedures.sensor_delay.sines import probes as of

    if (value := done.truth.get("delay")) is not None:
        yield from (("delay", p.channel, value) for p in of(done.recording.rig))
