"""Two-plane balancing by influence coefficients from trial weights (Goodman 1964), judged by ISO 21940-11.

Measurands, by plane: unbalance of the shaft as found and as left, on the scale of the balancing planes; what is left over the
permissible residual unbalance; influence coefficients.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Literal

from pydantic import Field

from bench.figures import Shown
from bench.findings import Finding
from bench.procedure import BenchPlan, Measured, Procedure, Quantity, read_method
from bench.recording import Recording
from bench.rigfile import RigFile
from bench.roles import RigState
from bench.units import RPM
from procedures.amb_rotor import lift
from procedures.balance import checks, estimates, sequence
from procedures.balance import figures as drawn
from procedures.balance.steps import BASE, SIDES
from procedures.shared import assumptions
from procedures.synchronous import dwelling
from procedures.synchronous.dwelling import Law
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


class Plan(BenchPlan):
    """Settings of a balancing, SI."""

    law: Law = "CCS"
    speeds_rad_s: tuple[float, ...] = Field((4000 / RPM, 10000 / RPM), min_length=1)  # of every run
    slow_rad_s: float = Field(300 / RPM, ge=0)  # 0: no slow roll
    slow_s: float = Field(10.0, ge=1)
    settle_s: float = Field(1.5, ge=0.2)
    dwell_s: float = Field(2.0, ge=0.5)
    capture_s: float = Field(0.4, ge=0.05)
    repeat: bool = True  # the lowest speed again at the end of each run
    trial_kg: tuple[float, float] = (1e-4, 1e-4)  # inboard, outboard
    trial_angle_rad: tuple[float, float] = (0.0, 0.0)  # on the planes' scales
    leave: bool = False  # trial weights stay on; else each is taken off after its run
    corrections: int = Field(2, ge=0, le=3)  # at most
    positions: int = Field(0, ge=0, le=360)  # equally spaced, the first at the scale's zero; 0: any angle
    grade_m_s: float = Field(2.5e-3, gt=0)  # G2.5
    service_rad_s: float = Field(15000 / RPM, gt=0)  # the highest, for the permissible residual unbalance
    max_share: float = Field(0.5, gt=0, le=0.9)  # of the least clearance: where a predicted response may reach
    refit_u_kg_m: float = Field(0.0, ge=0)  # of the shaft's own unbalance, each time a weight has been fixed
    bending_hz: float = Field(650.0, ge=0)  # first bending mode of the free shaft; 0: rigid
    bearings: Literal["adopted", "plan"] = "adopted"  # as in unbalance
    beta_share: float = Field(0.05, ge=0)
    offset_u_m: float = Field(10e-6, ge=0)
    max_lost: float = Field(1e-3, ge=0)
    max_speed_error: float = Field(0.01, gt=0)

    @property
    def variants(self) -> tuple[str, ...]:
        """One setting of the controller."""
        return (BASE,)

    @property
    def observed(self) -> bool:
        """Nothing is compensated."""
        return False

    @property
    def orders(self) -> int:
        """Highest order that the captures must hold."""
        return 1

    @property
    def rate_hz(self) -> float:
        """Of the captures, the controller's own."""
        return 1e4


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
    analyse=analyse,
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
