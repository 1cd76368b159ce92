"""Two-plane balancing by influence coefficients from trial weights (Goodman 1964), judged by ISO 21940-11.

Measurands, by plane: unbalance of the shaft as found and as left, on the scale of the balancing planes; what is left over the
permissible residual unbalance; influence coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Literal

from pydantic import Field

from bench.errors import AnalysisError
from bench.figures import Figure
from bench.findings import Effect, Finding
from bench.procedure import BenchPlan, Measured, Procedure, Quantity
from bench.recorder import Recorder
from bench.recording import Recording
from bench.rig import Rig
from bench.rigfile import RigFile
from bench.roles import Plane, RigState
from bench.states import transition
from procedures import balance_figures as drawn
from procedures import probing, unbalance
from procedures.estimators import balance_checks, balance_decision, balance_estimates
from procedures.estimators.balance_data import (
    BASE,
    CAPTURED,
    DECISION,
    MOUNT,
    REFUSED,
    SIDES,
    UNMOUNT,
    Read,
    Run,
    Weight,
    read_capture,
)
from procedures.estimators.unbalance_data import DWELL, RPM, SLOW

Law = Literal["PID", "CCS", "CAC"]
FOUND_COS = Quantity("unbalance_cos", "kg m", "of the shaft as found, in a plane: component along the scale's zero")
FOUND_SIN = Quantity("unbalance_sin", "kg m", "as unbalance_cos: component a quarter turn on, from y towards z")
LEFT_COS = Quantity(
    "residual_cos", "kg m", "what is left with all corrections mounted: component along the scale's zero"
)
LEFT_SIN = Quantity("residual_sin", "kg m", "as residual_cos: component a quarter turn on, from y towards z")
SHARE = Quantity("residual_share", "1", "amount of what is left over the permissible residual unbalance of the plane")
BOUND = Quantity("residual_bound", "kg m", "U_res + U: the greatest amount in the 95 % region of what is left")
PERMITTED = Quantity("permissible", "kg m", "permissible residual unbalance of the plane, ISO 21940-11")
COSINE = Quantity(
    "influence_cos", "m/(kg m)", "of a weight at the scale's zero on a probe, order 1 0-pk: cosine component"
)
SINE = Quantity("influence_sin", "m/(kg m)", "as influence_cos: sine component; x = C cos θ + S sin θ")
MEASURES = (FOUND_COS, FOUND_SIN, LEFT_COS, LEFT_SIN, SHARE, PERMITTED, COSINE, SINE)
SLOW_HZ = 500.0  # of the slow roll's capture


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
    return {"law": unbalance.CODES["PID"], "observer": 0.0, "compensate": 0.0}


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records at most."""
    runs = 3 + plan.corrections
    mounts = 2 + (0 if plan.leave else 2) + plan.corrections * (2 if plan.positions == 0 else 4)
    return probing.STEPS + (plan.slow_rad_s > 0) + runs * (len(plan.speeds_rad_s) + plan.repeat) + mounts


@dataclass
class Work:
    """A balancing under way: what is on the shaft, what was read so far."""

    rig: Rig
    plan: Plan
    record: Recorder
    mounted: list[Weight] = field(default_factory=list)
    runs: list[Run] = field(default_factory=list)
    slow: Read | None = None
    fixed: int = 0
    dwells: int = 0


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Look, lift and nudge; slow roll and base run; a run with a trial weight in each plane; corrections, each verified."""
    work = Work(rig, plan, record)
    if not probing.probed(rig, record):
        return
    unbalance.put(rig, {"law": unbalance.CODES[plan.law], **unbalance.SETTINGS["off"]})
    if not _rolled(work) or not _run(work, BASE):
        return
    for p, side in enumerate(SIDES):
        if (allowed := balance_decision.refused(rig.file, plan, work.runs, p)) is not None:
            record.event(REFUSED, plane=side, kg=plan.trial_kg[p], allowed_kg=allowed)
            return
        _mount(work, p, plan.trial_kg[p], plan.trial_angle_rad[p], "trial")
        if not _run(work, f"trial {side}") or not _acted(work, p):
            return
        if not plan.leave:
            _unmount(work, p)
    _correct(work)


def _rolled(work: Work) -> bool:
    """The slow roll, where the plan has one."""
    rig, plan = work.rig, work.plan
    if not plan.slow_rad_s:
        return True
    if not probing.turned(rig, work.record, plan.slow_rad_s, plan.settle_s):
        unbalance.finished(rig)
        return False
    work.slow = _dwell(work, SLOW, BASE, plan.slow_rad_s, plan.slow_s, plan.slow_s, SLOW_HZ)
    return work.slow is not None


def _run(work: Work, name: str) -> bool:
    """Levitated, all speeds, the lowest again, stopped and landed; False where it was not completed or not sound."""
    rig, plan = work.rig, work.plan
    if rig.levitation.state is RigState.READY:  # the base run goes on from the slow roll
        transition(rig, RigState.LEVITATED)
    unbalance.put(rig, {"law": unbalance.CODES[plan.law], **unbalance.SETTINGS["off"]})
    reads: list[Read] = []
    speeds = sorted(plan.speeds_rad_s)
    for speed in (*speeds, *(speeds[:1] if plan.repeat else ())):
        if not probing.turned(rig, work.record, speed, plan.settle_s):
            break
        read = _dwell(work, DWELL, name, speed, plan.dwell_s, plan.capture_s, None, again=len(reads) == len(speeds))
        if read is None or not read.sound:
            break
        reads.append(read)
    unbalance.finished(rig)
    transition(rig, RigState.READY)
    if len(reads) < len(speeds) + plan.repeat:
        return False
    run = Run(name, tuple(work.mounted), tuple(reads[: len(speeds)]), reads[-1] if plan.repeat else None)
    work.runs.append(run)
    return not list(balance_decision.slipped(run))


def _dwell(
    work: Work, kind: str, name: str, speed: float, seconds: float, capture_s: float, rate_hz: float | None,
    again: bool = False,
) -> Read | None:  # fmt: skip
    """A recorded dwell and what its capture says, None where that cannot be told."""
    rig, number = work.rig, -1 if again else work.dwells
    assert rig.capture is not None  # `check` refuses a rig without one
    driven = rig.drive.speed_rad_s if rig.drive is not None else 0.0
    labels = {"speed_rad_s": speed, "variant": name, "driven_rad_s": driven, "number": number, "again": again}
    with work.record.step(kind, **labels):
        rig.capture.arm(CAPTURED, seconds=capture_s, rate_hz=rate_hz)
        rig.capture.wait(capture_s + 5.0)
        rig.clock.sleep(max(seconds - capture_s, unbalance.MARGIN_S))
    work.dwells += 1
    data = rig.capture.upload(run=name, speed_rad_s=speed)
    try:
        return read_capture(data)
    except AnalysisError:
        return None  # the analysis says what is wrong with the pulses


def _mount(work: Work, plane: int, kg: float, angle: float, purpose: str) -> None:
    """Have a weight fixed; the shaft is landed."""
    side: Plane = "inboard" if plane == 0 else "outboard"
    with work.record.step(MOUNT, plane=side, kg=kg, angle_rad=angle, purpose=purpose):
        work.rig.operator.attach(side, kg, angle)
    work.fixed += 1
    work.mounted.append(Weight(plane, kg, angle, work.fixed))


def _unmount(work: Work, plane: int) -> None:
    """Have every weight of a plane taken off."""
    side: Plane = "inboard" if plane == 0 else "outboard"
    with work.record.step(UNMOUNT, plane=side):
        work.rig.operator.detach(side)
    work.mounted = [w for w in work.mounted if w.plane != plane]


def _acted(work: Work, plane: int) -> bool:
    """Whether the trial weight of the last run did what it should."""
    base, last = work.runs[0], work.runs[-1]
    before = work.runs[-2] if work.plan.leave else base
    added = balance_decision.shown(before, last, last.weights[-1], work.rig.file, work.plan)
    return not list(balance_decision.of_trial(added, last.weights[-1]))


def _correct(work: Work) -> None:
    """Corrections, each with its verification run, until it is reached or the plan allows no more."""
    rig, plan = work.rig.file, work.plan
    trials = balance_decision.trials_of(work.runs, rig, plan.leave)
    assert trials is not None
    shown = [balance_decision.shown(trials.before[p], trials.having[p], trials.weights[p], rig, plan) for p in (0, 1)]
    if list(balance_decision.of_trials(shown[0], shown[1])):
        return
    present = work.runs[-1] if plan.leave else trials.base
    for n in range(plan.corrections):
        found = balance_estimates.balanced(work.slow, [present], trials, rig, plan)
        needed = balance_decision.correction(found, present.name, rig, plan)
        work.record.event(DECISION, run=present.name, reached=needed.reached, too_heavy_kg=needed.too_heavy)
        if needed.reached or needed.too_heavy:
            return
        for plane, kg, angle in needed.weights:
            _mount(work, plane, kg, angle, f"correction {n + 1}")
        if not _run(work, f"check {n + 1}"):
            return
        present = work.runs[-1]


def analyse(recording: Recording[Plan]) -> Iterator[Measured | Finding]:
    """Findings first, then the quantities."""
    found = balance_checks.evaluated(recording)
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
        yield SHARE.measured(balance_estimates.share(result, last, p), side)
    for (axis, side), (cosine, sine) in found.influences.items():
        where = f"{axis}, weight {side}, {max(recording.plan.speeds_rad_s) * RPM:.0f} r/min"
        yield COSINE.measured(cosine, where)
        yield SINE.measured(sine, where)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    yield from balance_checks.of_plan(rig, plan)


def figures(recording: Recording[Plan]) -> Iterable[Figure]:
    """Polar plots of the vectors, influence coefficients, residual against U_per; empty where nothing was evaluated."""
    found = balance_checks.evaluated(recording)
    return () if found.balance is None else drawn.all_figures(found)


METHOD = """\
"""

procedure = Procedure(
    name="balance",
    title="Two-plane balancing by influence coefficients",
    measures=MEASURES,
    state=RigState.READY,
    plan=Plan,
    acquire=acquire,
    analyse=analyse,
    figures=figures,
    check=check,
    settings=settings,
    step_count=step_count,
    method=METHOD,
)
assert math.pi and Effect
