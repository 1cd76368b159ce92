"""Settings of a test of repeatability and accuracy."""

from __future__ import annotations

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings of the targets, of the way to them and of what is made of the readings, SI."""

    axes: tuple[str, ...] = ()  # by the rig's names; none: all that a reference instrument reads
    targets_m: tuple[float, ...] = ()  # of axes along, from below; none: made off whole counts
    targets_rad: tuple[float, ...] = ()  # and around
    count_m: int = Field(0, ge=0)  # how many are made; 0: the fewest of ISO 230-2
    count_rad: int = Field(0, ge=0)
    travel: float = Field(0.9, gt=0, le=1)  # that is measured, of where an axis along can be sent
    turn_rad: float = Field(6.283185307179586, gt=0)  # that is measured of an axis around
    draw: int = Field(1, ge=0)  # which random parts targets have
    repeats: int = Field(5, ge=2)  # of approaches each way
    beyond_m: float = Field(5e-4, gt=0)  # how far beyond the first and the last target it turns round
    beyond_rad: float = Field(0.17, gt=0)
    rate_m_s: float = Field(0.03, gt=0)  # on the way
    rise_m_s2: float = Field(0.3, gt=0)
    rate_rad_s: float = Field(3.0, gt=0)
    rise_rad_s2: float = Field(20.0, gt=0)
    dwell_s: float = Field(2.0, ge=0.1)  # from the set point's arrival until it is read
    rest_s: float = Field(0.2, ge=0.05)  # of that, looked at: it has to be at rest
    tries: int = Field(6, ge=1)  # of a reading, until the axis stands still before it and meanwhile
    window_s: float = Field(0.2, gt=0)  # of readings by a channel, whose mean counts
    rest_counts: float = Field(3.0, gt=0)  # by which an axis at rest may move
    far: float = Field(12.0, gt=0)  # times the scatter of all from which a reading is off
    max_noise: float = Field(0.8, gt=0)  # of the scatter that is read: noise and rounding of the instrument
    max_warming_K: float = Field(1.0, gt=0)  # of what carries the axis, in the run
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
