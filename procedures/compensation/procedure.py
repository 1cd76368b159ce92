"""Compensation of disturbances at speed: vibration with and without it, and as it is switched on (T 3.5, Figs. 3.7 and 3.8).

Measurands besides those of `unbalance`: by speed the reduction of the synchronous amplitude; how far it has fallen 0.15 s after
the switch; what is left of mean and amplitude in steady state.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from bench.errors import AnalysisError
from bench.figures import Shown
from bench.findings import Effect, Finding, Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.uncertainty import Estimate
from bench.units import RPM
from procedures.amb_rotor import lift, pushes
from procedures.amb_rotor.conventions import conventions
from procedures.compensation import switching
from procedures.compensation.plan import Plan
from procedures.compensation.requires import requires
from procedures.compensation.switching import SWITCH, Switched
from procedures.shared import assumptions
from procedures.synchronous import bearings, dwelling
from procedures.unbalance import figures as unbalance_figures
from procedures.unbalance import procedure as unbalance
from procedures.unbalance import sequence

if TYPE_CHECKING:
    from procedures.compensation import checks
    from procedures.synchronous.estimates import Results

REDUCTION = Quantity(
    "reduction",
    "1",
    "of order 1 as the probes read it, root mean square of the four, by the compensation",
    title="reduction of order 1",
)
DROP = Quantity("drop", "1", "the same, from before the switch to 0.15 s after it", title="reduction at the switch")
RESIDUAL = Quantity(
    "residual",
    "m",
    "greatest |mean| + order 1 (0-pk) of a probe's reading, over 50 turns after the switch",
    title="reading after the switch",
)
MEASURES = (*unbalance.MEASURES, REDUCTION, DROP, RESIDUAL)
AFTER_ARM_S = 0.05


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """As for `unbalance`, with the poles of T 3.5."""
    return unbalance.settings(rig, plan)


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records, for the progress display."""
    return unbalance.step_count(plan) + 1


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Slow roll, dwells with each setting, the switch, the lowest speed again."""
    if not sequence.begin(rig, plan, record):
        return
    if sequence.dwell(rig, plan, record) and _switch(rig, plan, record):
        sequence.repeat_lowest(rig, plan, record)
    dwelling.stop(rig)


def _switch(rig: Rig, plan: Plan, record: Recorder) -> bool:
    """Switch the compensation on while the controller records."""
    machine = conventions(rig.file)
    lift.write(rig, machine.variants["off"])
    if rig.capture is None or not lift.bring_to_speed(rig, record, plan.switch_rad_s, plan.settle_s):
        return False
    lift.write(rig, machine.variants["waiting"])  # the estimates run and do nothing
    rig.clock.sleep(plan.settle_s)
    with record.step(SWITCH, speed_rad_s=plan.switch_rad_s):
        rig.capture.arm(switching.captured_channels(machine), seconds=plan.before_s + AFTER_ARM_S + plan.after_s)
        rig.clock.sleep(plan.before_s)
        lift.write(rig, switching.switched(machine))
        rig.capture.wait(plan.after_s + 5.0)
    rig.capture.upload(switch=1)
    return True


@dataclass(frozen=True)
class Compared:
    """The dwells, by how much each compensation reduces what the probes read, and the switch with its drop and residual."""

    plan: Plan
    results: Results
    reductions: checks.Reductions
    captured: Switched | None = None
    switched: Mapping[str, Estimate] = field(default_factory=dict)


def evaluate(recording: Recording[Plan], findings: Findings) -> Compared:
    """The dwells as in `unbalance`, the reductions, and the switch where it was captured."""
    from procedures.compensation import checks
    from procedures.compensation.hum import of_switch
    from procedures.synchronous.hum import listen

    results = unbalance.evaluate(recording, findings)
    reductions = checks.reductions(results)
    findings.add(checks.describe(results, reductions, recording.plan.judged_to_rad_s))
    try:
        captured = switching.read_switch(recording)
        switched = switching.of_switch(captured, recording.rig)
    except AnalysisError as error:
        findings.add([Finding("no-switch", str(error), "", Effect.ERROR)])
        return Compared(recording.plan, results, reductions)
    findings.add(of_switch(listen(recording, results.slow), captured, switched, _switched_at(recording.plan)))
    return Compared(recording.plan, results, reductions, captured, switched)


def measured(found: Compared) -> Iterator[Measured]:
    """The quantities of each dwell, reductions, and the switch."""
    plan = found.plan
    yield from unbalance.measured(found.results)
    for result, estimate in found.reductions:
        if result.dwell.variant == "corrected" and result.dwell.speed <= plan.judged_to_rad_s:
            yield REDUCTION.measured(estimate, f"{result.dwell.wanted * RPM:.0f} r/min")
    if found.switched:
        yield DROP.measured(found.switched["drop"], _switched_at(plan))
        yield RESIDUAL.measured(found.switched["residual"], _switched_at(plan))


def _switched_at(plan: Plan) -> str:
    return f"{plan.switch_rad_s * RPM:.0f} r/min"


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    yield from unbalance.check(rig, plan)
    if plan.variants[:2] != ("off", "corrected") or plan.law in ("", conventions(rig).plain_law):
        yield "variants: expected off, then corrected, with a law that compensates; something must be compared"
    if min(plan.speeds_rad_s) > plan.judged_to_rad_s:
        yield (f"judged_to_rad_s: found {plan.judged_to_rad_s * RPM:.0f} r/min; every speed of the plan is above it, and no "
               f"reduction would be measured: set it above {min(plan.speeds_rad_s) * RPM:.0f} r/min")  # fmt: skip
    most = rig.envelope.max_speed_rad_s
    if plan.switch_rad_s > most:
        yield f"switch_rad_s: found {plan.switch_rad_s * RPM:.0f} r/min; the envelope allows {most * RPM:.0f} r/min"
    if (plan.after_s - switching.WITHIN_S) * plan.switch_rad_s < 2 * 3.15 * (switching.TURNS_LEFT + 3):
        yield f"after_s: found {plan.after_s:g} s; expected {switching.TURNS_LEFT + 3} turns beyond {switching.WITHIN_S} s"


def figures(found: Compared, recording: Recording[Plan]) -> Iterable[Shown]:
    """Those of `unbalance`, the reduction over the speed, and the switch."""
    from procedures.compensation import figures as drawn

    yield from drawn.draw_reductions(found.reductions)
    if found.captured is not None:
        yield from drawn.draw_switch(found.captured)
    yield from unbalance_figures.all_figures(found.results, recording.rig)


procedure = Procedure(
    name="compensation",
    title="Compensation of unbalance: with and without it, and switched on",
    measures=MEASURES,
    state=RigState.READY,
    plan=Plan,
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    settings=settings,
    step_count=step_count,
    steps_on=lambda rig, plan: step_count(plan) + pushes.count(rig),
    needs=lambda plan: bearings.needs(plan.bearings),
    assumes=assumptions.UNBALANCE,
    method=f"{unbalance.procedure.method}\n{read_method(__file__)}",
)
