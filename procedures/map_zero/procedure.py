"""Zeros of a reluctance machine's stators against its encoder: phases draw the shaft in, from both sides.

Measurands, by stator: what the encoder reads where its first phase is aligned, mean over phases, teeth and both sides; half of
what both sides differ by at the greatest current.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from bench.figures import Figure
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.procedure.states import transition
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.envelope import Envelope
from procedures.map_zero.approaches import Approach, approaches, ramp
from procedures.map_zero.plan import Plan
from procedures.map_zero.requires import requires
from procedures.map_zero.steps import LEVEL, read_rests
from procedures.stages import assumptions
from procedures.stages.stators import axis

if TYPE_CHECKING:
    from procedures.map_zero.estimates import Stator

ZERO = Quantity(
    "zero", "rad", "what the encoder reads where the first phase of a stator is aligned, mean over the turn"
)
BAND = Quantity("band", "rad", "half of what the shaft stops apart from below and above, at the greatest current",
                title="friction band")  # fmt: skip
MEASURES = (ZERO, BAND)
SIX = 6


def step_count(plan: Plan) -> int:
    """Of six phases, for the progress display."""
    return SIX * 2 * len(plan.teeth) * len(plan.levels_A)


def steps_on(rig: RigFile, plan: Plan) -> int:
    """How many it records on a rig."""
    return len(approaches(rig, plan)) * len(plan.levels_A)


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Locked along; for each approach sent aside, let go, and drawn in by one phase."""
    assert rig.motion is not None
    x, angle = axis(rig.file, "stroke"), axis(rig.file, "angle")
    assert x is not None
    assert angle is not None
    rig.motion.move({x.name: 0.0})
    rig.operator.mount("lock-along")
    for approach in approaches(rig.file, plan):
        transition(rig, RigState.HELD)
        rig.motion.move({angle.name: approach.aligned + approach.side * plan.start_rad})
        rig.clock.sleep(plan.settle_s)
        transition(rig, RigState.READY)
        _drawn(rig, plan, record, approach)
    rig.operator.mount("")


def _drawn(rig: Rig, plan: Plan, record: Recorder, approach: Approach) -> None:
    test = rig.file.capabilities.phase_test
    assert rig.motion is not None
    assert test is not None
    rig.motion.write({test.current: 0.0})
    rig.motion.write({test.phase: approach.phase.value})
    try:
        for current, reads in ramp(plan):
            rig.motion.write({test.current: current})
            rig.clock.sleep(plan.step_s)
            if reads:
                rig.clock.sleep(plan.rest_s)
                with record.step(LEVEL, number=approach.number, level=current):
                    rig.clock.sleep(plan.read_s)
    finally:
        rig.motion.write({test.current: 0.0})
        rig.motion.write({test.phase: test.off})


def evaluate(recording: Recording[Plan], findings: Findings) -> list[Stator]:
    """Where phases draw the shaft, and the zeros of stators by it."""
    from procedures.map_zero import checks, estimates

    rig, plan, rests = recording.rig, recording.plan, read_rests(recording)
    findings.gate(checks.of_signals(rests, rig, plan))
    findings.gate(checks.of_order(rests, rig, plan))
    found = estimates.stators(rests, rig)
    findings.gate(checks.of_results(found, rests, rig, plan))
    return found


def measured(found: Sequence[Stator]) -> Iterator[Measured]:
    """The quantities, kind by kind."""
    for quantity in MEASURES:
        for stator in found:
            yield quantity.measured(stator.estimates[quantity.name], stator.motor)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    test = rig.capabilities.phase_test
    if test is None:
        return
    envelope = Envelope(rig)
    for current in plan.levels_A:
        yield from envelope.problems_of({test.current: current})
    if plan.first_A >= min(plan.levels_A):
        yield f"first_A: found {plan.first_A:g}; expected less than the first level, {min(plan.levels_A):g}"
    if len(set(plan.teeth)) != len(plan.teeth):
        yield f"teeth: found {list(plan.teeth)}; expected each once"


def figures(found: Sequence[Stator], recording: Recording[Plan]) -> Iterable[Figure]:
    """Alignments and levels."""
    from procedures.map_zero import figures as drawn

    del recording
    return drawn.all_figures(found)


def holds_for(_: Plan) -> Mapping[str, float]:
    """Zeros are the machine's, whatever the plan."""
    return {}


procedure = Procedure(
    name="map-zero",
    title="Zeros of a reluctance machine's stators",
    measures=MEASURES,
    state=RigState.HELD,
    plan=Plan,
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    step_count=step_count,
    steps_on=steps_on,
    fewest_steps=lambda plan: 6 * len(plan.levels_A),
    holds_for=holds_for,
    reached=("scatter/*",),
    assumes=assumptions.MAP_ZERO,
    method=read_method(__file__),
)
