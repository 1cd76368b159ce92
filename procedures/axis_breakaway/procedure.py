"""Breakaway of the axes of a positioned stage, from forces that rise slowly until they move, alone and at once.

Measurands, by axis: the force at which it begins to move, mean of both ways; by helix the force along and around at which both
give way, as a share of one friction along the path.
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
from procedures.axis_breakaway.moves import acquire
from procedures.axis_breakaway.plan import Plan
from procedures.axis_breakaway.requires import requires
from procedures.axis_breakaway.sequence import (
    BACK,
    PULLS,
    RADIUS,
    chosen,
    helix,
    loads,
    mass,
    pair,
    place,
    ramp,
)
from procedures.axis_breakaway.sequence import step_count as counted
from procedures.axis_breakaway.steps import read_ramps
from procedures.shared.default_masses import nth_lightest
from procedures.stages import assumptions

if TYPE_CHECKING:
    from procedures.axis_breakaway.estimates import Result

STICKS = "force at which it begins to move, raised slowly, mean of both ways"
MEASURES = (
    Quantity("breakaway", "N", STICKS),
    Quantity("breakaway_angle", "N m", STICKS, title="breakaway around"),
    Quantity(
        "path_share", "1", "both pushed at once: where they give way, of one friction along the path of the surface"
    ),
)


def evaluate(recording: Recording[Plan], findings: Findings) -> Result:
    """Breakaway of each axis, and of both."""
    from procedures.axis_breakaway import checks, estimates

    rig, plan = recording.rig, recording.plan
    try:
        ramps = read_ramps(recording)
        findings.gate(checks.of_ramps(ramps, rig, plan))
        result = estimates.results(ramps, rig, plan)
    except AnalysisError as error:
        findings.end(Finding("ramps-missing", f"{error}.", "", Effect.ERROR))
    findings.gate(checks.of_result(result, plan))
    return result


def measured(r: Result) -> Iterator[Measured]:
    """The quantities, kind by kind."""
    from procedures.axis_breakaway import estimates

    for quantity in MEASURES:
        for (name, where), estimate in r.estimates.items():
            if name == quantity.name:
                yield quantity.measured(estimate, f"helix {where}" if name == estimates.SHARE else where)


def figures(r: Result, recording: Recording[Plan]) -> Iterable[Figure]:
    """The circle and repeats."""
    from procedures.axis_breakaway import figures as drawn

    del recording
    return drawn.all_figures(r)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    if unknown := [name for name in plan.axes if name not in axes_of(rig)]:
        yield f"axes: found {', '.join(unknown)}; the rig positions {', '.join(axes_of(rig)) or 'none'}"
        return
    envelope = Envelope(rig)
    for axis in chosen(rig, plan):
        if not loads(rig, axis):
            yield f"{axis.name}: known loads do not pull it both ways; nothing would tell what a newton of the map is"
        elif mass(axis, plan) not in rig.masses:
            yield f"{axis.name}: found mass {mass(axis, plan)!r}; expected one of {', '.join(rig.masses)}"
        rate, span = ramp(axis, plan)
        for repeat in (0, plan.repeats - 1):
            for side in (-1, 1):
                wanted = {axis.target: place(axis, plan, repeat) + side * (0.5 + BACK) * span, axis.rate: rate}
                yield from (f"{axis.name}: {problem}" for problem in envelope.problems_of(wanted))
    if (both := pair(rig, plan)) is not None:
        for share in plan.helix:
            path = helix(rig, plan, both, max(share, 1e-3))
            wanted = {a.target: place(a, plan, 0) - path.slid[a.name] for a in both}
            yield from (f"helix {share:g}: {problem}" for problem in envelope.problems_of(wanted))
    if any(share <= 0 for share in plan.helix) or len(set(plan.helix)) < len(plan.helix):
        yield f"helix: found {', '.join(f'{s:g}' for s in plan.helix)}; expected shares above 0, each once"


def untold(rig: RigFile) -> tuple[Quantity, ...]:
    """What a rig has no axes for."""
    units = {a.unit for a in axes_of(rig).values()}
    missing = [q for q, unit in zip(MEASURES, ("m", "rad"), strict=False) if unit not in units]
    return (*missing, *(() if {"m", "rad"} <= units and RADIUS in rig.geometry else MEASURES[-1:]))


def left_out(plan: Plan) -> tuple[Quantity, ...]:
    """What chosen axes show the rig alone knows."""
    if plan.axes:
        return MEASURES
    return () if plan.helix else MEASURES[-1:]


procedure = Procedure(
    name="axis-breakaway",
    title="Breakaway of a stage's axes",
    measures=MEASURES,
    state=RigState.HELD,
    plan=Plan,
    planned=lambda rig: nth_lightest(rig, mass=1, lever_mass=0),
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    step_count=lambda plan: 2 * plan.repeats * (3 * (1 + (len(PULLS) if plan.pull_rad else 1)) + 2 * len(plan.helix)),
    steps_on=counted,
    untold=untold,
    left_out=left_out,
    reached=("scatter/*", "counts/*", "bend/*"),
    assumes=assumptions.AXIS_BREAKAWAY,
    method=read_method(__file__),
    places=("helix",),
)
