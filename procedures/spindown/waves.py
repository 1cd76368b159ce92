"""A torque that goes round with the rotor, where a motor carries the shaft: found from all run-downs together, and taken off.

A shaft whose probes hold it on an orbit (their targets run out) has with the motor's force current a torque that has the sign
of cos and sin of the angle: some mN m at 4 A and 5 um. In a run-down of two or three turns it is no different from friction.
One that begins half a turn later has the opposite of it, so run-downs begin at places spread over a turn, and two numbers that
all of them share are fitted to what their own fits leave.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding
from procedures.spindown.fit import Coast
from procedures.spindown.steps import RunDown

Array = npt.NDArray[np.float64]
ALIKE = 0.35  # the mean of places on a circle of 1; 0 where they are spread evenly


def spread(runs: Sequence[RunDown]) -> bool:
    """Whether the run-downs of each way at each bias begin at places that lie around a turn: then the mean of each is free of
    it, but for a third."""
    groups: dict[tuple[float, bool, int], list[complex]] = {}
    for r in runs:
        groups.setdefault((r.bias_A, r.ring, r.direction), []).append(complex(np.exp(1j * r.around[0])))
    return all(abs(np.mean(places)) < ALIKE for places in groups.values())


def of_places(runs: Sequence[RunDown]) -> Iterator[Finding]:
    """Run-downs that begin alike."""
    if not spread(runs):
        yield Finding(
            "places-alike",
            "run-downs of one way begin at like places of a turn, so that a torque that goes round with the rotor counts "
            "as friction: T_c may be several mN m off. Look for a link that answers late, or give more repeats.",
            "T_c",
            Effect.INDETERMINATE,
            ("T_c",),
        )


def freed(runs: Sequence[RunDown]) -> list[RunDown]:
    """Run-downs whose b and c are free of it, to first order: J theta'' = -B theta' - T_c + J (p cos theta + q sin theta)."""
    moved = [_moved(r) for r in runs]
    seen = [_beside(r.of_angle, m) for r, m in zip(runs, moved, strict=True)]
    normal = sum((s.T @ s for s in seen), np.zeros((2, 2)))
    inverse = np.linalg.inv(normal)
    pushes: Array = inverse @ sum(
        (s.T @ r.of_angle.fit.residuals for s, r in zip(seen, runs, strict=True)), np.zeros(2)
    )
    left = [r.of_angle.fit.residuals - s @ pushes for s, r in zip(seen, runs, strict=True)]
    # residuals repeat their neighbours: what that does to b and c it does to these
    wide = float(np.mean([r.of_angle.covariance[1, 1] / r.of_angle.fit.covariance[1, 1] for r in runs]))
    variance = sum(float(x @ x) for x in left) / sum(len(x) - 5 for x in left) * wide
    root = np.linalg.cholesky(inverse * variance)
    return [replace(r, of_angle=_without(r.of_angle, m, pushes, root)) for r, m in zip(runs, moved, strict=True)]


def driven(t: Array, push: Array, b: float) -> Array:
    """What an acceleration `push` (n,) rad/s^2 adds to theta(t) of a rotor that drags by b, rad: theta'' = -b theta' + push."""
    grown = np.exp(b * t)
    return _summed(t, _summed(t, grown * push) / grown)


def _summed(t: Array, x: Array) -> Array:
    """The integral of samples (n,) from the first on, by straight lines between them."""
    return np.concatenate([[0.0], np.cumsum(np.diff(t) * (x[1:] + x[:-1]) / 2)])


def _moved(r: RunDown) -> Array:
    """(n, 2): what 1 rad/s^2 of cos and of sin adds to the angle in the direction of turning."""
    waves = [driven(r.t, r.direction * of(r.around), r.of_angle.b) for of in (np.cos, np.sin)]
    return np.column_stack(waves)


def _terms(coast: Coast, moved: Array) -> Array:
    """(p, 2): what a fit without them takes them for."""
    out: Array = np.asarray(np.linalg.lstsq(coast.fit.jacobian, moved, rcond=None)[0], np.float64)
    return out


def _beside(coast: Coast, moved: Array) -> Array:
    """(n, 2): what is left of them beside the terms of the fit."""
    out: Array = np.asarray(moved - coast.fit.jacobian @ _terms(coast, moved), np.float64)
    return out


def _without(coast: Coast, moved: Array, pushes: Array, root: Array) -> Coast:
    taken = _terms(coast, moved)
    b, c, speed = (float(x) for x in coast.fit.terms[:3] - taken[:3] @ pushes)
    left = coast.fit.residuals - _beside(coast, moved) @ pushes
    return replace(
        coast,
        b=float(b),
        c=float(c),
        speed=float(speed),
        shared=taken[:2] @ root,
        fit=replace(coast.fit, residuals=left),
    )
