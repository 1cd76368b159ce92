"""Settings of the mass-hanging calibration."""

from __future__ import annotations

from pydantic import Field

from bench.procedure import BenchPlan

FEWEST_MASSES = 4
ROUNDS_AT_ONE = 3  # so that the scatter of a hanging has 20 degrees of freedom


class Plan(BenchPlan):
    """Settings of the calibration, SI."""

    masses: tuple[str, ...] = Field(("M1", "M2", "M3", "M4"), min_length=FEWEST_MASSES)  # of the rig's, ascending
    angles: int = Field(8, ge=1)  # equally spaced over a turn, 8 or more; 1: as the shaft stands
    rounds: int | None = Field(None, ge=1)  # of all masses at each angle; None: 1, and 3 at one angle alone
    bias_A: float = Field(3.0, gt=0)
    settle_s: float = Field(2.0, gt=0)
    average_s: float = Field(1.0, ge=0.1)
    max_position_m: float = Field(5e-8, gt=0)  # settled: |mean position| and its drift within a step
    max_drift_A: float = Field(2e-3, gt=0)  # settled: drift of a control current within a step
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples

    @property
    def rounds_at_angle(self) -> int:
        """How often all masses are hung up and down at an angle."""
        return self.rounds or (ROUNDS_AT_ONE if self.angles == 1 else 1)
