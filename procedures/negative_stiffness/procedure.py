"""Negative stiffness of the motor by eccentric positioning (thesis end of 6.6.2; alpha_x' of 6.8), in two ways.

Measurand: alpha_x' = alpha_x (z_m - z_is)/(z_os - z_is): the motor's force per displacement of the outboard sensor's plane
with the inboard sensor's plane held. First way: the motor itself holds the outboard end, the outboard AMB is off. Second
way: the AMBs hold, the motor has no current, and the AMB's own stiffness is told apart by a second bias.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from bench.calibration import Need
from bench.figures import Figure
from bench.findings import Finding, Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.procedure.states import transition
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from procedures.negative_stiffness.plan import Plan
from procedures.negative_stiffness.requires import requires
from procedures.negative_stiffness.steps import Displaced, HeldByAmbs, HeldByMotor
from procedures.servomotor import carrying, checks
from procedures.servomotor.conventions import conventions, radial_currents
from procedures.servomotor.parameters import BIASES, named, needed, stated, write
from procedures.servomotor.steps import POSITIONS, read_steps
from procedures.shared import first_look
from procedures.shared.step_table import StepTable, record_step

if TYPE_CHECKING:
    from procedures.negative_stiffness.estimates import Analysis

Array = npt.NDArray[np.float64]
ALPHA_X = Quantity(
    "alpha_x_prime", "N/m", "negative stiffness at the outboard sensor, from the motor's own current", title="α′_x"
)
ALPHA_X_AMB = Quantity(
    "alpha_x_prime_amb",
    "N/m",
    "negative stiffness at the outboard sensor, from AMB currents at two biases",
    title="α′_x by the AMBs",
)
MEASURES = (ALPHA_X, ALPHA_X_AMB)
MARGIN = carrying.MARGIN
AMB_N_PER_A = 74.4  # T (6.12), K_o; for predictions before a run, and for nothing that is measured


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """Controller parameters that the runner writes before levitation."""
    return named(rig, dict.fromkeys(BIASES, plan.bias_A))


def needs(plan: Plan) -> tuple[Need, ...]:
    """Force constants of the outboard AMB at this bias, and of the motor."""
    return (
        Need("amb-calibration", {"bias_A": plan.bias_A}),
        Need("force-constant", facts=("alpha_d", "alpha_d@0", "alpha_dx")),
    )


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records, for the progress display."""
    return 3 * (2 * len(plan.levels_m) - 1)


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Displace the outboard end: by the motor, then by the AMBs at both biases. The bias is written at rest."""
    carrying.home(rig)
    inboard = _amb_shares(rig.file)[0]
    carrying.carry(rig, plan.settle_s)
    carrying.to_edge(rig, 1, plan.count_rad)
    # The inboard AMB's plane goes with the displacement as far as keeps the inboard sensor at zero.
    passed = _walk(rig, plan, record, HeldByMotor, {"motor.ref_along": 1.0, "at.yi": inboard}, plan.bias_A)
    carrying.leave_edge(rig)
    carrying.give_back(rig, plan.settle_s)
    if not passed:
        return
    for bias in (plan.bias_A, plan.bias_high_A):
        if bias != plan.bias_A:
            transition(rig, RigState.READY)
            write(rig, dict.fromkeys(BIASES, bias))
            transition(rig, RigState.LEVITATED)
            carrying.home(rig)
            rig.clock.sleep(plan.settle_s)
        _walk(rig, plan, record, HeldByAmbs, {"at.yo": _tilt(rig.file)}, bias)


def _walk(
    rig: Rig, plan: Plan, record: Recorder, kind: type[Displaced], references: Mapping[str, float], bias: float
) -> bool:
    """Up and down through the levels; no further than the first, and False, where the motor's currents show a wrong sign there
    and nobody says to go on."""
    machine, passed = conventions(rig.file), True

    def go(level: float) -> None:
        write(rig, {key: factor * level for key, factor in references.items()})
        rig.clock.sleep(plan.settle_s)

    for level in carrying.approach(plan.levels_m):
        go(level)
    for number, (level, branch) in enumerate(carrying.mirrored(plan.levels_m)):
        go(level)
        with record_step(record, kind(level, branch, bias)):
            mean = first_look.watched(rig, record, machine.segments, plan.average_s)
        if kind is HeldByMotor and number == 0:
            passed = first_look.passes(rig, record, checks.segments(mean, machine))
            if not passed:
                break
    go(0.0)
    return passed


def _amb_shares(rig: RigFile) -> tuple[float, float]:
    """Share of the outboard sensor in the displacement at the inboard and at the outboard AMB, as the controller has it."""
    machine = conventions(rig)
    inboard, outboard = (rig.geometry[name].value for name in machine.ambs)
    return machine.sensor_share(-inboard, rig), machine.sensor_share(outboard, rig)


def _tilt(rig: RigFile) -> float:
    """Displacement of the outboard AMB's plane over that of the outboard sensor's while the inboard AMB's plane stays; the
    inboard sensor, beyond it, goes the other way."""
    inboard, outboard = _amb_shares(rig)
    return outboard - (1 - outboard) * inboard / (1 - inboard)


def evaluate(recording: Recording[Plan], findings: Findings) -> Analysis:
    """The stiffness both ways, by the motor's current and by the AMB's."""
    from procedures.negative_stiffness import checks as negative_stiffness_checks
    from procedures.negative_stiffness import estimates

    first_look.gate(recording, findings, _of_first(recording))
    motor, ambs = read(recording)
    findings.gate(_of_signals(recording, motor, ambs), checks.FATAL)
    a = estimates.evaluate(recording, motor, ambs)
    findings.add(negative_stiffness_checks.of_fits(a.motor, a.ambs, a.by_motor, a.by_ambs, recording.plan))
    findings.add(negative_stiffness_checks.of_results(a.estimates, recording.rig))
    return a


def measured(a: Analysis) -> Iterator[Measured]:
    """Both values."""
    yield ALPHA_X.measured(a.estimates["motor"])
    yield ALPHA_X_AMB.measured(a.estimates["ambs"])


def read(recording: Recording[Plan]) -> tuple[StepTable[HeldByMotor], StepTable[HeldByAmbs]]:
    """The steps of both ways."""
    return read_steps(recording, HeldByMotor), read_steps(recording, HeldByAmbs)


def _of_first(recording: Recording[Plan]) -> Iterator[Finding]:
    """What the motor's currents show of signs, read when it is asked for."""
    yield from checks.segments(read_steps(recording, HeldByMotor).mean, conventions(recording.rig))


def _of_signals(
    recording: Recording[Plan], motor: StepTable[HeldByMotor], ambs: StepTable[HeldByAmbs]
) -> Iterator[Finding]:
    plan = recording.plan
    machine, inboard = conventions(recording.rig), _amb_shares(recording.rig)[0]
    positions = machine.positions_of(*POSITIONS)
    i_x, i_y = radial_currents(*(motor.drift[c] for c in machine.segments))
    i_yo = machine.control("yo", ambs.drift.__getitem__)
    ways = (
        (motor, machine.segments, 0.0, {"i_y": i_y, "i_x": i_x}),
        (ambs, machine.coils["yo"], -inboard / (1 - inboard), {"i_yo": i_yo}),
    )
    yield from checks.segments(motor.mean, machine)
    yield from checks.at_edge(motor, plan.count_rad)
    for data, currents, follow, drifts in ways:
        yield from checks.of_signals(data, machine, (*currents, *positions), plan.max_lost)
        level = data.each(lambda step: step.level_m)
        references: dict[str, Array | float] = {"yo": level, "yi": follow * level, "xi": 0.0, "xo": 0.0}
        offsets = {c: data.mean[c] - references[a] for a in references for c in machine.positions_of(a)}
        yield from checks.settled(data, offsets, drifts, plan.max_position_m, plan.max_drift_A)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    levels = plan.levels_m
    if list(levels) != sorted(set(levels)) or levels[0] >= 0 or levels[-1] <= 0:
        yield f"levels_m: found {levels}; expected different levels in ascending order, on both sides of zero"
        return
    if not plan.bias_high_A >= 1.15 * plan.bias_A:
        yield (
            f"bias_high_A: found {plan.bias_high_A:g} A beside bias_A = {plan.bias_A:g} A; expected at least 15 % more: what "
            "belongs to the AMB is told from the motor by its growth with the square of the bias"
        )
    yield from _ranges(rig, plan, max(-levels[0], levels[-1]))


def _ranges(rig: RigFile, plan: Plan, furthest: float) -> Iterator[str]:
    limit = min(
        stated(rig, "motor.ref_along").high, stated(rig, "at.yo").high, MARGIN * rig.envelope.max_levitated_position_m
    )
    if furthest > limit:
        yield f"levels_m: found {furthest * 1e6:.0f} µm; references and envelope allow {limit * 1e6:.0f} µm"
    for name in needed(rig, *BIASES):
        if plan.bias_high_A > rig.parameters[name].high:
            yield f"bias_high_A: found {plan.bias_high_A:g} A; {name} goes to {rig.parameters[name].high:g} A"
    g = rig.geometry
    share = conventions(rig).sensor_share(g["com_to_motor"].value, rig)
    pull = g["motor_stiffness"].value * share * furthest
    current, most = (
        (carrying.gravity_share_N(rig) + pull) / carrying.newtons_per_A(rig),
        MARGIN * stated(rig, "motor.segment_limit").default,
    )
    if current > most:
        yield f"levels_m: the motor would need {current:.1f} A at {furthest * 1e6:.0f} µm; expected at most {most:.1f} A"
    span, arm = g["amb_span"].value, g["com_to_inboard_amb"].value
    carried = carrying.weight_N(rig) * arm / span
    moved = (
        g["motor_stiffness"].value * ((arm + g["com_to_motor"].value) / span) ** 2
        + AMB_N_PER_A * plan.bias_A / g["amb_gap"].value
    )
    control = (carried + moved * _tilt(rig) * furthest) / AMB_N_PER_A
    if control > MARGIN * plan.bias_A:
        yield (
            f"levels_m: the outboard AMB would need {control:.1f} A of control current at {furthest * 1e6:.0f} µm; "
            f"expected at most {MARGIN * plan.bias_A:.1f} A at {plan.bias_A:g} A of bias"
        )


def figures(a: Analysis, recording: Recording[Plan]) -> Iterable[Figure]:
    """Force over displacement with residuals, and the AMB's lines at both biases."""
    from procedures.negative_stiffness import figures as drawn

    return drawn.all_figures(a, conventions(recording.rig), recording.plan)


procedure = Procedure(
    name="negative-stiffness",
    title="Negative stiffness of the motor by eccentric positioning",
    measures=MEASURES,
    state=RigState.LEVITATED,
    plan=Plan,
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    settings=settings,
    step_count=step_count,
    needs=needs,
    method=read_method(__file__),
)
