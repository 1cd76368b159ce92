"""Two-plane balancing by influence coefficients from trial weights (Goodman 1964), judged by ISO 21940-11.

Measurands, by plane: unbalance of the shaft as found and as left, on the scale of the balancing planes; what is left over the
permissible residual unbalance; influence coefficients.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from bench.figures import Shown
from bench.findings import Finding
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.rigfile import RigFile
from bench.units import RPM
from procedures.amb_rotor import lift
from procedures.balance import checks, estimates, sequence
from procedures.balance import figures as drawn
from procedures.balance.plan import Plan
from procedures.balance.steps import BASE, SIDES
from procedures.shared import assumptions
from procedures.synchronous import dwelling
from procedures.unbalance import procedure as unbalance

FOUND_COS = Quantity(
    "unbalance_cos",
    "kg m",
    "of the shaft as found, in a plane: component along the scale's zero",
    title="unbalance, along zero",
)
FOUND_SIN = Quantity(
    "unbalance_sin",
    "kg m",
    "as unbalance_cos: component a quarter turn on, from y towards z",
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
    "as residual_cos: component a quarter turn on, from y towards z",
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


def settings(plan: Plan) -> dict[str, float]:
    """Lifted by the PID, nothing compensated."""
    del plan
    return {"law": dwelling.CODES["PID"], "observer": 0.0, "compensate": 0.0}


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records at most."""
    runs = 3 + plan.corrections
    mounts = 2 + (0 if plan.leave else 2) + plan.corrections * (2 if plan.positions == 0 else 4)
    return lift.STEPS + (plan.slow_rad_s > 0) + runs * (len(plan.speeds_rad_s) + plan.repeat) + mounts


def fewest_steps(plan: Plan) -> int:
    """A rotor that is balanced as it stands takes one run."""
    return lift.STEPS + (plan.slow_rad_s > 0) + len(plan.speeds_rad_s)


def analyse(recording: Recording[Plan]) -> Iterator[Measured | Finding]:
    """Findings first, then the quantities."""
    found = recording.once(checks.evaluated)
    yield from found.findings
    result = found.balance
    if result is None:
        return
    last = found.last
    for p, side in enumerate(SIDES):
        for quantity, k in ((FOUND_COS, 2 * p), (FOUND_SIN, 2 * p + 1)):
            yield quantity.measured(result.parts[BASE][k], side)
        yield PERMITTED.measured(result.permissible[p], side)
        for quantity, k in ((LEFT_COS, 2 * p), (LEFT_SIN, 2 * p + 1)):
            yield quantity.measured(result.parts[last][k], side)
        yield SHARE.measured(estimates.share(result, last, p), side)
    for (axis, side), (cosine, sine) in found.influences.items():
        where = f"{axis}, weight {side}, {max(recording.plan.speeds_rad_s) * RPM:.0f} r/min"
        yield COSINE.measured(cosine, where)
        yield SINE.measured(sine, where)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    yield from checks.of_plan(rig, plan)


def figures(recording: Recording[Plan]) -> Iterable[Shown]:
    """Polar plots of the vectors, influence coefficients, residual against U_per; empty where nothing was evaluated."""
    found = recording.once(checks.evaluated)
    return () if found.balance is None else drawn.all_figures(found)


procedure = Procedure(
    name="balance",
    title="Two-plane balancing by influence coefficients",
    measures=MEASURES,
    state=RigState.READY,
    plan=Plan,
    acquire=sequence.acquire,
    measured=analyse,
    figures=figures,
    requires=checks.REQUIRES,
    check=check,
    settings=settings,
    step_count=step_count,
    fewest_steps=fewest_steps,
    needs=unbalance.needs,
    assumes=assumptions.BALANCE,
    method=read_method(__file__),
)
