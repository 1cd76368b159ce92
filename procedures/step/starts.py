"""How well it is known when the set points of steps acted. A law that differentiates its error pushes as the set point goes,
and its currents answer otherwise than a jump's: `onset` then finds them early, by about the currents' lag, alike in all steps
of a group. Where they are so unlike a jump, times count from the middle of what is sure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from procedures.step.steps import Done

START_S = 4e-5
"""How well the control currents tell when the set points of a case acted: the mean of its steps, on 12 drawn machines of three
rigs, 38 µs early to 29 µs late (noise, and what `onset.LATE_S` leaves of the rotor's answer)."""
UNLIKE = 0.03
"""Of the jump: on drawn machines of three rigs 0.005 at most; 0.05 to 0.25 where the derivative pushes."""


def unlike(steps: Sequence[Done]) -> float:
    """How unlike to that of a jump the currents' answer is: of the size of step that shows it most, over the jump."""
    return max(
        float(np.mean([d.unlike for d in steps if d.case.size == size])) for size in {d.case.size for d in steps}
    )


def told(steps: Sequence[Done]) -> list[Done]:
    """Steps of one group with how well their start is known: as the currents tell it, or by what is sure of each of them."""
    if unlike(steps) <= UNLIKE:
        return list(steps)
    low, high = max(d.within[0] for d in steps), min(d.within[1] for d in steps)
    return [replace(d, late_s=(low + high) / 2, start_s=max((high - low) / 2, 0.0) + START_S) for d in steps]
