"""Drift between the halves of a run that was stopped and continued, by the greatest loads of a place that are read in both.

The cells are mounted anew and the shaft is sent there anew, so that its place is another one by some counts. What cells show,
less what the fit makes of both places and currents, differs by

    d = (F' - F shown by the terms at x', a', i') - (F - F shown by them at x, a, i),   and T alike

which are fitted by four numbers: shares by which each cell shows more, and by how much each encoder's reading is off. A reading
scatters by what the fit's residuals have, freed of d, or by what these four leave of d where that is more. Each is told
beyond Student's t at `continued.CHANCE` and half a count of its encoder, with its 95 % interval. Where these four leave more
of d than chance does (chi-squared), shares by which each phase presses more take the place of those of the cells, and the
phase is told whose is the greatest; where these leave more too, that alone is told, and decides.

A change decides where a result would move by more than `continued.MATTERS` of its U: by the fit with all readings after the
seam freed of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from bench.findings import Finding
from bench.recording import Recording
from bench.recording.earlier import AGAIN, CONTINUED
from bench.recording.steps import Step
from bench.rigfile import RigFile
from bench.uncertainty import interval
from bench.uncertainty.coverage import coverage_factor
from procedures.shared import continued
from procedures.stages.stators import phases
from procedures.static_characteristics import estimates, fit
from procedures.static_characteristics.estimates import Result
from procedures.static_characteristics.fit import SHARE
from procedures.static_characteristics.model import Array, Rows, Terms, shown
from procedures.static_characteristics.places import SIDES, grid, repeated
from procedures.static_characteristics.plan import Plan
from procedures.static_characteristics.readings import less_zeros, rows
from procedures.static_characteristics.requires import Cell, cells
from procedures.static_characteristics.steps import READING, Taken, taken_at

STEPS = (1e-5, 1e-4)  # m and rad, for slopes of the model
SUSPECTS = "a cell or its arm, the encoder's zero, a current sensor, or the magnetic circuit"


@dataclass(frozen=True)
class Change:
    """Since a seam, of the two cells, relative, and of both encoders, m and rad: `value` (4,), standard deviations `u` with
    `dof`, and what counts leave open, `within`. `chance` of what these leave; `shares` (6,) by which phases press more, with
    encoders that are off, their `shares_u`, and the chance of what they leave."""

    value: Array
    u: Array
    within: Array
    dof: int
    chance: float
    shares: Array
    shares_u: Array
    shares_chance: float


def findings(recording: Recording[Plan], r: Result) -> Iterator[Finding]:
    """What changed at each seam."""
    places, rig = grid(recording.plan), recording.rig
    for steps in _repeats(recording):
        number = int(steps[0].labels["place"])
        again = taken_at(recording, places[number : number + 1], steps)
        keep = repeated(recording.plan, r.phases)
        yield from told(change(r, rig, number, again, keep), r, rig, number)


def _repeats(recording: Recording[Plan]) -> Iterator[list[Step]]:
    """The readings that were taken again after each seam, where they are all there: a run may have been stopped once more."""
    seams = [int(e["t_ns"]) for e in recording.events(CONTINUED)]
    wanted = len(SIDES) * len(repeated(recording.plan, phases(recording.rig)))
    for begin, end in pairwise([*seams, 2**63]):
        steps = [s for s in recording.steps(READING + AGAIN) if begin <= s.start_ns < end]
        if len(steps) == wanted:
            yield steps


def change(r: Result, rig: RigFile, number: int, again: Taken, keep: tuple[int, ...]) -> Change:
    """By the loads `keep` at the place with that number."""
    both = cells(rig)
    assert both is not None
    one, other = (rows(_of(t, k, keep), rig, both) for t, k in ((r.taken, number), (again, 0)))
    at, t = Terms(len(r.rows.x)), r.found.terms
    each = [np.concatenate([t[: at.once.stop], [off], t[at.scale :]]) for off in (float(t[at.off][number]), 0.0)]
    left = [_both(s.force, s.torque) - _both(*shown(terms, s)) for terms, s in zip(each, (one, other), strict=True)]
    expected, noise = _both(one.force, one.torque), np.repeat(one.noise, len(one.force))
    known, d = np.hypot(noise, SHARE * expected), left[1] - left[0]
    design, by_phase = _slopes(each[1], other), _of_phases(each[1], other)
    phased = np.column_stack([by_phase, design[:, 2:]])
    first, *_ = np.linalg.lstsq(phased / known[:, None], d / known, rcond=None)
    u = math.sqrt(2) * known * max(1.0, min(r.found.size, _size(r, rig, first, number)))
    value, value_u, chance = _solved(design / u[:, None], d / u)
    shares, shares_u, shares_chance = _solved(phased / u[:, None], d / u)
    within, count = np.array([0.0, 0.0, *_half_counts(both)]), by_phase.shape[1]
    return Change(value, value_u, within, len(d) - len(value), chance, shares[:count], shares_u[:count], shares_chance)


def _size(r: Result, rig: RigFile, found: Array, number: int) -> float:
    """Of the residuals, freed of shares of phases and of encoders that are off: a drift must not hide in the scatter that it
    makes."""
    both, t = cells(rig), r.taken
    assert both is not None
    for k, share in enumerate(found[:-2]):
        t = freed_of_phase(t, k, float(share), number)
    t = freed(t, np.array([0.0, 0.0, *found[-2:]]), number)
    return fit.fitted(rows(t, rig, both), r.found.terms, r.known).size


def _solved(design: Array, d: Array) -> tuple[Array, Array, float]:
    """Terms, their standard deviations (by what they leave where that is more), and the chance of what they leave."""
    from scipy import special

    value, *_ = np.linalg.lstsq(design, d, rcond=None)
    left, dof = float(((d - design @ value) ** 2).sum()), len(d) - len(value)
    covariance = np.linalg.pinv(design.T @ design) * max(left / dof, 1.0)
    return np.asarray(value, np.float64), np.sqrt(np.diag(covariance)), float(special.chdtrc(dof, left))


def _of_phases(t: Array, of: Rows) -> Array:
    """What a share by which each phase presses more does, (2 n, 6)."""
    force, torque = shown(t, of)
    return np.column_stack([_both(np.where(of.phase == k, force, 0.0), np.where(of.phase == k, torque, 0.0))
                            for k in range(len(of.side))])  # fmt: skip


def _both(force: Array, torque: Array) -> Array:
    return np.concatenate([force, torque])


def _of(t: Taken, place: int, keep: tuple[int, ...]) -> Taken:
    """One place with some of its loads."""
    at, some = slice(place, place + 1), list(keep)
    return replace(t, places=t.places[at], loads=t.loads[at, some], times=t.times[at, some], currents=t.currents[at, some],
                   x=t.x[at], angle=t.angle[at])  # fmt: skip


def _slopes(t: Array, of: Rows) -> Array:
    """What shares of the cells and places that are off do to force and torque as they are shown, (2 n, 4)."""
    force, torque = shown(t, of)
    out = [_both(force, 0 * torque), _both(0 * force, torque)]
    for name, step in zip(("x", "angle"), STEPS, strict=True):
        more, less = (_both(*shown(t, replace(of, **{name: getattr(of, name) + by}))) for by in (step, -step))
        out.append((more - less) / (2 * step))
    return np.column_stack(out)


def _half_counts(both: tuple[Cell, Cell]) -> list[float]:
    return [0.0 if c.axis.pitch is None else c.axis.pitch.value / 2 for c in both]


def freed(t: Taken, value: Array, number: int) -> Taken:
    """Readings of the places after that one, freed of a change."""
    after = np.arange(len(t.x)) > number
    more = np.where(after[:, None], 1 + value[None, :2], 1.0)
    return replace(
        t, loads=t.loads / more[:, None, None, :], x=t.x + after * value[2], angle=t.angle + after * value[3]
    )


def told(c: Change, r: Result, rig: RigFile, number: int) -> Iterator[Finding]:
    """A finding for each number that changed, after the place with that `number`."""
    from scipy.special import stdtrit

    both, limit = cells(rig), float(stdtrit(c.dof, 1 - continued.CHANCE / len(c.value) / 2))
    assert both is not None
    names = (
        *(f"{cell.by.instrument} shows" for cell in both),
        *(f"the encoder of {cell.axis.name} reads" for cell in both),
    )
    for k, name in enumerate(names):
        value, wide = float(c.value[k]), coverage_factor(c.dof) * float(c.u[k]) + float(c.within[k])
        if abs(value) <= limit * c.u[k] + c.within[k]:
            continue
        alone = np.where(np.arange(len(c.value)) == k, c.value, 0.0)
        moved, what = _moves(r, rig, freed(r.taken, alone, number))
        by = f"{value:+.2%} ± {wide:.2%}" if k < 2 else f"{-value:+.2g} ± {wide:.2g} {both[k - 2].axis.unit}"
        yield continued.drifted(_text(number, f"{name} {by} more", moved, what), both[k % 2].axis.name, moved, SUSPECTS)
    if c.chance < continued.CHANCE:
        yield _beside(c, r, rig, number)


def _beside(c: Change, r: Result, rig: RigFile, number: int) -> Finding:
    """What neither cells nor encoders explain: the phase that presses otherwise, if one does."""
    if c.shares_chance < continued.CHANCE:
        text = (f"the greatest loads of place {number}, read again when the run went on, are others, as neither cells nor "
                "encoders nor phases that press more would have it")  # fmt: skip
        return continued.drifted(text, "", math.inf, SUSPECTS)
    k = int(np.argmax(np.abs(c.shares) / c.shares_u))
    share, name = float(c.shares[k]), r.phases[k].name
    moved, what = _moves(r, rig, freed_of_phase(r.taken, k, share, number))
    wide = coverage_factor(math.inf) * float(c.shares_u[k])
    text = _text(number, f"phase {name} presses {share:+.2%} ± {wide:.2%} more", moved, what)
    return continued.drifted(text, name, moved, "its current sensor or the magnetic circuit")


def _text(number: int, changed: str, moved: float, what: str) -> str:
    return (f"the greatest loads of place {number}, read again when the run went on: {changed}, by which {what} would move by "
            f"{moved:.2g} of its U")  # fmt: skip


def freed_of_phase(t: Taken, k: int, share: float, number: int) -> Taken:
    """Readings of the places after that one, freed of a phase with that number that presses more."""
    per = (t.loads.shape[1] - 2) // len(t.phases)
    loads = less_zeros(t)
    mine = (np.arange(len(t.x)) > number)[:, None] & ((np.arange(loads.shape[1]) - 1) // per == k)
    return replace(t, loads=np.where(mine[:, :, None, None], t.loads - loads * share / (1 + share), t.loads))


def _moves(r: Result, rig: RigFile, other: Taken) -> tuple[float, str]:
    """By how much a result moves at most with other readings, of its U, and which."""
    after = estimates.result(other, rig, r.greatest, r.beside).estimates
    shares = {key: abs(after[key].value - e.value) / interval(e).U for key, e in r.estimates.items() if e.u > 0}
    (name, where), share = max(shares.items(), key=lambda item: item[1])
    return share, f"{name} of {where}" if where else name
