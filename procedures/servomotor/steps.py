"""From the recorded steps of a shaft that the motor or the AMBs displace to a table."""

from __future__ import annotations

from typing import Any

import numpy as np

from bench.errors import AnalysisError
from bench.recording import Recording, Step
from bench.rigfile.roles import ANGLE, STATUS
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.shared.step_table import Read, Samples, StepTable, tabulate

POSITIONS = ("yi", "yo", "xi", "xo")
"""Axes in the order in which they are read."""


def channels(machine: Servomotor) -> tuple[str, ...]:
    """What is recorded of a displaced shaft, besides the flags."""
    return (*machine.segments, *machine.coils_of("yi", "yo"), *machine.positions_of(*POSITIONS), ANGLE)


def read_steps(recording: Recording[Any], kind: type[Read]) -> StepTable[Read]:
    """Every step of `kind` in time order.

    Raises:
        AnalysisError: there are no steps, or one of them holds no samples.
    """
    steps = list(recording.steps(kind.kind))
    if not steps:
        raise AnalysisError(f"steps of kind {kind.kind!r}: found none; expected the run's (was it stopped early?)")
    read = channels(conventions(recording.rig))

    def samples(step: Step) -> Samples:
        data = step.read(*read, STATUS)
        data[ANGLE] = (data[ANGLE] + np.pi) % (2 * np.pi) - np.pi  # home is angle 0: no mean across the turn's end
        return data

    return tabulate(steps, kind, read, read=samples)
