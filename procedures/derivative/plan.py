"""Settings of the injections."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings of the injections, SI."""

    degree: int = Field(7, ge=3, le=12)  # K
    window_s: float = Field(0.012, gt=0)  # eps, from reset to reset
    rule: Literal["euler", "first-off", "exact"] = "euler"
    lines_hz: tuple[float, ...] = Field((3.0, 7.3, 16.3, 31.7, 53.3, 71.9, 90.7, 113.0), min_length=2)
    amplitude_A: float = Field(0.064, gt=0)  # of the injected sine, 0-pk: 2 N
    offset_m: float = Field(50e-6, gt=0)  # to either side, for the derivative of a constant
    settle_s: float = Field(1.5, gt=0)  # of each injection, before it is captured: the observer's slow pole of -5 1/s
    record_s: float = Field(4.0, gt=0)  # of each capture, at least
    periods: float = Field(24.0, ge=8)  # of the sine in a capture, at least
    blocks: int = Field(8, ge=4)  # into which a capture is cut for its scatter
    limit: float = Field(0.293, gt=0)  # error at the edges of the band
    at_hz: float = Field(40.0, gt=0)  # where the error is told for comparison
    clear_hz: float = Field(4.0, gt=0)  # between a line, the harmonic and their images by the resets, at least
    max_mismatch: float = Field(1e-4, gt=0)  # of the velocity from that of the weights, share of its rms
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
