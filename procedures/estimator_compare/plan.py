"""Settings of the comparison."""

from __future__ import annotations

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings of the comparison, SI. Estimators go by the rig's names of its settings of kind "estimator".

    What an estimator does goes by where its resets are to the exciter and where in that pattern the capture begins. One filter
    that is reset every 40 ms stands to 40 Hz as it did after 0.2 s, two that take turns every 12 ms after 0.3 s: `spread_s` is
    whole times of both, so that each place is as likely as another.
    """

    engaged: tuple[str, ...] = Field(("single", "overlapping"), min_length=1)  # while the compensation is switched on
    loaded: tuple[str, ...] = Field(("overlapping", "observer", "difference"), min_length=1)  # while a load is hung
    load: str = "M1"  # of the rig's masses
    repeats: int = Field(10, ge=3)
    settle_s: float = Field(0.5, gt=0)  # with an estimator, before its compensation is switched on
    calm_s: float = Field(2.5, gt=0)  # with an estimator that compensates, before a load
    lead_s: float = Field(0.3, ge=0.2)  # of a capture, before switch or load; its last 0.1 s are not judged
    engaged_s: float = Field(0.15, ge=0.11)  # of a capture, after the switch
    loaded_s: float = Field(1.05, ge=1.01)  # after the load
    spread_s: float = Field(0.6, ge=0)  # over which the moments are spread at random
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
