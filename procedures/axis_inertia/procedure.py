"""Mass and moment of inertia of what a positioned stage moves, by sines with and without a part that is known.

Measurands, by axis: mass along, kg, or moment of inertia around, kg m^2, of the mover without the part.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from bench.errors import AnalysisError
from bench.figures import Figure
from bench.findings import Effect, Finding, Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.rigfile import RigFile
from bench.rigfile.envelope import Envelope
from bench.rigfile.stage import axes_of
from procedures.axis_inertia.moves import acquire
from procedures.axis_inertia.plan import Plan
from procedures.axis_inertia.requires import requires
from procedures.axis_inertia.sequence import chosen, known, part, plays, tones
from procedures.axis_inertia.sequence import step_count as counted
from procedures.axis_inertia.steps import read_sines
from procedures.stages import assumptions
from procedures.stages.spread import middle, turns

if TYPE_CHECKING:
    from procedures.axis_inertia.estimates import Result

MASS = Quantity("mass", "kg", "of what moves along an axis, by the ratio to a part of known mass")
INERTIA = Quantity("inertia", "kg m^2", "of what turns around an axis, by the ratio to a part of known moment of inertia",
                   title="moment of inertia")  # fmt: skip
MEASURES = (MASS, INERTIA)


def evaluate(recording: Recording[Plan], findings: Findings) -> Result:
    """What each axis moves."""
    from procedures.axis_inertia import checks, estimates

    rig, plan = recording.rig, recording.plan
    try:
        sines = read_sines(recording)
        findings.gate(checks.of_sines(sines, rig, plan))
        result = estimates.results(sines, rig, plan)
    except AnalysisError as error:
        findings.end(Finding("sines-missing", f"{error}.", "", Effect.ERROR))
    findings.gate(checks.of_parts(result, plan))
    findings.gate(checks.of_result(result, plan))
    return result


def measured(r: Result) -> Iterator[Measured]:
    """The quantities, kind by kind."""
    for quantity in MEASURES:
        for (name, where), estimate in r.estimates.items():
            if name == quantity.name:
                yield quantity.measured(estimate, where)


def figures(r: Result, recording: Recording[Plan]) -> Iterable[Figure]:
    """By repeats."""
    from procedures.axis_inertia import figures as drawn

    del recording
    return drawn.all_figures(r)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    able = [a.name for a in axes_of(rig).values() if plays(a)]
    if unknown := [name for name in plan.axes if name not in able]:
        yield f"axes: found {', '.join(unknown)}; sines are played by {', '.join(able) or 'none'}"
        return
    envelope = Envelope(rig)
    for axis in chosen(rig, plan):
        if known(axis, plan) not in rig.machine:
            yield f"{axis.name}: found no {known(axis, plan)} among the machine's numbers; expected what the part adds"
        wave = axis.wave
        assert wave is not None
        for tone in (*tones(axis, plan), *tones(axis, plan, part(axis, plan))):
            wanted = {wave.amplitude: tone.amplitude, wave.period: 1 / tone.hz}
            if not turns(axis):
                wanted[axis.target] = middle(axis) + tone.amplitude
            yield from (f"{axis.name} at {tone.hz:g} Hz: {problem}" for problem in envelope.problems_of(wanted))


def untold(rig: RigFile) -> tuple[Quantity, ...]:
    """What a rig has no axes for."""
    units = {a.unit for a in axes_of(rig).values() if plays(a)}
    return tuple(q for q, unit in ((MASS, "m"), (INERTIA, "rad")) if unit not in units)


def left_out(plan: Plan) -> tuple[Quantity, ...]:
    """What chosen axes show the rig alone knows."""
    return MEASURES if plan.axes else ()


procedure = Procedure(
    name="axis-inertia",
    title="Mass and moment of inertia of what a stage moves",
    measures=MEASURES,
    state=RigState.HELD,
    plan=Plan,
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    step_count=lambda plan: 2 * plan.repeats * (len(plan.tones_m) + len(plan.tones_rad)),
    steps_on=counted,
    untold=untold,
    left_out=left_out,
    reached=("scatter/*",),
    assumes=assumptions.AXIS_INERTIA,
    method=read_method(__file__),
)
