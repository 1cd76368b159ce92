"""Friction of the axes of a positioned stage, from forces at constant rates both ways, alone and at once.

Measurands, by axis: Coulomb and viscous friction, mean of both ways; the force that it needs both ways alike; and the radius
of the one friction along the path of the surface where both axes move.
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
from procedures.axis_friction.moves import acquire
from procedures.axis_friction.plan import Plan
from procedures.axis_friction.requires import requires
from procedures.axis_friction.sequence import (
    chosen,
    crossed,
    ends,
    helix_settle,
    helix_turns,
    load_rate,
    loads,
    mass,
    rates,
    settle,
    start,
    written,
)
from procedures.axis_friction.sequence import step_count as counted
from procedures.axis_friction.steps import read_passes
from procedures.shared.default_masses import nth_lightest
from procedures.stages import assumptions

if TYPE_CHECKING:
    from procedures.axis_friction.estimates import Result

DRY = "friction at no speed, by a line over constant rates, mean of both ways"
WET = "slope of friction over the rate, mean of both ways"
ALIKE = "force that it needs both ways alike: its tilt, and half of what friction is more upwards than downwards"
MEASURES = (
    Quantity("coulomb", "N", DRY, title="Coulomb friction"),
    Quantity("coulomb_angle", "N m", DRY, title="Coulomb friction around"),
    Quantity("viscous", "N s/m", WET, title="viscous friction"),
    Quantity("viscous_angle", "N m s/rad", WET, title="viscous friction around"),
    Quantity("one_sided", "N", ALIKE, title="one-sided force"),
    Quantity("one_sided_angle", "N m", ALIKE, title="one-sided torque"),
    Quantity("friction_radius", "m", "at which one Coulomb force along the path of the surface rubs as helices do"),
)


def evaluate(recording: Recording[Plan], findings: Findings) -> Result:
    """Friction, and the radius."""
    from procedures.axis_friction import checks, estimates

    rig, plan = recording.rig, recording.plan
    try:
        passes = read_passes(recording)
        findings.gate(checks.of_passes(passes, rig, plan))
        result = estimates.results(passes, rig, plan)
    except AnalysisError as error:
        findings.end(Finding("passes-missing", f"{error}.", "", Effect.ERROR))
    findings.gate(checks.of_result(result, passes, plan))
    return result


def measured(r: Result) -> Iterator[Measured]:
    """The quantities, kind by kind."""
    for quantity in MEASURES:
        for (name, where), estimate in r.estimates.items():
            if name == quantity.name:
                yield quantity.measured(estimate, where)


def figures(r: Result, recording: Recording[Plan]) -> Iterable[Figure]:
    """Friction over rates and ratios."""
    from procedures.axis_friction import figures as drawn

    return drawn.all_figures(r, recording.plan.scale)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    if unknown := [name for name in plan.axes if name not in axes_of(rig)]:
        yield f"axes: found {', '.join(unknown)}; the rig positions {', '.join(axes_of(rig)) or 'none'}"
        return
    envelope = Envelope(rig)
    for axis in chosen(rig, plan):
        if list(rates(axis, plan)) != sorted(set(rates(axis, plan))) or min(rates(axis, plan)) <= 0:
            said = ", ".join(f"{r:g}" for r in rates(axis, plan))
            yield f"rates of {axis.name}: found {said}; expected them ascending from above 0"
        if plan.scale == "loads":
            if not loads(rig, axis, plan):
                yield f'scale: found "loads"; known loads do not pull {axis.name} both ways. Choose "map"'
            elif mass(axis, plan) not in rig.masses:
                yield f"{axis.name}: found mass {mass(axis, plan)!r}; expected one of {', '.join(rig.masses)}"
        for rate in (*rates(axis, plan), load_rate(axis, plan)):
            for end in ends(axis, plan, rate, settle(axis, plan)):
                wanted = {axis.target: end, **written(axis, plan, rate)}
                yield from (f"{axis.name} at {rate:g}: {problem}" for problem in envelope.problems_of(wanted))
    if (pair := crossed(rig, plan)) is not None:
        for end in ends(pair[0], plan, plan.helix_m_s, helix_settle(pair, plan)):
            yield from (f"helix: {problem}" for problem in envelope.problems_of({pair[0].target: end}))
        far = max(helix_turns(pair, plan, rate) for rate in plan.helix_rad_s) + start(pair[1], plan, plan.repeats)
        yield from (f"helix: {problem}" for problem in envelope.problems_of({pair[1].target: far}))


def untold(rig: RigFile) -> tuple[Quantity, ...]:
    """What a rig has no axes for."""
    axes = axes_of(rig).values()
    units = {a.unit for a in axes}
    missing = [q for q in MEASURES[:-1] if ("rad" if q.name.endswith("_angle") else "m") not in units]
    return (*missing, *(() if {"m", "rad"} <= units else MEASURES[-1:]))


def left_out(plan: Plan) -> tuple[Quantity, ...]:
    """What chosen axes show the rig alone knows."""
    if plan.axes:
        return MEASURES
    return () if plan.helix else MEASURES[-1:]


procedure = Procedure(
    name="axis-friction",
    title="Friction of a stage's axes",
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
    step_count=lambda plan: (
        2 * plan.repeats * (len(plan.rates_m_s) + len(plan.rates_rad_s) + 4 + 2 * len(plan.helix_rad_s))
    ),
    steps_on=counted,
    untold=untold,
    left_out=left_out,
    reached=("scatter/*",),
    assumes=assumptions.AXIS_FRICTION,
    method=read_method(__file__),
)
