"""What the means of steps say before anything is fitted: losses, stuck channels, limits and contact, settling.

Arrays have one entry per step, in any shape; `where` names the step of the greatest entry.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding

Array = npt.NDArray[np.float64]
Where = Callable[[Array], str]
Meaning = tuple[int, str, str]
"""Bits of a flag, the code of the finding and what it says."""
SAME_M = 1.5e-8  # apart, and positions are still the same: one and a half of their digits on the bus


class Recorded(Protocol):
    """A step: `where` it was, and how many of the `expected` samples are `lost`."""

    @property
    def where(self) -> str: ...
    @property
    def lost(self) -> int: ...
    @property
    def expected(self) -> int: ...


def losses(lost: Array, expected: Array, allowed: float, where: Where) -> Iterator[Finding]:
    """Steps in which more than the share `allowed` of the samples is missing."""
    share = lost / np.maximum(expected, 1)
    if share.max() > allowed:
        yield Finding(
            "missing-samples",
            f"{lost.sum() / expected.sum():.2%} of the samples inside steps are missing ({share.max():.2%} in the worst "
            f"step; {allowed:.2%} is allowed). Look at the link: load, cable, gateway.",
            where(share),
            Effect.INDETERMINATE,
        )


def losses_of(steps: Sequence[Recorded], allowed: float) -> Iterator[Finding]:
    """The same of steps that say it of themselves."""
    lost, expected = np.array([(s.lost, s.expected) for s in steps], dtype=float).T
    yield from losses(lost, expected, allowed, lambda share: steps[int(np.argmax(share))].where)


def stuck(spread: Mapping[str, Array], channels: Sequence[str]) -> Iterator[Finding]:
    """Channels whose samples have no scatter within some step."""
    for channel in channels:
        still = spread[channel] == 0
        if still.any():
            yield Finding(
                "stuck-channel",
                f"{channel} does not move at all in {int(still.sum())} of {still.size} steps; a live sensor has noise.",
                channel,
                Effect.ERROR,
            )


def flagged(flags: npt.NDArray[np.int64], meanings: Iterable[Meaning], where: Where) -> Iterator[Finding]:
    """Saturation and contact, as the controller reported them."""
    for bits, code, text in meanings:
        hit = (flags & bits) != 0
        if hit.any():
            yield Finding(code, f"{text} in {int(hit.sum())} of {hit.size} steps", where(hit.astype(float)),
                          Effect.INDETERMINATE)  # fmt: skip


def settled(
    mean: Mapping[str, Array], drift: Mapping[str, Array], axes: Mapping[str, tuple[str, str]],
    max_position_m: float, max_drift_A: float, where: Where,
) -> Iterator[Finding]:  # fmt: skip
    """Settled means at the sensors' zero and standing still, on position and on control current. `axes`: by the position's
    channel those of both coils.

    The drift allowed in position is twice the mean allowed, because the noise of a difference of half means is twice
    that of the mean.
    """
    position = np.max([np.abs(mean[c]) for c in axes], axis=0)
    moving = np.max([np.abs(drift[c]) for c in axes], axis=0)
    current = np.max([np.abs(drift[p] - drift[n]) / 2 for p, n in axes.values()], axis=0)
    for values, limit, what, unit, scale in (
        (position, max_position_m, "mean position", "µm", 1e6),
        (moving, 2 * max_position_m, "drift of the position", "µm", 1e6),
        (current, max_drift_A, "drift of an AMB's control current", "mA", 1e3),
    ):
        bad = values > limit
        if bad.any():
            yield Finding(
                "unsettled",
                f"{what} within a step: {values.max() * scale:.3g} {unit} at worst, {limit * scale:.3g} {unit} allowed; "
                f"{int(bad.sum())} of {bad.size} steps. Settle longer, or look at the integrator.",
                where(values),
                Effect.INDETERMINATE,
            )


def longest_at(position: Array, limit: float) -> int:
    """Most neighbouring samples of a position in m that stand at a limit, within its last digit."""
    at = np.concatenate([[0], (np.abs(position - limit) < SAME_M).astype(int), [0]])
    edges = np.flatnonzero(np.diff(at))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def clips(positions: Iterable[Array]) -> int:
    """Most neighbouring samples of a probe that stand at its extreme: one that clips repeats its limit."""
    return max(longest_at(x, limit) for x in positions for limit in (x.max(), x.min()))
