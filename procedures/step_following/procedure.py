"""Steps of a positioned stage, each axis alone and all at once: where they end, how far beyond they go, how long they take.

Measurands, by axis, mode and way: where the axis stands in the last part of a step less its set point, positive beyond it, by
the encoder's own scale and as it truly is; the farthest it gets beyond it, share of the step; from the set point's start until
it stays in a band. Means over the steps that count.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from bench.figures import Figure
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from procedures.stages import assumptions, tracks
from procedures.stages.tracks import Mode, chosen, sisters, waits_at
from procedures.step_following import estimates
from procedures.step_following.estimates import ERROR, OVER, TIME, TRUE, Results
from procedures.step_following.plan import Plan
from procedures.step_following.requires import requires
from procedures.step_following.steps import DOWN, STEP, UP, modes_of, places, read, targets

STATIC = sisters(ERROR, "where the axis stands beyond its set point, by the encoder's own scale, mean over repeats")
TRULY = sisters(TRUE, "where the axis truly stands beyond its set point, mean over repeats")
OVERSHOOT = Quantity(OVER, "1", "farthest beyond the set point, share of the step, mean over repeats")
SETTLING = Quantity(TIME, "s", "from the set point's start until the axis stays in the band, mean over repeats")
PAIRS = (STATIC, TRULY)
MEASURES = (*STATIC, *TRULY, OVERSHOOT, SETTLING)


def settings(rig: RigFile, plan: Plan) -> Mapping[str, float]:
    """Integrators."""
    return tracks.settings_of(rig, plan.integrators)


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Each mode from where all axes wait; they end there."""
    assert rig.motion is not None
    rest = {a.name: waits_at(a) for a in chosen(rig.file, plan.moved)}
    for mode in modes_of(rig.file, plan):
        rig.motion.move(rest)
        rig.motion.move(targets(mode, plan, DOWN))
        rig.clock.sleep(plan.dwell_s)
        for repeat in range(-plan.lead, plan.repeats):
            for way in (UP, DOWN):
                _step(rig, plan, record, mode, repeat, way)
    rig.motion.move(rest)


def _step(rig: Rig, plan: Plan, record: Recorder, mode: Mode, repeat: int, way: str) -> None:
    assert rig.motion is not None
    with record.step(STEP, mode=mode.name, repeat=repeat, way=way):
        rig.clock.sleep(plan.before_s)
        begun = rig.clock.now_ns()
        rig.motion.move(targets(mode, plan, way))
        rig.clock.sleep(max(plan.dwell_s - 1e-9 * (rig.clock.now_ns() - begun), 0.0))


def evaluate(recording: Recording[Plan], findings: Findings) -> Results:
    """Whether the axes were sent, and what they did."""
    from procedures.step_following import checks

    rig, plan, moves = recording.rig, recording.plan, read(recording)
    findings.gate(checks.of_moves(moves, rig, plan))
    groups = estimates.grouped(moves, plan)
    findings.add(checks.of_groups(groups, moves, rig, plan))
    positioning = rig.capabilities.positioning
    return estimates.results(groups, plan, positioning.loop_s if positioning is not None else 0.0)


def measured(found: Results) -> Iterator[Measured]:
    """Kind by kind."""
    for quantity in MEASURES:
        for (name, where), estimate in found.estimates.items():
            if name == quantity.name:
                yield quantity.measured(estimate, where)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    yield from tracks.problems_of(rig, plan.moved, plan.integrators)
    for axis in chosen(rig, plan.moved):
        low, high = places(axis, plan)
        key = "places_m" if axis.unit == "m" else "angles_rad"
        if low == high:
            yield f"{key}: found {low:g} twice; expected two places"
        if not all(axis.low <= place <= axis.high for place in (low, high)):
            yield f"{key}: found {low:g} and {high:g}; {axis.name} goes from {axis.low:g} to {axis.high:g} {axis.unit}"
    if plan.rest_s > plan.dwell_s / 2:
        yield f"rest_s: found {plan.rest_s:g} s; expected at most half of dwell_s, {plan.dwell_s:g} s"


def figures(found: Results, recording: Recording[Plan]) -> Iterable[Figure]:
    """Set point and reading, and the error in detail."""
    from procedures.step_following import figures as drawn

    return drawn.all_figures(found, recording.plan)


def steps_on(rig: RigFile, plan: Plan) -> int:
    """Of all modes."""
    return 2 * (plan.lead + plan.repeats) * len(modes_of(rig, plan))


procedure = Procedure(
    name="step-following",
    title="Steps of a positioned stage: static error, overshoot, settling",
    measures=MEASURES,
    state=RigState.HELD,
    plan=Plan,
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    settings=settings,
    steps_on=steps_on,
    optional=(SETTLING,),
    untold=lambda rig: tracks.untold(rig, PAIRS),
    left_out=lambda plan: tracks.left_out(plan.moved, PAIRS),
    assumes=assumptions.FOLLOWING,
    places=("up", "down", tracks.TOGETHER, "integrators off"),
    method=read_method(__file__),
)
