"""The recorded steps of an eccentric positioning: the outboard end displaced by the motor, and by the AMBs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from procedures.shared.step_table import Labels


@dataclass(frozen=True)
class Displaced(Labels):
    """Displacement of the outboard sensor's plane, reached from below (+1) or above (-1), at a bias of the AMBs."""

    by: ClassVar[str]
    level_m: float
    branch: int
    bias_A: float

    def __str__(self) -> str:
        return f"{self.by}, {self.level_m * 1e6:+.0f} µm at {self.bias_A:g} A"


@dataclass(frozen=True)
class HeldByMotor(Displaced):
    """The motor holds the outboard end."""

    kind: ClassVar[str] = "motor"
    by: ClassVar[str] = "motor"


@dataclass(frozen=True)
class HeldByAmbs(Displaced):
    """The AMBs hold it."""

    kind: ClassVar[str] = "ambs"
    by: ClassVar[str] = "AMBs"
