"""Settings of the shots."""

from __future__ import annotations

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings, SI. A shot: the currents are held with a push along one axis, both ways in turn."""

    axes: tuple[str, ...] = ()  # of capabilities.hold.axes; none: all
    observer: str = "position"  # of the rig's capabilities.settings.observer; "": as the controller is set
    place_m: float | None = None  # along the shaft; none: the middle that capabilities.hold states
    push_A: float = Field(0.25, gt=0)
    hold_s: float = Field(4e-3, gt=1e-3)
    bound_m: float = Field(20e-6, gt=0)  # a radial reading beyond it ends a hold
    shots: int = Field(24, ge=8, multiple_of=4)  # of each axis
    settle_s: float = Field(1.5, ge=0)  # at the place, before the first shot
    rest_s: float = Field(0.4, ge=0.1)  # between two: the controller's slow means forget the last catch
    lead_s: float = Field(2e-3, ge=5e-4)  # captured before the hold
    tail_s: float = Field(30e-3, ge=5e-3)  # and after it: the catch
    patience_s: float = Field(1.0, gt=0)  # that a hold is waited for
    skip_s: float = Field(4e-4, ge=0)  # of a hold, from its beginning: currents come to rest
    trim: int = Field(3, ge=0)  # samples at its end: one of them ended it
    least_s: float = Field(1.5e-3, gt=0)  # what is left of a hold must last
    min_growth_m: float = Field(4e-6, gt=0)  # that the readings grow apart from one way to the other, at least
    max_tilt: float = Field(0.5, gt=0)  # of the travel along: what a push may tilt, before it is none of both planes
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
