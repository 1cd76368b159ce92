"""Which controls of the simulated plant, and of its controller, the parameters of a rig file are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from bench.rigfile import RigFile

OWN: Final = {"watchdog_s": 0.08, "landing_speed": 5.0, "speed_ref": 0.0, "lift_time_s": 1.0}
"""Controls of the controller itself, SI, with what they are where no parameter of the rig sets them and `[simulation]` says
nothing else; of these the plant takes `lift_time_s` too. `speed_ref` acts on SPIN."""


def controls(rig: RigFile) -> Mapping[str, tuple[str, ...]]:
    """The controls that each parameter sets, by the parameter's name: those of its own name."""
    return {name: (name,) for name in rig.parameters}
