"""A small procedure for a rig with a channel and a role that the TSBS rig does not have."""

from __future__ import annotations

import dataclasses
from typing import Any

from bench.procedure.requires import Requires
from tests import tiny_procedures


class Plan(tiny_procedures.Plan):
    """With a setting of its own."""

    tilt_rad: float = 0.0


procedure: Any = dataclasses.replace(
    tiny_procedures.levitated, name="tiny-lacking", plan=Plan,
    requires=lambda _: Requires(roles=("levitation", "winch"), channels=("supply", "pos_zi")),
)  # fmt: skip
