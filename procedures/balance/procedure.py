"""Two-plane balancing by influence coefficients from trial weights (Goodman 1964), judged by ISO 21940-11.

Measurands, by plane: unbalance of the shaft as found and as left, on the scale of the balancing planes; what is left over the
permissible residual unbalance; influence coefficients.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from bench.figures import Shown
from bench.findings import Effect, Ended, Finding, Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.rigfile import RigFile
from bench.units import RPM
from procedures.amb_rotor import lift, pushes, wiring
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.laws import of_laws
from procedures.balance import decision, sequence
from procedures.balance.fitting import of_plan
from procedures.balance.plan import Plan
from procedures.balance.planes import chosen, names_of
from procedures.balance.requires import requires
from procedures.balance.steps import BASE, known_by, read_runs
from procedures.shared import assumptions, first_look
from procedures.synchronous import bearings, dwelling
from procedures.synchronous.default_speeds import within_envelope
from procedures.synchronous.dwells import SLOW

if TYPE_CHECKING:
    from procedures.balance.estimates import Result

FOUND_COS = Quantity(
    "unbalance_cos",
    "kg m",
    "of the shaft as found, in a plane: component along the scale's zero",
    title="unbalance, along zero",
)
FOUND_SIN = Quantity(
    "unbalance_sin",
    "kg m",
    "as unbalance_cos: component a quarter turn on, as the scale counts",
    title="unbalance, a quarter turn on",
)
LEFT_COS = Quantity(
    "residual_cos",
    "kg m",
    "what is left with all corrections mounted: component along the scale's zero",
    title="residual, along zero",
)
LEFT_SIN = Quantity(
    "residual_sin",
    "kg m",
    "as residual_cos: component a quarter turn on, as the scale counts",
    title="residual, a quarter turn on",
)
SHARE = Quantity(
    "residual_share",
    "1",
    "amount of what is left over the permissible residual unbalance of the plane",
    title="residual / permissible",
)
PERMITTED = Quantity(
    "permissible",
    "kg m",
    "permissible residual unbalance of the plane, ISO 21940-11",
    title="permissible residual unbalance",
)
COSINE = Quantity(
    "influence_cos",
    "m/(kg m)",
    "of a weight at the scale's zero on a probe, order 1 0-pk: cosine component",
    title="influence, cos",
)
SINE = Quantity(
    "influence_sin", "m/(kg m)", "as influence_cos: sine component; x = C cos θ + S sin θ", title="influence, sin"
)
MEASURES = (FOUND_COS, FOUND_SIN, LEFT_COS, LEFT_SIN, SHARE, PERMITTED, COSINE, SINE)


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """Lifted by the PID, nothing compensated."""
    del plan
    return conventions(rig).lifting


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records at most."""
    runs = 3 + plan.corrections
    mounts = 2 + (1 if plan.leave else 2) + plan.corrections * (2 if plan.positions == 0 else 4)
    return lift.STEPS + (plan.slow_rad_s > 0) + runs * (len(plan.speeds_rad_s) + plan.repeat) + mounts


def fewest_steps(plan: Plan) -> int:
    """A rotor that is balanced as it stands takes one run."""
    return lift.STEPS + (plan.slow_rad_s > 0) + len(plan.speeds_rad_s)


def evaluate(recording: Recording[Plan], findings: Findings) -> Result:
    """Unbalance as found and as left, and the influence coefficients at the highest speed."""
    from procedures.balance import checks, estimates
    from procedures.balance.estimates import Result
    from procedures.balance.hum import of_balance
    from procedures.synchronous import checks as dwell_checks
    from procedures.synchronous.hum import listen

    first_look.gate(recording, findings, wiring.before_orbits(recording))
    findings.gate([*wiring.before_orbits(recording), *dwell_checks.before(recording), *checks.refusals(recording)],
                  ("no-dwells", "sensor-polarity", "lift-lost", "stuck-channel"))  # fmt: skip
    plan = recording.plan
    rig = chosen(recording.rig, plan.planes)
    recorded = read_runs(recording, plan.speeds_rad_s)
    # every run is in all results
    findings.add(dwell_checks.of_signals(recorded.dwells, plan.max_lost, plan.max_speed_error, doubts=lambda _: ()))
    findings.add(dwell_checks.slow_roll(recorded.dwells, plan.speeds_rad_s))
    known = bearings.Known.of(recording.calibrations, plan.beta_share, plan.offset_u_m)
    known = known_by(recorded.slow, recorded.runs, rig, known)
    findings.gate(bearings.unknown(known, rig))
    findings.add(checks.of_runs(recorded, rig, plan, known))
    trials = decision.trials_of(recorded.runs, rig)
    if trials is None and not findings.wrong:
        text = "the runs with trial weights were not completed: no influence coefficients."
        findings.add([Finding("no-trials", text, "", Effect.ERROR)])
    if trials is None or findings.wrong:
        findings.add(checks.sheet(recorded, "still-mounted", rig, plan))
        raise Ended
    verified = [r for r in recorded.runs if r.name.startswith("check")]
    shown = [trials.base, *([trials.having[1]] if plan.leave else []), *verified]
    balance = estimates.solve_runs(recorded.slow, shown, trials, rig, plan, known)
    result = Result(plan, rig, balance, recorded, shown[-1].name, estimates.influences(balance, rig))
    findings.add([bearings.describe(known), *dwelling.uncaptured(rig)])
    findings.add(checks.of_parts(balance))
    findings.add(checks.of_result(balance, recorded, shown, plan, rig))
    slow = next((d for d in recorded.dwells if d.kind == SLOW), None)
    findings.add(of_balance(listen(recording, slow), recorded, balance, (BASE, result.last), result.influences))
    return result


def measured(result: Result) -> Iterator[Measured]:
    """By plane the unbalance as found and as left; the influence coefficients by probe and plane."""
    from procedures.balance import estimates

    balance, last = result.balance, result.last
    for p, side in enumerate(names_of(result.rig)):
        for quantity, k in ((FOUND_COS, 2 * p), (FOUND_SIN, 2 * p + 1)):
            yield quantity.measured(balance.parts[BASE][k], side)
        yield PERMITTED.measured(balance.permissible[p], side)
        for quantity, k in ((LEFT_COS, 2 * p), (LEFT_SIN, 2 * p + 1)):
            yield quantity.measured(balance.parts[last][k], side)
        yield SHARE.measured(estimates.share(balance, last, p), side)
    for (axis, side), (cosine, sine) in result.influences.items():
        where = f"{axis}, weight {side}, {max(result.plan.speeds_rad_s) * RPM:.0f} r/min"
        yield COSINE.measured(cosine, where)
        yield SINE.measured(sine, where)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    yield from of_laws(conventions(rig), "law", [plan.law])
    yield from of_plan(rig, plan)


def figures(result: Result, recording: Recording[Plan]) -> Iterable[Shown]:
    """Polar plots of the vectors, influence coefficients, residual against U_per."""
    from procedures.balance import figures as drawn

    del recording
    return drawn.all_figures(result)


def planned(rig: RigFile) -> Mapping[str, Any]:
    """Speeds that the envelope allows; the highest service speed is another matter than those of the runs."""
    return {**within_envelope(rig, Plan, "speeds_rad_s"), **within_envelope(rig, Plan, "service_rad_s")}


procedure = Procedure(
    name="balance",
    title="Two-plane balancing by influence coefficients",
    measures=MEASURES,
    state=RigState.READY,
    plan=Plan,
    planned=planned,
    acquire=sequence.acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    settings=settings,
    step_count=step_count,
    steps_on=lambda rig, plan: step_count(plan) + pushes.count(rig),
    fewest_steps=fewest_steps,
    needs=lambda plan: bearings.needs(plan.bearings),
    assumes=assumptions.BALANCE,
    method=read_method(__file__),
)
