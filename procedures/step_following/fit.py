"""The bare model: one step of one axis, arrays in and numbers out.

Readings r of a place p are its nearest counts, |r - p| <= h, half a count, so that while an axis stands p lies within h of the
greatest reading and within h of the least: the middle of both is off by h at most, and at an edge it is right. All numbers
count along the way of the step: positive is beyond the set point.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
STANDS = 1.5  # counts, in which a reading that stands may change
BEFORE, AFTER = 6, 7  # samples about a passing, of which the last outside is the first before
PASSED = (5, 30)  # counts, fewest and most among them: of fewer it lingers, over more what bends a parabola shows
NEWTON = 4
LINGERS = 20  # times as long as in the count before: braked evenly it turns round within 2/(2**0.5 - 1) times


class Settled(NamedTuple):
    """From the set point's start, s: when it stays in the band, and by how much that is off at most; by how much it changes for
    each m or rad of a reading that is off, where the former does not have it; whether all its readings were asked."""

    at: float
    within: float
    slope: float
    passed: bool


@dataclass(frozen=True)
class Stepped:
    """Of one step: where it stood beyond the set point, m or rad, and how far it moved while it was to rest; which way its
    reading changed last, 1 along the step, -1 back, 0 where it changes at rest; how far it got beyond the set point, share of
    the step, and whether it stood there; when it stays in the band, None where it is outside at the end."""

    error: float
    moved: float
    entered: int
    overshoot: float
    stood: bool
    settling: Settled | None

    @property
    def settled(self) -> float | None:
        """From the set point's start until it stays in the band, s."""
        return self.settling.at if self.settling is not None else None


def began(reference: Array) -> int | None:
    """The last sample at which the set point is where it was; None where it stays there."""
    moved = np.flatnonzero(reference != reference[0])
    return int(moved[0]) - 1 if len(moved) else None


def stood(rest: Array, pitch: float) -> float:
    """Where an axis stood, by readings (n,)."""
    low, high = float(rest.min()), float(rest.max())
    return (low + high) / 2 if high - low < STANDS * pitch else float(rest.mean())


def entered(beyond: Array, rest: int, pitch: float) -> int:
    """Which way a reading (n,) changed last, 1 or -1; 0 where it never did, or in its last `rest` samples."""
    changed = np.flatnonzero(np.abs(np.diff(beyond)) > pitch / 2)
    if not len(changed) or changed[-1] >= len(beyond) - rest:
        return 0
    return 1 if beyond[changed[-1] + 1] > beyond[changed[-1]] else -1


def lingered(beyond: Array, pitch: float) -> bool:
    """Whether a reading (n,) stays at its greatest count as what stands does, and not as what turns round there."""
    top = beyond > beyond.max() - pitch / 2
    first = int(np.argmax(top))
    lower = np.flatnonzero(beyond[:first] < beyond.max() - STANDS * pitch)
    return int(top.sum()) > LINGERS * (first - int(lower[-1])) if len(lower) else False


def crossing(t: Array, beyond: Array, band: float) -> tuple[float, float] | None:
    """When a reading (n,) is within a band for good, s: between its last sample outside and the next one; and its last
    |reading| outside. None where it never is."""
    outside = np.flatnonzero(np.abs(beyond) > band)
    if not len(outside):
        return 0.0, band
    last = int(outside[-1])
    return (float((t[last] + t[last + 1]) / 2), abs(float(beyond[last]))) if last + 1 < len(t) else None


def settling(t: Array, beyond: Array, band: float, pitch: float) -> Settled | None:
    """When the place is within a band for good. Where it goes by, by all places that its readings allow (`passing`); else it
    passes the inner edges of the last counts that lie wholly outside and partly outside at the times at which the reading
    leaves these, and goes on evenly between them. None where it is outside at the end."""
    early, late = (crossing(t, beyond, band + side * pitch / 2) for side in (1, -1))
    if early is None or late is None:
        return None
    if (passed := passing(t, beyond, band, pitch)) is not None:
        return passed
    way, time = early[1] - late[1], late[0] - early[0]
    share = (early[1] - pitch / 2 - band) / way if way > 0 else 0.5
    period = float(np.median(np.diff(t)))
    return Settled(early[0] + time * min(max(share, 0.0), 1.0), period / 2, time / pitch, passed=False)


def passing(t: Array, beyond: Array, band: float, pitch: float) -> Settled | None:
    """When a place goes through the end of a band that goes on evenly accelerated for some samples: of all parabolas that are
    within half a count of each reading, the earliest and the latest, by linear programmes for where they are at the time at
    which the middle one passes. None where it lingers, or no parabola is."""
    from scipy.optimize import linprog

    outside = np.flatnonzero(np.abs(beyond) > band)
    last = int(outside[-1]) if len(outside) else 0
    if last < BEFORE - 1 or last + AFTER >= len(t):
        return None
    some = slice(last + 1 - BEFORE, last + 1 + AFTER)
    period = float(np.median(np.diff(t)))
    tau, read = (t[some] - t[last]) / period, np.sign(beyond[last]) * beyond[some] / pitch
    if not PASSED[0] <= np.ptp(read) <= PASSED[1]:
        return None
    shape = np.vander(tau, 3, increasing=True)
    bounds = np.vstack([shape, -shape]), np.concatenate([read + 0.5, 0.5 - read])
    a, b, c = np.polyfit(tau, read - band / pitch, 2)
    at, rate = 0.5, b + a
    for _ in range(NEWTON):
        if rate >= 0:
            return None
        at -= (c + b * at + a * at * at) / rate
        rate = b + 2 * a * at
    row = np.array([1.0, at, at * at])
    ends = [linprog(side * row, *bounds, bounds=(None, None)) for side in (1, -1)]
    if rate >= 0 or any(e.status != 0 for e in ends):
        return None
    low, high = float(ends[0].fun) - band / pitch, -float(ends[1].fun) - band / pitch
    passed, half = at - (low + high) / (2 * rate), (high - low) / (-2 * rate)
    return Settled(float(t[last] + period * passed), float(period * half), 0.0, passed=True)


def stepped(
    t: Array, read: Array, target: float, step: float, begun: int, rest: int, band: float, pitch: float
) -> Stepped:
    """One step of `step` m or rad to `target`, whose set point begins at sample `begun`; its last `rest` samples are a rest."""
    way, size = (1.0 if step > 0 else -1.0), abs(step)
    t, beyond = t[begun:] - t[begun], way * (read[begun:] - target)
    still = beyond[-rest:]
    at = settling(t, beyond, band * size, pitch)
    over, stays = float(beyond.max()) / size, lingered(beyond, pitch)
    return Stepped(stood(still, pitch), float(np.ptp(still)), entered(beyond, rest, pitch), over, stays, at)
