"""What can be wrong with a shaft that phases draw in."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from procedures.map_zero.estimates import Stator, drift, off
from procedures.map_zero.plan import Plan
from procedures.map_zero.steps import Rest
from procedures.shared import signals
from procedures.stages.stators import axis

READY = "READY"
APART = 4.5  # standard uncertainties
FAR = math.radians(12)  # from where the rig file has a phase aligned
LOW = 0.85  # of the current that was asked for
COUNTS = 3.0  # by which the shaft may go while it is read


def of_signals(rests: Sequence[Rest], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Nothing recorded, another state, losses, currents that are not what was asked for."""
    if not rests:
        yield Finding(
            "no-approaches", "the shaft was not drawn in anywhere (was the run stopped early?)", "", Effect.ERROR
        )
        return
    for r in rests:
        if other := [s for s in r.states if rig.binding.mode(s) != READY]:
            text = f"the controller was in {', '.join(other)}: it was not one phase alone that held the shaft."
            yield Finding("loops-on", text, r.approach.name, Effect.ERROR)
            return
    lost, expected = np.array([(r.lost, r.expected) for r in rests], dtype=float).T
    yield from signals.losses(lost, expected, 1e-3, lambda share: rests[int(np.argmax(share))].approach.name)
    ratio = {name: [r.current / r.level for r in rests if r.approach.phase.name == name] for name in
             dict.fromkeys(r.approach.phase.name for r in rests)}  # fmt: skip
    for name, each in ratio.items():
        middle = float(np.median(each))
        if middle < 0:
            text = f"its current is read as {middle:.2g} times what it was asked for."
            yield Finding("current-reversed", text, name, Effect.ERROR)
        elif not LOW < middle < 2 - LOW:
            text = f"its current is {middle:.2g} times what it was asked for."
            yield Finding("current-not-given", text, name, Effect.INDETERMINATE)


def of_order(rests: Sequence[Rest], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """A shaft that a phase draws to somewhere else, or not at all: phases are exchanged, or it is held."""
    last = max(r.level for r in rests)
    for name in dict.fromkeys(r.approach.phase.name for r in rests):
        some = [r for r in rests if r.approach.phase.name == name and r.level == last]
        each = np.array([off(r) for r in some])
        far = float(np.median(np.abs(each)))
        sides = np.array([r.approach.side for r in some])
        if far > FAR:
            text = (f"it draws the shaft to {math.degrees(far):.3g}° from where the rig file has it aligned: "
                    "phases are exchanged, or the encoder's zero is another one.")  # fmt: skip
            yield Finding("phase-draws-elsewhere", text, name, Effect.ERROR)
        elif np.median(np.abs(each - sides * plan.start_rad)) < 0.1 * plan.start_rad:
            text = f"at {last:g} A the shaft stays where it was: a brake holds it, or the phase has no current."
            yield Finding("shaft-stuck", text, name, Effect.ERROR)


def of_results(found: Sequence[Stator], rests: Sequence[Rest], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Stators without enough alignments, friction that hides the zero, a pull on one side, phases apart, a shaft that
    creeps."""
    motors = dict.fromkeys(r.approach.phase.motor for r in rests)
    if missing := [m for m in motors if m not in {s.motor for s in found}]:
        yield Finding("too-few-alignments", f"of {', '.join(missing)} fewer than three came from both sides.", missing[0],
                      Effect.ERROR)  # fmt: skip
        return
    for s in found:
        yield from _of_stator(s, plan)
    angle = axis(rig, "angle")
    count = angle.pitch.value if angle is not None and angle.pitch is not None else 0.0
    worst = max(rests, key=lambda r: r.went)
    if worst.went > COUNTS * count + 1e-9:
        text = f"the shaft went on by {math.degrees(worst.went):.2g}° while it was read. Ramp slower."
        yield Finding("shaft-not-at-rest", text, worst.approach.name, Effect.INDETERMINATE)


def _of_stator(s: Stator, plan: Plan) -> Iterator[Finding]:
    band = s.estimates["band"]
    concerned = (f"zero@{s.motor}",)
    if band.value > plan.max_band_rad:
        text = f"friction leaves {math.degrees(band.value):.2g}° to each side; allowed {math.degrees(plan.max_band_rad):.2g}°."
        yield Finding("friction-wide", text, s.motor, Effect.INDETERMINATE, concerned)
    if band.value < -APART * band.u:
        text = "from above the shaft came to rest below where it did from below: it swings past. Ramp slower."
        yield Finding("swings-past", text, s.motor, Effect.INDETERMINATE, concerned)
    moved, u = drift(s)
    if abs(moved) > plan.max_spread_rad + APART * u:
        text = (f"at {s.levels[0]:g} A both sides' mean is {math.degrees(moved):+.2g}° from that at {s.levels[-1]:g} A: a "
                "steady torque is on the shaft, or friction differs both ways.")  # fmt: skip
        yield Finding("steady-torque", text, s.motor, Effect.INDETERMINATE, concerned)
    each = s.means.mean(axis=1)
    rest = np.abs(each - np.median(each))
    k = int(np.argmax(rest))
    if rest[k] > max(FAR / 4, 0.0):
        text = f"it is {math.degrees(float(each[k] - np.median(each))):+.2g}° from where the others of its stator are."
        yield Finding("alignment-apart", text, s.names[k], Effect.INDETERMINATE, concerned)
