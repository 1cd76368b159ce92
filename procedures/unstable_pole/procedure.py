"""The unstable pole of a shaft in magnetic bearings that pull it away: currents held for some ms, and what it does then.

Measurand, by axis: `pole`, sqrt((K_1 + K_2)/m) of the negative stiffnesses of both planes, with the centre of mass in
the middle between them. No force constant and no position gain is used: `fit` says why.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import cycle, islice
from typing import TYPE_CHECKING

from bench.errors import BenchError
from bench.figures import Figure
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.capture import rises
from bench.rigfile.envelope import Envelope
from procedures.shared import assumptions, planned
from procedures.unstable_pole.hold import SPARE, ability, captured, chosen, foreseen, place, rate
from procedures.unstable_pole.plan import Plan
from procedures.unstable_pole.requires import requires
from procedures.unstable_pole.steps import STEP, read_taken

if TYPE_CHECKING:
    from procedures.unstable_pole.estimates import Result

POLE = Quantity("pole", "1/s", "how fast both planes leave their place together, held currents: sqrt((K_1 + K_2)/m)",
                title="unstable pole")  # fmt: skip
STIFFNESS = Quantity("stiffness", "N/m", "of both planes together, negative; computed: pole squared times the stated mass",
                     title="negative stiffness, computed")  # fmt: skip
MEASURES = (POLE, STIFFNESS)
SIGNS = (1.0, -1.0, -1.0, 1.0)
"""Of the pushes of one axis, again and again: a drift that goes straight is in neither way more than in the other."""


def step_count(plan: Plan) -> int:
    """How many shots, of two axes where the plan names none."""
    return (len(plan.axes) or 2) * plan.shots


def steps_on(rig: RigFile, plan: Plan) -> int:
    """How many on a rig."""
    return len(chosen(rig, plan)) * plan.shots


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """The observer, and where a hold ends."""
    return {**planned.observer(rig, plan.observer), ability(rig).bound: plan.bound_m}


def order(rig: RigFile, plan: Plan) -> Iterator[tuple[str, float]]:
    """Axis and push of each shot: all axes in turn."""
    for sign in islice(cycle(SIGNS), plan.shots):
        yield from ((axis, sign * plan.push_A) for axis in chosen(rig, plan))


def capture_s(plan: Plan) -> float:
    """How long a capture is."""
    return plan.lead_s + plan.hold_s + plan.tail_s


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Go to the place, and shoot; where a hold does not come, no further one is asked for."""
    motion, at = rig.file.capabilities.motion, place(rig.file, plan)
    if motion is not None and at is not None:
        rig.levitation.write({motion.place: at})
    rig.clock.sleep(plan.settle_s)
    for number, (axis, push) in enumerate(order(rig.file, plan)):
        if not _shot(rig, plan, record, number, axis, push):
            return


def _shot(rig: Rig, plan: Plan, record: Recorder, number: int, axis: str, push: float) -> bool:
    """One hold and its capture; whether it came."""
    assert rig.capture is not None
    can = ability(rig.file)
    with record.step(STEP, number=number, axis=axis, push_A=push):
        rig.capture.arm(captured(rig.file), seconds=capture_s(plan), before_s=plan.lead_s, rate_hz=rate(rig.file),
                        trigger=rises(can.held, 1.0))  # fmt: skip
        rig.clock.sleep(2 * plan.lead_s)
        rig.levitation.write({can.across: can.axes[axis].value, can.push: push})
        rig.levitation.set(can.begin, plan.hold_s)
        try:
            rig.capture.wait(capture_s(plan) + plan.patience_s)
        except BenchError:
            rig.capture.cancel()
            return False
    rig.capture.upload(None, number=number)
    rig.clock.sleep(plan.rest_s)
    return True


def evaluate(recording: Recording[Plan], findings: Findings) -> list[Result]:
    """The pole of each axis."""
    from procedures.unstable_pole import checks, estimates

    taken = read_taken(recording)
    findings.gate(checks.of_signals(taken, recording.rig, recording.plan))
    results, failed = estimates.results(taken, recording.rig, recording.plan)
    findings.add(failed)
    findings.add(checks.of_results(results, recording.plan))
    return results


def measured(results: Sequence[Result]) -> Iterator[Measured]:
    """Both quantities of each axis."""
    for quantity in MEASURES:
        yield from (quantity.measured(r.estimates[quantity.name], r.axis) for r in results)


def figures(results: Sequence[Result], recording: Recording[Plan]) -> Iterable[Figure]:
    """Shots of each axis with their fit."""
    from procedures.unstable_pole import figures as drawn

    del recording
    return drawn.all_figures(results)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts: a shot that would not be caught, above all."""
    can = ability(rig)
    for axis in (a for a in plan.axes if a not in can.axes):
        yield f"axes: found {axis}; the controller holds along {', '.join(can.axes)}"
        return
    known = rig.capabilities.settings.get("observer", {})
    if plan.observer and plan.observer not in known:
        yield f"observer: found {plan.observer!r}; expected one of {', '.join(known) or '(the rig file has none)'}"
    if plan.hold_s < plan.skip_s + plan.least_s:
        yield f"hold_s: found {plan.hold_s:g} s; expected skip_s and least_s together or more, {plan.skip_s + plan.least_s:g} s"
    if plan.place_m is not None and (rig.capabilities.motion is None or can.middle is None):
        yield "place_m: the rig file tells no capabilities.motion or no capabilities.hold.middle; expected none"
    for axis in chosen(rig, plan):
        yield from _caught(rig, plan, axis)
    motion, at = rig.capabilities.motion, place(rig, plan)
    wanted = {can.begin: plan.hold_s, can.push: plan.push_A, can.bound: plan.bound_m}
    wanted |= {motion.place: at} if motion is not None and at is not None else {}
    yield from Envelope(rig).problems_of(wanted)


def _caught(rig: RigFile, plan: Plan, axis: str) -> Iterator[str]:
    """By the rig file's numbers, without and with the bound that the controller watches."""
    f = foreseen(rig, plan, ability(rig).axes[axis])
    catch = f"{SPARE:.0%} of what the bearings catch, {SPARE * f.reach * 1e6:.1f} µm"
    if f.to_catch > SPARE * f.reach:
        yield (f"push_A: {plan.push_A:g} A for {plan.hold_s * 1e3:g} ms take {axis} {f.travel * 1e6:.0f} µm off by a pole of "
               f"{f.pole:.0f} 1/s, with a rate that makes it {f.to_catch * 1e6:.0f} µm; expected {catch}, or less")  # fmt: skip
    if f.at_bound > SPARE * f.reach:
        yield (f"bound_m: a reading of {plan.bound_m * 1e6:g} µm goes on as if it were {f.at_bound * 1e6:.0f} µm; expected "
               f"{catch}, or less")  # fmt: skip
    limit = rig.envelope.max_levitated_position_m
    if max(f.travel, f.at_bound) > limit:
        yield f"bound_m: a shot goes {max(f.travel, f.at_bound) * 1e6:.0f} µm; the envelope allows {limit * 1e6:g} µm"


procedure = Procedure(
    name="unstable-pole",
    title="Unstable pole of the levitated shaft",
    measures=MEASURES,
    state=RigState.LEVITATED,
    plan=Plan,
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    settings=settings,
    step_count=step_count,
    steps_on=steps_on,
    assumes=assumptions.UNSTABLE_POLE,
    method=read_method(__file__),
)
