"""Settings of the responses of position loops."""

from __future__ import annotations

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings of the injections, SI."""

    axes: tuple[str, ...] = ()  # loops by the rig's names; none: all into which the controller injects
    sensitive: tuple[str, ...] | None = None  # loops whose sensitivity is looked at; not given: those of radial probes
    parameters: dict[str, float] = Field(default_factory=dict)  # of the controller, once it levitates: place, observer
    low_hz: float = Field(5.0, gt=0)
    high_hz: float = Field(1500.0, gt=0)
    lines: int = Field(8, ge=4)  # of the survey, at equal steps of the logarithm
    refined: int = Field(9, ge=5)  # about the -3 dB point, and about the greatest sensitivity
    within: float = Field(0.15, gt=0, le=0.5)  # so far either way at most, of the logarithm of the frequency
    share: float = Field(0.35, gt=0, lt=1)  # of a loop's limit, that a sine's force takes at most
    amplitude: dict[str, float] = Field(default_factory=dict)  # m or rad, by loop, in the place of that
    counts: float = Field(16.0, gt=0)  # of the converter that shows the loop, that an amplitude has at most
    periods: int = Field(6, ge=4)  # of each line, at least
    survey_s: float = Field(0.25, ge=0.05)  # of each line of the survey, at least
    refined_s: float = Field(0.8, ge=0.1)
    settle_s: float = Field(1.0, ge=0.1)  # after the parameters were written
    start_s: float = Field(0.15, ge=0.05)  # of each sine, at least
    time_constants: float = Field(
        5.0, ge=3
    )  # of the loop's integrator, for which a sine has gone on before it is looked at
    rate_hz: float | None = Field(None, gt=0)  # of captures; none: the nearest to 35 kHz
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
    min_signal: float = Field(10.0, gt=1)  # of a line, in its standard uncertainty
