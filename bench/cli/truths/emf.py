"""Truths of a mover's motors by their emf."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bench.cli.truths.settings import Found

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated


def constants(done: Simulated) -> Found:
    """The machine's own: force per ampere is what it induces at a speed."""
    from procedures.emf_constant.moves import chosen

    for motor in chosen(done.recording.rig, done.recording.plan):
        for name, own in (("flux", "Psi"), ("resistance", "R"), ("K_emf", "K_L"), ("K_emf_angle", "K_R")):
            if (value := done.truth.get(f"{own}@{motor}")) is not None:
                yield name, motor, value
