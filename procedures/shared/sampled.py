"""How the samples of a rig's telemetry came about: by the rig file (`binding.samples`)."""

from __future__ import annotations

from bench.analysis.sampling import Sampling
from bench.rigfile import RigFile


def of_telemetry(rig: RigFile, period_s: float) -> Sampling:
    """Of samples `period_s` apart: the mean of all readings since the last one, or the last reading alone; both end a tick
    before a sample's time. A mean is half a period later than a reading, and smaller."""
    tick = rig.devices["controller"].tick_s
    return Sampling(tick, round(period_s / tick) if rig.binding.samples == "mean" else 1, tick)
