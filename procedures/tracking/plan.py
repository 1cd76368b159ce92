"""Settings of a tracking test."""

from __future__ import annotations

from pydantic import Field

from bench.procedure import BenchPlan
from procedures.amb_rotor.machine import Law


class Plan(BenchPlan):
    """Settings of the tracking test, SI."""

    laws: tuple[Law, ...] = ()  # judged; none: as the controller is set
    compare: tuple[Law, ...] = ()  # only reported beside them; one that is judged is there already
    hz: float = Field(10.0, gt=0, le=50)
    y_m: float | None = Field(None, gt=0)  # half axes; a fifth and three tenths of the least clearance if not given
    z_m: float | None = Field(None, gt=0)
    ratio: int = Field(1, ge=1, le=5)  # turns of z in one of y: other figures of Lissajous
    points: int = Field(48, ge=12)  # set points in a revolution where the controller has no path
    points_hz: float = Field(0.5, gt=0, le=5)  # of the reference, where it is made of them
    speed_rad_s: float = Field(0.0, ge=0)  # 0: at rest
    observer: bool | None = None  # disturbance compensation; by default while it turns
    revolutions: int = Field(24, ge=6)  # of the reference
    settle_s: float = Field(3.0, gt=0)  # before and after the reference has grown
    runout_m: float = Field(4e-6, ge=0)  # of the journals, at most: counts against the ring's distance
    max_lower_A: float = Field(0.05, gt=0)  # of CAC
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples

    @property
    def observed(self) -> bool:
        """Whether disturbances are compensated."""
        return self.speed_rad_s > 0 if self.observer is None else self.observer

    @property
    def order(self) -> tuple[Law, ...]:
        """All laws in the order in which they are done: one that touches comes last."""
        return (*self.judged, *(law for law in self.compare if law not in self.judged))

    @property
    def judged(self) -> tuple[Law, ...]:
        """The laws under test; "" is the controller as it is set."""
        return self.laws or ("",)
