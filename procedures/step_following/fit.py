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


def crossing(t: Array, beyond: Array, band: float) -> tuple[float, float] | None:
    """When a reading (n,) is within a band for good, s: between its last sample outside and the next one; and its last
    |reading| outside. None where it never is."""
    outside = np.flatnonzero(np.abs(beyond) > band)
    if not len(outside):
        return 0.0, band
    last = int(outside[-1])
    return (float((t[last] + t[last + 1]) / 2), abs(float(beyond[last]))) if last + 1 < len(t) else None


def settling(t: Array, beyond: Array, band: float, pitch: float) -> tuple[float, float] | None:
    """When the place is within a band for good, s, and by how much that changes for each m or rad: it passes the inner edges of
    the last counts that lie wholly outside and partly outside at the times at which the reading leaves these, and goes on
    evenly between them. None where it is outside at the end."""
    early, late = (crossing(t, beyond, band + side * pitch / 2) for side in (1, -1))
    if early is None or late is None:
        return None
    way, time = early[1] - late[1], late[0] - early[0]
    share = (early[1] - pitch / 2 - band) / way if way > 0 else 0.5
    return early[0] + time * min(max(share, 0.0), 1.0), time / pitch


def stepped(
    t: Array, read: Array, target: float, step: float, begun: int, rest: int, band: float, pitch: float
) -> Stepped:
    """One step of `step` m or rad to `target`, whose set point begins at sample `begun`; its last `rest` samples are a rest."""
    way, size = (1.0 if step > 0 else -1.0), abs(step)
    t, beyond = t[begun:] - t[begun], way * (read[begun:] - target)
    at, slope = settling(t, beyond, band * size, pitch) or (None, 0.0)
    still = beyond[-rest:]
    return Stepped(stood(still, pitch), float(np.ptp(still)), float(beyond.max()) / size, at, slope)
