"""The recorded steps of a sweep of the phase angle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from procedures.shared.step_table import Labels


@dataclass(frozen=True)
class Phase(Labels):
    """Phase angle of the commutation, on the way up (+1) or down (-1)."""

    kind: ClassVar[str] = "phase"
    gamma_rad: float
    branch: int

    def __str__(self) -> str:
        return f"gamma {math.degrees(self.gamma_rad):+.2f}°"
