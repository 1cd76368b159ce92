"""Drift between the halves of a calibration that was stopped and continued, by the hanging that is done in both.

The same mass at the same angle asks for the same force. What the fit's terms make of the currents of both hangings, less what
positions add and what the shaft makes of it that stands some mrad beside where it stood (`stands`), differs by

    d = r' - r - s (theta' - theta)

with the slope s of the force over the angle. A hanging scatters (its strap seats anew, noise) by the covariance that the fit's
residuals have, freed of a step between the halves, so that d has twice that variance, and that of an angle by hand. |d| beyond
Student's t at `continued.CHANCE` and what a count of the encoder allows is a drift, told with its 95 % interval: of current or
position sensors, of the magnets, or a hanger that hangs otherwise.

Sensors cool while the machine is off: what can be seen need not matter. A drift decides where K would move by
more than `continued.MATTERS` of its own U: as a step of the force's zero, which moves K at an angle that the seam parts, or,
with a mass on, as one of its scale, which moves K at every angle after it, whichever is more.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding
from bench.recording import Recording
from bench.recording.earlier import AGAIN, CONTINUED
from bench.recording.steps import Step, Steps
from bench.uncertainty.coverage import coverage_factor
from procedures.amb_calibration import stands
from procedures.amb_calibration.fit import Fit, Hangings, left_over, terms_of
from procedures.amb_calibration.plan import Plan
from procedures.amb_calibration.pulls import Pull, pulls
from procedures.amb_calibration.scatter import Scatter, scatter
from procedures.amb_calibration.steps import Hang, HangingData, arrays
from procedures.shared import continued

Array = npt.NDArray[np.float64]
UNCHECKED = "halves-unchecked"
LOADED = 0.2  # of the load range: less says nothing of a scale


@dataclass(frozen=True)
class Difference:
    """A hanging that was done in both halves: its angle and its place among those there; `forces` (K,) N, second less first,
    of each axis, freed of the shaft's other angle to `within` (K,) N, their standard deviations `u` and degrees of freedom,
    and by how much K would move by such a drift, N/A."""

    angle: int
    place: int
    forces: Array
    within: Array
    u: Array
    dof: float
    shifts: Array


def findings(
    recording: Recording[Plan], data: HangingData, f: Fit, p: Mapping[str, float], expanded: Sequence[float]
) -> Iterator[Finding]:
    """A finding for each axis that drifted between two halves, and for halves that nothing holds together. `expanded` is U of
    each axis' K, N/A."""
    pull = data.hangings.pull
    repeats = _of_pull(recording, pull, f"{Hang.kind}{AGAIN}")
    hangings = _of_pull(recording, pull, Hang.kind)
    for seam in (e["t_ns"] for e in recording.events(CONTINUED)):
        before = [s for s in hangings if s.end_ns <= seam]
        after = next((s for s in repeats if s.start_ns >= seam), None)
        if not before or (after is None and _elsewhere(recording, seam)):
            continue  # another hook's
        if after is None or dict(after.labels) != dict(before[-1].labels):
            text = ("the hanging that a stopped run did last was not done again when it went on: whether anything drifted "
                    "meanwhile is not known.")  # fmt: skip
            yield Finding(UNCHECKED, text, "", Effect.INDETERMINATE)
            continue
        found = difference(recording, data, f, p, before[-1], after)
        yield from _drifts(found, data, f, expanded)


def difference(
    recording: Recording[Plan], data: HangingData, f: Fit, p: Mapping[str, float], first: Step, second: Step
) -> Difference:
    """What a hanging asks for when it is done again, less what it asked for."""
    plan, h = recording.plan, data.hangings
    flat = int(np.flatnonzero(data.table.start_ns.ravel() == first.start_ns)[0])
    at = divmod(flat, h.load.shape[1])
    again = arrays(recording, h.pull, Steps((second,)), (1, 1))[0]
    count = len(plan.masses)
    changed = _with(h, at, again)
    moved = left_over(changed, f, p, plan.bias_A, count) - left_over(h, f, p, plan.bias_A, count)
    one, axes = _scatter(recording, data, f, p), range(len(f.terms))
    turned, slope = stands.turned(recording, first, second), stands.slopes(f, terms_of(h, p, plan.bias_A, count), *at)
    u = np.sqrt([2 * one.covariance[(b, b, *at)] + (slope[b] * turned.u) ** 2 for b in axes])
    d = moved[(slice(None), *at)] - slope * turned.rad
    shifts = _shifts(f, data.table.start_ns >= second.start_ns, at, d)
    return Difference(at[0], at[1], d, np.abs(slope) * turned.count, u, float(one.dof), shifts)


def _shifts(f: Fit, after: npt.NDArray[np.bool_], at: tuple[int, int], d: Array) -> Array:
    """By how much K (mean over the angles) would move by a step d (K,) N of the zero, or of the scale, at a seam, (K,) N/A."""
    zero = np.einsum("bap,ap->ba", f.solvers[:, :, 1, :], after.astype(np.float64)).mean(axis=1) * d
    load = f.forces[(slice(None), *at)]
    known = np.abs(load) > LOADED * np.ptp(f.forces, axis=(1, 2))
    relative = np.divide(d, load, out=np.zeros_like(d), where=known)
    moved = np.einsum("bap,bap->ba", f.solvers[:, :, 1, :], after * f.forces).mean(axis=1)
    out: Array = np.maximum(np.abs(zero), np.abs(relative * moved))
    return out


def _drifts(found: Difference, data: HangingData, f: Fit, expanded: Sequence[float]) -> Iterator[Finding]:
    from scipy.special import stdtrit

    limit = float(stdtrit(found.dof, 1 - continued.CHANCE / len(found.forces) / 2))
    k, what = (
        coverage_factor(found.dof),
        str(data.table.labels[found.angle * data.hangings.load.shape[1] + found.place]),
    )
    for b, axis in enumerate(f.pull.axes):
        d, u, within = float(found.forces[b]), float(found.u[b]), float(found.within[b])
        if abs(d) <= limit * u + within:
            continue
        share = abs(d) / float(np.ptp(f.forces[b]))
        text = (
            f"the last hanging before the run was stopped ({what}), done again when it went on, asks the {axis.title} for "
            f"{d:+.3f} N ± {k * u + within:.3f} N more ({share:.2%} of the load range), by which K would move by "
            f"{found.shifts[b]:.2g} N/A (its U is {expanded[b]:.2g} N/A)"
        )
        suspects = "a current or position sensor, the magnets, or how the hanger hangs"
        yield continued.drifted(text, axis.where, float(found.shifts[b]) / expanded[b], suspects)


def _of_pull(recording: Recording[Plan], pull: Pull, kind: str) -> list[Step]:
    several = len(pulls(recording.rig)) > 1
    return [s for s in recording.steps(kind) if not several or s.labels["hook"] == pull.hook]


def _elsewhere(recording: Recording[Plan], seam: int) -> bool:
    """Whether what was done last before a seam hangs on another hook, which has been done again."""
    return any(s.start_ns >= seam for s in recording.steps(f"{Hang.kind}{AGAIN}"))


def _with(h: Hangings, at: tuple[int, int], again: tuple[Array, Array, Array]) -> Hangings:
    """The hangings with other means of one of them."""
    parts: list[Array] = []
    for whole, one in zip((h.currents, h.positions, h.motor_m), again, strict=True):
        changed = np.array(whole)
        changed[(..., *at)] = one[..., 0, 0]
        parts.append(changed)
    return replace(h, currents=parts[0], positions=parts[1], motor_m=parts[2])


def _scatter(recording: Recording[Plan], data: HangingData, f: Fit, p: Mapping[str, float]) -> Scatter:
    """Of a hanging, freed of what drifted at a seam: there the zero of force may differ, by a term that the fit does not have,
    so that a drift does not hide in the scatter that it makes. It takes a degree of freedom where a seam parts an angle."""
    h, plan = data.hangings, recording.plan
    start = data.table.start_ns
    seams = [start > e["t_ns"] for e in recording.events(CONTINUED)]
    parted = [after for after in seams if (after.any(axis=1) & ~after.all(axis=1)).any()]
    design = terms_of(h, p, plan.bias_A, len(plan.masses))
    after = (
        np.stack([np.broadcast_to(one, design.shape[:-1]) for one in parted], axis=-1) if parted else design[..., :0]
    )
    wider = np.concatenate([design, after], axis=-1)
    solvers = np.linalg.pinv(wider)
    rest = f.forces - np.einsum("bapf,bafq,baq->bap", wider, solvers, f.forces)
    found = scatter(replace(f, residuals=rest, solvers=solvers), h, len(plan.masses))
    return replace(found, dof=found.dof - len(parted))
