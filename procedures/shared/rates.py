"""Rates of captures: those that a controller has are its own divided by whole numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator

from bench.rigfile import RigFile
from bench.rigfile.capture import LONGEST_DIVIDER

USUAL_HZ = 10e3  # where a plan names no rate
SHOWN = 5


def rate_of(rig: RigFile, planned: float | None, usual: float = USUAL_HZ) -> float:
    """The plan's, Hz, or where it names none the controller's nearest to `usual`."""
    highest = 1 / rig.devices["controller"].tick_s
    return planned if planned is not None else highest / max(1, round(highest / usual))


def of_rate(rig: RigFile, planned: float | None) -> Iterator[str]:
    """What is wrong with the rate of a plan, before anything starts."""
    highest = 1 / rig.devices["controller"].tick_s
    if planned is None:
        return
    ratio = highest / planned
    if not 0.5 < ratio < LONGEST_DIVIDER + 0.5 or not math.isclose(ratio, round(ratio), rel_tol=1e-6):
        near = max(1, round(ratio) - SHOWN // 2)
        rates = ", ".join(f"{highest / k:.6g}" for k in range(near, near + SHOWN))
        yield (f"rate_hz: found {planned:g}; expected the controller's {highest:.6g} Hz divided by a whole number, as "
               f"{rates}, or none for {rate_of(rig, None):.6g}")  # fmt: skip
