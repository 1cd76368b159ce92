"""What the count of an encoder leaves unknown of a place: its rounding, where its edges lie, its own error and its pitch.

By the encoder's own scale a place is known to half a count, which is a bound that no reading goes beyond. An axis that is
pushed until its reading changes comes to rest at the edge of a count more often than in the middle of one, so the half count
is taken for U itself, u = h/1.96: the 95 % of a rectangle, 0.95 h, would leave out just these rests. Against the true place
there are also the edges, up to half a count off the zero for good, and the encoder's own error, which differs from place to
place.

Which edge of its last count an axis came in by is told by the way in which its reading changed last. Braked evenly, with a
speed v there, it goes on by d = v²/2a. All that is known of v is that the axis stayed in the count, so that it is between zero
and the speed that just reaches the other edge. With all of these alike likely d is s² of a count, s even between 0 and 1: 1/3
of a count on the mean, with a variance of 1/5 - 1/9 = 4/45. Where an axis turns round that is braked by what knows nothing of
counts, all places in the count are alike likely, 1/2 on the mean; a loop that knows them brakes, too.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.rigfile.stage import StageAxis, axes_of
from bench.uncertainty import Distribution, Estimate, Influence
from procedures.shared.certificates import share_of

Array = npt.NDArray[np.float64]
BOUND = 1.959964  # U over u: half a count is U
RECTANGLE = 3.0**0.5
ONE = 1e-9  # of a share that is the whole
BRAKED = 1 / 3, (4 / 45) ** 0.5  # of a count, from the edge it came in by to its rest: mean, standard deviation
TURNED = 5 / 12, 1 / 12  # likewise to where it turns: the mean, between 1/3 and 1/2


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


def rested(identity: str, axis: StageAxis, reads: Sequence[float], entered: Sequence[int]) -> Estimate:
    """Where an axis stands on the mean of rests, m or rad, by its encoder's scale: readings (n,) and the ways (n,) in which
    they changed last, 1, -1, or 0 where they went on changing or never did, of which the half count is left."""
    ways, pitch = np.asarray(entered), pitch_of(axis)
    mean, spread = BRAKED
    some: tuple[tuple[npt.NDArray[np.bool_], str, str, float, Distribution], ...] = (
        (ways != 0, "in", "where in its last count it rests", spread * pitch, "rectangular"),
        (ways == 0, "between", "rounding of the reading", pitch / 2 / 2**0.5, "arcsine"),
    )
    place = Estimate.exact(float(np.mean(reads)) - (0.5 - mean) * pitch * float(ways.mean()), axis.unit)
    for of, key, name, u, shape in some:
        if of.any():
            alike = np.column_stack([reads, ways])[of]
            place += float(of.mean()) * _of_mean(f"rest/{identity}/{key}", name, u, axis.unit, shape, alike)
    return place


def topped(identity: str, axis: StageAxis, tops: Sequence[float], stood: Sequence[bool]) -> Estimate:
    """How far an axis got on the mean, m or rad, by its greatest readings (n,), and whether it stood there (n,): as any rest
    does, or else it turned round. Where in its last count it turns on the mean is the same for all that do."""
    pitch, unit, stays = pitch_of(axis), axis.unit, np.asarray(stood)
    (rest, spread), (turn, within), rounds = BRAKED, TURNED, float(1 - stays.mean())
    each = _of_mean(f"top/{identity}", "where in its last count it stops", spread * pitch, unit, "rectangular",
                    np.column_stack([tops, stays]))  # fmt: skip
    of_all = Influence(
        f"turn/{identity}", "where it turns on the mean", within * pitch / RECTANGLE, unit, "B", "rectangular"
    )
    value = float(np.mean(tops)) - pitch * (0.5 - rest + rounds * (rest - turn))
    return each + Estimate(value, unit, {of_all: rounds} if rounds > 0 else {})


def bounded(identity: str, axis: StageAxis, reads: Sequence[float], place: Estimate) -> Estimate:
    """A place by the encoder's scale, m or rad, of which readings (n,) are known: none is farther from its reading than half a
    count. Where that says more of their mean than what is likely within their last counts, it is stated."""
    mean, half = float(np.mean(reads)), half_count(axis)
    return place if abs(place.value - mean) + BOUND * place.u < half else rounded(identity, axis, half) + mean


def _of_mean(
    identity: str, name: str, u: float, unit: str, shape: Distribution, alike: Sequence[float] | Array
) -> Estimate:
    """A zero with the mean of what is off by `u` each, alike where `alike` (n,) or (n, m) is: then it is shaped so."""
    share = averaged(alike)
    return Estimate.of(0.0, Influence(identity, name, share * u, unit, "B", shape if share > 1 - ONE else "normal"))


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
    """What is left of a bound, such as rounding, in the mean of repeats (n,) or (n, m): those that read alike are off alike,
    those that do not are off each by itself; the root of the sum of squares of the shares that read alike."""
    _, counts = np.unique(np.round(np.asarray(values, np.float64), 12), return_counts=True, axis=0)
    return float(np.sqrt((counts**2).sum()) / counts.sum())
