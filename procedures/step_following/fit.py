"""The bare model: one step of one axis, arrays in and numbers out.

Readings r of a place p are its nearest counts, |r - p| <= h, half a count, so that while an axis stands p lies within h of the
greatest reading and within h of the least: the middle of both is off by h at most, and at an edge it is right. All numbers
count along the way of the step: positive is beyond the set point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
STANDS = 1.5  # counts, in which a reading that stands may change


@dataclass(frozen=True)
class Stepped:
    """Of one step: where it stood beyond the set point, m or rad, and how far it moved while it was to rest; how far it got
    beyond the set point, share of the step; from the set point's start until it stays in the band, s, and by how much that
    changes for each m or rad of a reading that is off; None where it is outside at the end."""

    error: float
    moved: float
    overshoot: float
    settled: float | None
    slope: float


def began(reference: Array) -> int | None:
    """The last sample at which the set point is where it was; None where it stays there."""
    moved = np.flatnonzero(reference != reference[0])
    return int(moved[0]) - 1 if len(moved) else None


def stood(rest: Array, pitch: float) -> float:
    """Where an axis stood, by readings (n,)."""
    low, high = float(rest.min()), float(rest.max())
    return (low + high) / 2 if high - low < STANDS * pitch else float(rest.mean())


def settling(t: Array, beyond: Array, band: float) -> float | None:
    """When |beyond| (n,) is in the band for good, s: between its last sample outside and the next one."""
    outside = np.flatnonzero(np.abs(beyond) > band)
    if not len(outside):
        return 0.0
    last = int(outside[-1])
    return float((t[last] + t[last + 1]) / 2) if last + 1 < len(t) else None


def stepped(
    t: Array, read: Array, target: float, step: float, begun: int, rest: int, band: float, pitch: float
) -> Stepped:
    """One step of `step` m or rad to `target`, whose set point begins at sample `begun`; its last `rest` samples are to rest.

    The place crosses the band between the times at which the reading crosses half a count farther out and nearer in: in the
    middle, and half of that is left open. Where the band is a whole number of counts, the reading alone would be half a
    count early, always.
    """
    way, size = (1.0 if step > 0 else -1.0), abs(step)
    t, beyond = t[begun:] - t[begun], way * (read[begun:] - target)
    early, late = (settling(t, beyond, band * size + side * pitch / 2) for side in (1, -1))
    at = None if early is None or late is None else (early + late) / 2
    slope = 0.0 if early is None or late is None else (late - early) / pitch
    still = beyond[-rest:]
    return Stepped(stood(still, pitch), float(np.ptp(still)), float(beyond.max()) / size, at, slope)
