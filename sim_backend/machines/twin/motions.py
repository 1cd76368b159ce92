"""The truths of motion of a rig's twin, as procedures' plans ask for them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from bench.rigfile import RigFile
from sim_backend.machine import Truth
from sim_backend.machines.twin import truth_balance, truth_sensitivity, truth_step, truth_track, truth_whirl
from sim_backend.motion import Motions, drag

if TYPE_CHECKING:
    from sim_backend.machines.passing import Curves


def passage(
    rig: RigFile, drawn: Truth, settings: Mapping[str, float], low: float, high: float, channels: Sequence[str]
) -> Curves:
    """Between two speeds, rad/s."""
    from sim_backend.machines.twin import truth_passage  # scipy: what asks for no curves starts without it

    return truth_passage.curves(rig, drawn, settings, low, high, channels)


MOTIONS = Motions(
    steps=truth_step.steps_asked, whirl=truth_whirl.whirl, left=truth_balance.left, passage=passage,
    loop=truth_sensitivity.loop, orbit=truth_track.orbit, drag=drag,
)  # fmt: skip
