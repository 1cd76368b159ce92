"""Truths of what a shaft does while its bearings' currents are held."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bench.cli.truths.settings import Found

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated


def pole(done: Simulated) -> Found:
    """That of the machine at its middle, alike in all directions."""
    from procedures.unstable_pole.hold import chosen

    pole, mass = done.truth.get("lambda"), done.truth.get("m")
    if pole is None or mass is None:
        return
    for axis in chosen(done.recording.rig, done.recording.plan):
        yield "pole", axis, pole
        yield "stiffness", axis, pole**2 * mass
