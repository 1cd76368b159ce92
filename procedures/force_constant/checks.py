"""What can be wrong with a force-constant run, and what its data can say about it. Each check names its suspect.

Thresholds are chosen so that a sound rig trips one in fewer than one run in a thousand; each is stated where it stands.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding
from bench.uncertainty import Estimate
from procedures.force_constant import load_at_rest
from procedures.force_constant.fit import CROSS, DIRECT, FORCE, PAIRS
from procedures.force_constant.load_at_rest import Cause, Rest
from procedures.force_constant.plan import Plan
from procedures.force_constant.requires import AXES
from procedures.force_constant.steps import AtLevel, RampData
from procedures.servomotor import checks as servomotor_checks
from procedures.servomotor.conventions import Servomotor
from procedures.shared import signals
from procedures.shared.step_table import StepTable

Array = npt.NDArray[np.float64]

ALONG = {"y": ("alpha_d",), "x": ("alpha_dx",)}  # what is measured along an axis
FATAL = ("stuck-channel", "segment-sign", "segment-current")
"""Findings after which a fit means nothing and is not attempted."""
FOLLOWS = 0.05  # A per A, share of a level that a segment's current may be off: sensors and amplifiers are within 0.5 %
EXCHANGED = 0.3  # cross over direct force: 8 % by half a degree of encoder zero, a few per cent by ripple
CHANCE = 1e-6  # false alarm rate of the tests of the fit


def of_signals(data: RampData, machine: Servomotor, plan: Plan) -> Iterator[Finding]:
    """Checks that need no fit: losses, stuck channels, saturation, contact, settling, segments that do as commanded."""
    table = data.table
    yield from servomotor_checks.of_signals(table, machine, tuple(table.mean), plan.max_lost)
    yield from settled(table, machine, plan)
    yield from segments(table, machine)


def settled(table: StepTable[AtLevel], machine: Servomotor, plan: Plan) -> Iterator[Finding]:
    """Shaft and control currents stand while a level is held."""
    axes = {machine.positions[axis]: machine.coils[axis] for axis in AXES}
    yield from signals.settled(table.mean, table.drift, axes, plan.max_position_m, plan.max_drift_A, table.where)


def segments(table: StepTable[AtLevel], machine: Servomotor) -> Iterator[Finding]:
    """Each segment's current follows its command (T 6.9), and no level asks the angle control for torque."""
    level_y, level_x = table.each(lambda at: at.i_y_A), table.each(lambda at: at.i_x_A)
    design = np.stack([np.ones_like(level_y), level_y, level_x], axis=-1).reshape(-1, 3)
    solver = np.linalg.pinv(design)[1:]
    answer = np.array([solver @ table.mean[c].reshape(-1) for c in machine.segments])  # (4, 2): per i_y, per i_x
    expected = np.array([[1.0, 0.0], [0.0, -1.0], [-1.0, 0.0], [0.0, 1.0]])
    reversed_ = (answer * expected).sum(axis=1) < -0.5
    if reversed_.sum() == 1:
        k = int(np.argmax(reversed_))
        text = f"the current of segment {k + 1} reads with the opposite sign: check the sign of its sensor."
        yield Finding("segment-sign", text, machine.segments[k], Effect.ERROR)
        return
    torque = answer.mean(axis=0)
    for axis, name in ((0, "i_y"), (1, "i_x")):
        if abs(torque[axis]) > 2 * FOLLOWS:
            suspect = int(np.argmax(np.abs(answer[:, axis]))) + 1
            yield Finding(
                "segment-sign",
                f"holding the angle takes {torque[axis]:+.2f} A in every segment per A of {name}, where a pure force takes "
                f"none: a segment pushes the wrong way. Segment {suspect} carries {answer[suspect - 1, axis]:+.2f} A per A "
                "by its own sensor; check the sign of its sensor and its wires.",
                machine.segments[suspect - 1],
                Effect.ERROR,
            )
            return
    off = np.abs(answer - torque - expected).max(axis=1)
    if off.max() > FOLLOWS:
        k = int(np.argmax(off))
        yield Finding(
            "segment-current",
            f"segment {k + 1} reads {answer[k, 0]:+.2f} A per A of i_y and {answer[k, 1]:+.2f} A per A of i_x; by (6.9) it "
            f"should be {expected[k, 0]:+.0f} and {expected[k, 1]:+.0f}. Check its sensor and its amplifier.",
            machine.segments[k],
            Effect.ERROR,
        )


def exchanged(axis: str, terms: Array) -> Iterator[Finding]:
    """Segments whose wires are exchanged: the other axis' current gives force, or the own one the wrong way round.

    `terms` (2, A, 5) of the fit. With 1 and 2 exchanged the motor sees (i_y - i_x)/2 in both axes, with 1 and 4
    (i_y + i_x)/2, with 1 and 3 it sees -i_y.
    """
    direct, cross = (float(terms[FORCE, :, k].mean()) for k in (DIRECT, CROSS))
    own = PAIRS[axis][0]
    if abs(cross) > EXCHANGED * abs(direct):
        pairs = "1 and 2, or 3 and 4" if direct * cross < 0 else "1 and 4, or 2 and 3"
        text = (f"along {axis} the other axis' current gives {cross / direct:+.0%} of the force that i_{axis} gives: "
                f"segments {pairs} look exchanged (a wrong encoder zero gives 8 % for half a degree).")  # fmt: skip
        yield Finding("segments-exchanged", text, axis, Effect.ERROR)
    elif direct < 0:
        text = (f"i_{axis} gives {direct:+.2f} N/A along {axis}: segments {own[0]} and {own[1]} look exchanged, or both "
                "are connected the wrong way round.")  # fmt: skip
        yield Finding("segments-exchanged", text, axis, Effect.ERROR)


def beyond(chi2: float, parts: int, dof: int) -> bool:
    """Whether a chi-squared of that many parts is none by chance, its scatter being known with `dof` (F test)."""
    from scipy import special

    return bool(chi2 / parts > special.fdtri(parts, dof, 1 - CHANCE))


def rows_disagree(axis: str, rows: tuple[float, float], z: float, apart: bool, suspect: str) -> Iterator[Finding]:
    """Force row and moment row, by the full covariance of their differences: the mean difference `z` in its standard
    uncertainty (five allowed), or `apart` at the single angles."""
    if abs(z) > 5 or apart:
        hint = suspect or (
            "an AMB's constants do not belong to this rig as it stands" if axis == "y" else
            "K_x of an AMB is further from K_y than machine.amb_asymmetry says"
        )  # fmt: skip
        where = (
            f"by {abs(z):.1f} standard uncertainties" if abs(z) > 5 else "from angle to angle, more than their scatter"
        )
        yield Finding(
            "rows-disagree",
            f"along {axis} forces give {rows[0]:.3f} N/A and moments {rows[1]:.3f} N/A; they differ {where}: {hint}.",
            axis,
            Effect.ERROR,
        )


def lack_of_fit(axis: str, bent: bool, worst_N: float, suspect: str) -> Iterator[Finding]:
    """Square and cube of the current in the forces, `bent` by their full covariance."""
    if bent:
        hint = (
            suspect or "a coil or a segment saturates, or the calibration is of another angle, bias or rotor position"
        )
        yield Finding(
            "misfit",
            f"the force along {axis} is not proportional to the current: {worst_N:.2f} N at the extreme levels, more than "
            f"the calibration and the scatter allow: {hint}.",
            axis,
            Effect.INDETERMINATE,
            ALONG[axis],
        )


def axes_disagree(y: Estimate, x: Estimate) -> Iterator[Finding]:
    """alpha_d and alpha_dx differ by the segments' gains in the machine only: 3 % and five standard uncertainties."""
    apart = y - x
    allowed = 5 * apart.u + 0.03 * abs(y.value)
    if abs(apart.value) > allowed:
        yield Finding(
            "axes-disagree",
            f"alpha_d is {y.value:.3f} N/A vertically and {x.value:.3f} N/A horizontally; {allowed:.2f} N/A of "
            "difference is allowed. Is a winding or an AMB of one axis different?",
            "alpha_dx",
            Effect.INDETERMINATE,
        )


def load_moved(rest: Rest | None, expanded: float) -> Iterator[Finding]:
    """Another load at rest than at the calibration, beyond five standard uncertainties. A note where all that would explain it
    leaves alpha_d within its own `expanded` uncertainty, N/A: a probe's zero wanders by half a micrometre in a warm room."""
    if rest is None or not rest.beyond.any():
        return
    names = [name for name, beyond in zip(("inboard", "outboard"), rest.beyond, strict=True) if beyond]
    carried = " and ".join(
        f"the {name} AMB {moved:+.3f} N ({abs(moved) / u:.0f} standard uncertainties)"
        for name, moved, u, beyond in zip(("inboard", "outboard"), rest.moved, rest.u, rest.beyond, strict=True)
        if beyond
    )
    worst = max(abs(c.shift) for c in rest.causes)
    text = (
        f"with no current in the motor the AMBs' currents carry another load than at their calibration: {carried}. "
        f"It would be {', or '.join(_cause(c) for c in rest.causes)}."
    )
    if worst <= expanded:
        yield Finding("load-moved", f"{text} alpha_d is moved by less than its uncertainty.", "/".join(names))
        return
    more = "Look at the sensors, and that shaft and probes are as they were; calibrate the AMBs again."
    yield Finding("load-moved", f"{text} {more}", "/".join(names), Effect.INDETERMINATE, ALONG["y"])


def _cause(c: Cause) -> str:
    off = f"then off by {c.shift:+.3f} N/A"
    if len(c.sensors) > 1:
        zeros = " and ".join(f"{s} by {1e6 * x:+.2f} µm" for s, x in zip(c.sensors, c.amounts, strict=True))
        return f"another shaft, or moved zeros of {zeros} (alpha_d {off})"
    which = "all four vertical coils' sensors" if c.sensors[0] == load_at_rest.ALL else c.sensors[0]
    return f"a gain of {which} changed by {c.amounts[0]:+.2%}, or its offset (alpha_d {off})"


def wander(axis: str, drift: Array, u: Array, data: RampData, plan: Plan) -> Iterator[Finding]:
    """Drift of the motor's force by both rows, (2,) N/s with u, over the run: five u and the plan's limit."""
    total = drift * data.duration_s
    significant = (np.abs(total) > plan.max_wander_N) & (np.abs(drift) > 5 * u)
    if not significant.any():
        return
    both = bool(abs(drift[0] - drift[1]) < 5 * math.hypot(*u) + 0.1 * np.abs(drift).max())
    pair = PAIRS[axis][0]
    bearing = "outboard" if abs(drift[1]) < 0.2 * abs(drift[0]) else "inboard"
    what = (f"both rows agree, so the motor's force itself drifts: the current sensor of segment {pair[0]} or {pair[1]}"
            if both else f"the rows do not agree, so it is a coil sensor of the {bearing} AMB, axis {axis}")  # fmt: skip
    yield Finding(
        "drifting-sensor",
        f"at a constant level the force along {axis} drifts by {total[0]:+.2f} N (force row) and {total[1]:+.2f} N (moment "
        f"row) over the {data.duration_s:.0f} s of the run, {plan.max_wander_N:g} N allowed; {what}.",
        axis,
        Effect.INDETERMINATE,
        ALONG[axis],
    )
