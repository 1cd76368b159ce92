"""Answers of a positioned stage to known loads: compliance and friction without integrators, deviation and return with them.

Measurands, by axis: displacement per newton in the mean of approaches from both sides; the band in which friction holds the
axis, and the friction that does; how many newtons one is by the controller's map; the greatest deviation after a load is put
on or taken off, and what is left of it some seconds later, by the axis' own encoder.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from bench.errors import AnalysisError
from bench.figures import Shown
from bench.findings import Effect, Finding, Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.envelope import Envelope
from procedures.load_response import estimates
from procedures.load_response.estimates import BAND, COMPLIANCE, FRICTION, LEFT, PEAK, SCALE, Result
from procedures.load_response.moves import approaches, disturbances, integrators
from procedures.load_response.plan import Plan
from procedures.load_response.requires import requires
from procedures.load_response.sequence import INTEGRATORS, chosen, lead, masses
from procedures.load_response.sequence import step_count as counted
from procedures.load_response.steps import Change, read_changes, read_rests
from procedures.shared.default_masses import by_weight
from procedures.stages import assumptions
from procedures.stages.known_loads import loaded, sources

PER = "displacement per newton without integrators, mean of approaches from both sides, over loads both ways"
HOLDS = "half of what approaches from both sides end apart, and half a count: friction over stiffness"
HELD = "force with which the bearings stop a slow approach, mean of both ways, without that of pulleys"
FAR = "greatest deviation from the set point after a load is put on or taken off, the way it drives"
REST = "deviation that is left some seconds after a load is put on or taken off, the way it drives"
STATIC = (
    Quantity(COMPLIANCE, "m/N", PER, title="static compliance"),
    Quantity("compliance_angle", "rad/(N m)", PER, title="static compliance around"),
    Quantity(BAND, "m", HOLDS, title="friction band"),
    Quantity("friction_band_angle", "rad", HOLDS, title="friction band around"),
    Quantity(FRICTION, "N", HELD),
    Quantity("friction_torque", "N m", HELD, title="friction around"),
    Quantity(SCALE, "1", "true force per force that the controller gives by its own map", title="scale of the force"),
)
AFTER = (
    Quantity(PEAK, "m", FAR, title="peak deviation"),
    Quantity("peak_angle", "rad", FAR, title="peak deviation around"),
    Quantity(LEFT, "m", REST, title="error after"),
    Quantity("error_after_angle", "rad", REST, title="error after, around"),
)
MEASURES = (*STATIC, *AFTER)


def settings(rig: RigFile, plan: Plan) -> Mapping[str, float]:
    """Without integrators at first: what one has gathered stays in its loop."""
    return rig.capabilities.settings.get(INTEGRATORS, {}).get("off" if plan.static else "on", {})


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Each axis under each load from both sides; then, with integrators, loads put on and taken off."""
    axes = chosen(rig.file, plan)
    if plan.static:
        for axis in axes:
            approaches(rig, plan, record, axis)
    if plan.disturbed:
        integrators(rig, "on")
        for axis in axes:
            disturbances(rig, plan, record, axis)


@dataclass(frozen=True)
class Evaluated:
    """The result, and what it was drawn from."""

    result: Result
    changes: tuple[Change, ...]
    plan: Plan


def evaluate(recording: Recording[Plan], findings: Findings) -> Evaluated:
    """Everything."""
    from procedures.load_response import checks

    rig, plan = recording.rig, recording.plan
    try:
        rests, found = read_rests(recording), read_changes(recording)
        findings.gate(checks.of_signals(rests, found, rig, plan))
        result = estimates.results(rests, found, rig, plan)
    except AnalysisError as error:
        findings.end(Finding("loads-missing", f"{error}.", "", Effect.ERROR))
    findings.gate(checks.of_result(result, rests, plan), so_far=Evaluated(result, tuple(found), plan))
    return Evaluated(result, tuple(found), plan)


def measured(found: Evaluated) -> Iterator[Measured]:
    """The quantities, kind by kind."""
    for quantity in MEASURES:
        for (name, where), estimate in found.result.estimates.items():
            if name == quantity.name:
                yield quantity.measured(estimate, where)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    if not chosen(rig, plan):
        yield f"axes: found {plan.axes!r}; known loads pull both ways at {', '.join(a.name for a in loaded(rig))}"
        return
    envelope = Envelope(rig)
    for axis in chosen(rig, plan):
        labels, key = masses(axis, plan), "lever_masses" if axis.unit == "rad" else "masses"
        if unknown := [m for m in labels if m not in rig.masses]:
            yield f"{key}: found {', '.join(unknown)}; the rig file certifies {', '.join(rig.masses)}"
            continue
        kg = [rig.masses[m].value for m in labels]
        if kg != sorted(set(kg)):
            yield f"{key}: found {kg} kg; expected different masses in ascending order"
        ends = (-lead(axis, plan), lead(axis, plan))
        yield from (f"{axis.name}: {problem}" for at in ends for problem in envelope.problems_of({axis.target: at}))


def figures(found: Evaluated, recording: Recording[Plan]) -> Iterable[Shown]:
    """Deviation over load, deviation over time."""
    from procedures.load_response import figures as drawn

    del recording
    return drawn.all_figures(found.result, found.changes, found.plan)


def untold(rig: RigFile) -> tuple[Quantity, ...]:
    """Of axes that the rig does not have."""
    units = {a.unit for a in loaded(rig)}
    return tuple(q for unit in ("m", "rad") if unit not in units for q in _of(unit))


def _of(unit: str) -> tuple[Quantity, ...]:
    """Quantities of axes in m or in rad alone."""
    units = {"m": ("m/N", "m", "N"), "rad": ("rad/(N m)", "rad", "N m")}
    return tuple(q for q in MEASURES if q.unit in units[unit])


def planned(rig: RigFile) -> Mapping[str, Any]:
    """The second and third lightest mass, or as many as there are."""
    labels = by_weight(rig)
    labels = labels[1:3] if len(labels) > 2 else labels
    return {"masses": labels, "lever_masses": labels} if labels else {}


def left_out(plan: Plan) -> tuple[Quantity, ...]:
    """What the plan does not do."""
    other = {"along": "rad", "around": "m"}.get(plan.axes)
    none = _of(other) if other else ()
    return tuple(dict.fromkeys((*none, *(() if plan.static else STATIC), *(() if plan.disturbed else AFTER))))


def places(rig: RigFile) -> tuple[str, ...]:
    """Names of hooks and levers, which stand in `where`."""
    return tuple(s.name for a in loaded(rig) for s in sources(rig, a))


procedure = Procedure(
    name="load-response",
    title="Loads on a positioned stage: static compliance, friction, deviation and return",
    measures=MEASURES,
    state=RigState.HELD,
    plan=Plan,
    planned=planned,
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    settings=settings,
    step_count=lambda plan: 2 * plan.phases * 2 * (6 * plan.static + 2 * plan.disturbed),
    steps_on=counted,
    untold=untold,
    left_out=left_out,
    assumes=assumptions.LOAD_RESPONSE,
    places=("off",),
    method=read_method(__file__),
)
