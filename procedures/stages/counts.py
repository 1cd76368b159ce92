"""What the count of an encoder leaves unknown of a place: its rounding, where its edges lie, its own error and its pitch.

By the encoder's own scale a place is known to half a count, which is a bound that no reading goes beyond. An axis that is
pushed until its reading changes comes to rest at the edge of a count more often than in the middle of one, so the half count
is taken for U itself, u = h/1.96: the 95 % of a rectangle, 0.95 h, would leave out just these rests. Against the true place
there are also the edges, up to half a count off the zero for good, and the encoder's own error, which differs from place to
place.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.rigfile.stage import StageAxis, axes_of
from bench.uncertainty import Estimate, Influence
from procedures.shared.certificates import share_of

Array = npt.NDArray[np.float64]
BOUND = 1.959964  # U over u: half a count is U
RECTANGLE = 3.0**0.5


def lacks_counts(rig: RigFile) -> tuple[str, ...]:
    """A line for the axes of which no count is known."""
    without = [name for name, axis in axes_of(rig).items() if axis.pitch is None]
    return (f"encoders: found no pitch of {', '.join(without)}; expected what a count is",) if without else ()


def pitch_of(axis: StageAxis) -> float:
    """A count, m or rad."""
    assert axis.pitch is not None
    return axis.pitch.value


def half_count(axis: StageAxis) -> float:
    """How far a reading may be off by its rounding, m or rad."""
    return pitch_of(axis) / 2


def own_error(axis: StageAxis) -> float:
    """How far the encoder may read off by itself, m or rad; 0 where the rig file does not say."""
    if axis.error is None:
        return 0.0
    spread = axis.error.half_width if axis.error.half_width is not None else 2 * (axis.error.u or 0.0)
    return abs(axis.error.value) + spread


def rounded(identity: str, axis: StageAxis, by: float) -> Estimate:
    """A zero that is known to `by`, m or rad, a bound: what rounding leaves of a result."""
    return Estimate.of(
        0.0, Influence(f"rounding/{identity}", "rounding of the reading", by / BOUND, axis.unit, "B", "normal")
    )


def rested(identity: str, axis: StageAxis, share: float) -> Estimate:
    """A zero with a share of the rounding of a rest, for a true place: at the edges of a count rather than in its middle."""
    u = share * half_count(axis) / 2**0.5
    return Estimate.of(0.0, Influence(f"rest/{identity}", "where in its count it rests", u, axis.unit, "B", "arcsine"))


def edges(axis: StageAxis) -> Estimate:
    """A zero with how far all edges may lie off the zero of the encoder."""
    u = half_count(axis) / RECTANGLE
    return Estimate.of(0.0, Influence(f"edges/{axis.name}", "edges of the counts", u, axis.unit, "B", "rectangular"))


def erred(axis: StageAxis, place: str) -> Estimate:
    """A zero with the encoder's own error at a place."""
    u = own_error(axis) / RECTANGLE
    source = axis.error.source if axis.error is not None else ""
    known = f"error/{axis.name}/{place}"
    return Estimate.of(
        0.0, Influence(known, "the encoder's own error", u, axis.unit, "B", "rectangular", source=source)
    )


def stretched(axis: StageAxis, by: float) -> Estimate:
    """A zero with what the tolerance of the pitch does over a way."""
    assert axis.pitch is not None
    scale = share_of(f"encoders/{axis.name}/pitch", axis.pitch, "pitch of the encoder")
    return Estimate(0.0, axis.unit, {i: by * c for i, c in scale.sensitivities.items()})


def averaged(values: Sequence[float] | Array) -> float:
    """What is left of a bound, such as rounding, in the mean of repeats (n,): those that read alike are off alike, those that
    do not are off each by itself; the root of the sum of squares of the shares that read alike."""
    _, counts = np.unique(np.round(np.asarray(values, np.float64), 12), return_counts=True)
    return float(np.sqrt((counts**2).sum()) / counts.sum())
