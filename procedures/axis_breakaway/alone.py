"""From ramps as they are recorded to what each axis would break away at with nothing beside it, and seen at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.rigfile import RigFile
from bench.rigfile.stage import StageAxis
from procedures.axis_breakaway import fit
from procedures.axis_breakaway.fit import Bend
from procedures.axis_breakaway.plan import Plan
from procedures.axis_breakaway.sequence import WAYS, beside, chosen, pair, seen
from procedures.axis_breakaway.steps import Ramp
from procedures.stages.pairs import MACHINE

Array = npt.NDArray[np.float64]
Bends = Mapping[tuple[str, int], Bend]
Place = tuple[str, int]  # load, repeat
LEAST = 1e-6  # share of an axis' breakaway
ROUNDS = 4  # what a count delays goes by what acts beside, and that is told by forces without it


@dataclass(frozen=True)
class Bearing:
    """What all ramps tell together: by axis the force that breaks it away by its map, and how fast it rises; by axis and way
    how it bends with what acts beside it, for those that were pulled."""

    friction: Mapping[str, float]
    rise: Mapping[str, float]
    bends: Bends


def inertia(axis: StageAxis, rig: RigFile) -> float:
    """That the rig file has of an axis, kg or kg m2; 0: none."""
    number = rig.machine.get(MACHINE[axis.unit])
    return 0.0 if number is None else number.value


def bearing(ramps: Sequence[Ramp], rig: RigFile, plan: Plan) -> Bearing:
    """Of ramps whose forces are as they were recorded.

    Raises:
        AnalysisError: ramps of an axis are missing.
    """
    friction: dict[str, float] = {}
    rise: dict[str, float] = {}
    bends: dict[tuple[str, int], Bend] = {}
    for axis in chosen(rig, plan):
        own = [r for r in ramps if r.axis == axis.name and not r.turned]
        free = [r.way * r.force[axis.name] for r in own if not r.load]
        if not free:
            raise AnalysisError(f"{axis.name}: found no ramp without a load (was the run stopped early?)")
        friction[axis.name] = float(np.mean(free))
        rise[axis.name] = float(np.median([abs(r.rises[axis.name]) for r in own]))
    for axis in chosen(rig, plan):
        if (other := beside(rig, plan, axis)) is not None:
            start = friction[axis.name], rise[axis.name]
            friction[axis.name], found = _pulled(ramps, rig, plan, (axis, other), *start)
            bends |= {(axis.name, way): bent for way, bent in found.items()}
    return Bearing(friction, rise, bends)


def _pulled(
    ramps: Sequence[Ramp], rig: RigFile, plan: Plan, axes: tuple[StageAxis, StageAxis], friction: float, rise: float
) -> tuple[float, dict[int, Bend]]:
    """An axis' friction with nothing beside it, and how it bends each way, by turns."""
    axis, other = axes
    bends: dict[int, Bend] = {}
    for _ in range(ROUNDS):
        free: list[float] = []
        for way in WAYS:
            force, aside = _forces(_places(ramps, axis, way), axis)
            found = bends[way] = _bend(force, aside, axis, other, rig, Bend(friction, np.inf, 0.0), rise)
            places, force, s = _seen_at_once(ramps, rig, plan, axis, way, found, rise)
            free += [float(f) for f, r in zip(fit.alone(force, s, found), places, strict=True) if not r.load]
        friction = float(np.mean(free))
    return friction, bends


def _places(ramps: Sequence[Ramp], axis: StageAxis, way: int) -> dict[Place, list[Ramp]]:
    """Those of an axis one way, by load and repeat, as many pulls each.

    Raises:
        AnalysisError: some are missing.
    """
    out: dict[Place, list[Ramp]] = {}
    for r in ramps:
        if r.axis == axis.name and r.way == way and not r.turned:
            out.setdefault((r.load, r.repeat), []).append(r)
    pulls = {r.pull for each in out.values() for r in each}
    for each in out.values():
        if len(each) != len(pulls):
            raise AnalysisError(
                f"{each[0].where}: found {len(each)} ramps; expected {len(pulls)} (was the run stopped early?)"
            )
    return out


def _forces(places: Mapping[Place, Sequence[Ramp]], axis: StageAxis) -> tuple[Array, Array]:
    """Force in the way it pushes, and what acts beside, (m, p) each."""
    force = np.array([[r.way * r.force[axis.name] for r in each] for each in places.values()])
    return force, np.array([[r.beside for r in each] for each in places.values()])


def _bend(
    force: Array, aside: Array, axis: StageAxis, other: StageAxis, rig: RigFile, found: Bend, rise: float
) -> Bend:
    for _ in range(ROUNDS):
        late = _late(fit.shares(force, aside, found), axis, other, rig, found, rise)
        found = fit.bend(force - late, aside, found.friction)
    return found


def _late(s: Array, axis: StageAxis, other: StageAxis, rig: RigFile, bent: Bend, rise: float) -> Array:
    """What a count takes beside shares `s` of what breaks the other axis away, N or N m in the mean: (3) without R_j."""
    turn = s / np.sqrt(1 - s**2) * bent.friction / bent.limit
    whole = inertia(axis, rig) + turn**2 * inertia(other, rig)
    return (
        np.asarray(fit.MEAN * rise * fit.passes(whole, seen(axis), np.asarray(rise))) if rise > 0 else np.zeros_like(s)
    )


def alone(ramps: Sequence[Ramp], rig: RigFile, plan: Plan, b: Bearing, bends: Bends | None = None) -> list[Ramp]:
    """One for each axis, load, repeat and way, and all helices, with forces less what a count has them go on by, and as they
    are with nothing beside. `bends` instead of those of `b`.

    Raises:
        AnalysisError: ramps are missing.
    """
    out = []
    for axis in chosen(rig, plan):
        for way in WAYS:
            found = (b.bends if bends is None else bends).get(
                (axis.name, way), Bend(b.friction[axis.name], np.inf, 0.0)
            )
            places, force, s = _seen_at_once(ramps, rig, plan, axis, way, found, b.rise[axis.name])
            for value, first in zip(fit.alone(force, s, found), places, strict=True):
                out.append(replace(first, pull=0, beside=0.0, force={axis.name: way * float(value)}))
    both = pair(rig, plan)
    return [*out, *(_helix(r, both, rig, b) for r in ramps if r.turned and both is not None)]


def circle(ramps: Sequence[Ramp], rig: RigFile, plan: Plan, b: Bearing) -> dict[str, tuple[Array, Array]]:
    """Of axes that were pulled, all ramps: what acted beside as a share of what breaks that away, and what was left of the
    axis' own friction, as a share of it."""
    out: dict[str, list[Array]] = {}
    for axis in chosen(rig, plan):
        for way in WAYS:
            if (found := b.bends.get((axis.name, way))) is not None:
                _, force, s = _seen_at_once(ramps, rig, plan, axis, way, found, b.rise[axis.name])
                left = 1 - (fit.alone(force, s, found)[:, None] - force) / found.friction
                out.setdefault(axis.name, []).append(np.array([s.ravel(), left.ravel()]))
    return {name: (both[0], both[1]) for name, each in out.items() for both in [np.concatenate(each, axis=1)]}


def _seen_at_once(
    ramps: Sequence[Ramp], rig: RigFile, plan: Plan, axis: StageAxis, way: int, found: Bend, rise: float
) -> tuple[list[Ramp], Array, Array]:
    """The first ramp of each place; of all pulls forces less what a count takes, and shares beside, (m, p) each."""
    places, other = _places(ramps, axis, way), beside(rig, plan, axis) or axis
    force, aside = _forces(places, axis)
    late = s = np.zeros_like(force)
    for _ in range(ROUNDS):
        late = _late(s, axis, other, rig, found, rise)
        s = fit.shares(force - late, aside, found)
    return [each[0] for each in places.values()], force - late, s


def _helix(r: Ramp, both: tuple[StageAxis, StageAxis], rig: RigFile, b: Bearing) -> Ramp:
    """Both go along the path on which they were held: the first that goes by a count ends it."""
    share = [max(abs(r.force[a.name]) / b.friction[a.name], LEAST) for a in both]
    late = np.inf
    for k, axis in enumerate(both):
        other = both[1 - k]
        turn = share[1 - k] / share[k] * b.friction[axis.name] / b.friction[other.name]
        rise = abs(r.rises[axis.name]) + turn * abs(r.rises[other.name])
        if rise > 0:
            whole = inertia(axis, rig) + turn**2 * inertia(other, rig)
            late = min(late, fit.MEAN * float(fit.passes(np.asarray(whole), seen(axis), np.asarray(rise))))
    late = late if np.isfinite(late) else 0.0
    return replace(r, force={n: f - np.sign(f) * abs(r.rises[n]) * late for n, f in r.force.items()})
