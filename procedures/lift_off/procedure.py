"""Lift-off by the phase angle: from which gamma on the motor lifts its end from the ring (thesis 6.7.3, Fig. 6.11).

Measurands: gamma_lift, half the difference of the phase angles, above and below, from which on the motor at its limit of
current lifts the outboard end while the inboard AMB holds the other one; gamma_zero, their middle; rest_depth, how deep the end
lies; and gamma_predicted, the same angle by statics from what other procedures found of the motor.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from bench.calibration import Need
from bench.errors import AnalysisError, Lacking
from bench.figures import Figure
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.procedure.states import transition
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.uncertainty import interval
from procedures.lift_off.plan import Plan
from procedures.lift_off.requires import requires
from procedures.lift_off.steps import Dwell, Held, Ramp, Rest, always, read_table
from procedures.servomotor.conventions import conventions
from procedures.servomotor.parameters import named, parameter, stated, write
from procedures.shared import assumptions
from procedures.shared.first_look import watched
from procedures.shared.step_table import record_step

if TYPE_CHECKING:
    from procedures.lift_off.estimates import Analysis

GAMMA_LIFT = Quantity(
    "gamma_lift",
    "rad",
    "half the difference of the phase angles, above and below, from which on the motor lifts its end",
    title="phase angle of lift-off",
)
PREDICTED = Quantity(
    "gamma_predicted",
    "rad",
    "the same by statics, from the motor's constants as other procedures found them",
    title="phase angle of lift-off, predicted",
)
GAMMA_ZERO = Quantity(
    "gamma_zero",
    "rad",
    "middle of both phase angles: zero of the commutation, and the load across",
    title="middle of the phase angles",
)
REST_DEPTH = Quantity(
    "rest_depth", "m", "how deep the outboard end lies on its ring, under the probe's zero", title="depth at rest"
)
MEASURES = (GAMMA_LIFT, PREDICTED, GAMMA_ZERO, REST_DEPTH)
CHOSEN = (("lifted_by", "motor"), ("sharing", "priority"))
LONGEST_S = 55.0  # of a lift: the controller's own patience is 60 s
LOOK_S = 0.05


def chosen(rig: RigFile) -> dict[str, float]:
    """The parameters that have the motor lift, with force before torque.

    Raises:
        Lacking: the controller does not have both.
    """
    out: dict[str, float] = {}
    for kind, name in CHOSEN:
        known: Mapping[str, Mapping[str, float]] = rig.capabilities.settings.get(kind, {})
        if name not in known:
            raise Lacking(f"capabilities.settings.{kind}: found no {name}")
        out |= known[name]
    return out


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """Written at rest, before the lift: the motor lifts, its limit growing over the time of a lift."""
    return {**chosen(rig), rig.capabilities.lift_time: plan.raise_s, **named(rig, {"motor.phase": 0.0})}


def needs(_: Plan) -> tuple[Need, ...]:
    """What the prediction is made of."""
    return (
        Need("force-constant", facts=("alpha_d", "alpha_d@0", "alpha_dx")),
        Need("negative-stiffness", facts=("alpha_x_prime",)),
        Need("force-coupling", facts=("alpha_c", "gamma_0")),
    )


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records, for the progress display."""
    return 1 + 6 * plan.repeats


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Lift and land, with each sign of gamma in turn; no more where the end is up before gamma is turned, or stays down."""
    with record_step(record, Rest()):
        rig.clock.sleep(plan.rest_s)
    for repeat in range(plan.repeats):
        for way in (1, -1):
            if not _lifted(rig, plan, record, repeat, way):
                return
            transition(rig, RigState.READY)


def _lifted(rig: Rig, plan: Plan, record: Recorder, repeat: int, way: int) -> bool:
    """One lift; whether the end went up by its phase angle. It ends with the end up and held, or lying on its ring."""
    (probe,) = conventions(rig.file).positions_of("yo")
    write(rig, {"motor.phase_slew": plan.rate_rad_s})
    rig.levitation.lift()
    rig.clock.sleep(plan.raise_s + plan.settle_s)
    if _up(rig):
        _hold(rig, plan, record, repeat, way)
        return False
    with record_step(record, Dwell(repeat, way)):
        rest = watched(rig, record, [probe], plan.dwell_s)[probe]
    with record_step(record, Ramp(repeat, way)):
        write(rig, {"motor.phase": way * plan.gamma_max_rad})
        for _ in range(math.ceil((plan.gamma_max_rad / plan.rate_rad_s + plan.confirm_s) / LOOK_S)):
            if rig.levitation.reading(probe) > rest / 2:
                break
            rig.clock.sleep(LOOK_S)
        rig.clock.sleep(plan.confirm_s)
    up = rig.levitation.reading(probe) > rest / 2
    if up:
        _hold(rig, plan, record, repeat, way)
    return up and _up(rig)


def _up(rig: Rig) -> bool:
    return rig.levitation.state is RigState.LEVITATED


def _hold(rig: Rig, plan: Plan, record: Recorder, repeat: int, way: int) -> None:
    """The end up, gamma back at zero."""
    write(rig, {"motor.phase_slew": plan.back_rad_s})
    write(rig, {"motor.phase": 0.0})
    rig.clock.sleep(plan.gamma_max_rad / plan.back_rad_s + plan.settle_s)
    with record_step(record, Held(repeat, way)):
        rig.clock.sleep(plan.average_s)


def evaluate(recording: Recording[Plan], findings: Findings) -> Analysis:
    """Phase angles and their prediction.

    Raises:
        AnalysisError: there is no step at rest.
    """
    from procedures.lift_off import checks, estimates

    rig, plan, machine = recording.rig, recording.plan, conventions(recording.rig)
    rest = read_table(recording, Rest)
    if rest is None:
        raise AnalysisError("found no step at rest; expected the run's (was it stopped early?)")
    a = estimates.evaluate(recording, rest)
    touching = tuple(always(recording, kind, machine.contact_outboard) for kind in (Rest, Dwell))
    findings.gate(checks.of_signals(a, machine, (touching[0], touching[1]), plan), checks.FATAL, so_far=a)
    findings.add(checks.of_lifts(a, rig, machine, touching[1], plan))
    findings.add(checks.of_rotor(a, plan))
    findings.add(checks.of_place(a, rig, machine))
    findings.add(checks.of_prediction(a))
    return a


def measured(a: Analysis) -> Iterator[Measured]:
    """The quantities, as far as the run went."""
    for quantity in MEASURES:
        e = a.estimates.get(quantity.name)
        if e is None or (
            quantity is PREDICTED and interval(e).high <= 0
        ):  # it lifts at 0 for certain: that is no angle
            continue
        yield quantity.measured(e)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    phase = stated(rig, "motor.phase")
    if plan.gamma_max_rad > min(phase.high, -phase.low):
        name = parameter(rig, "motor.phase")
        yield f"gamma_max_rad: found {plan.gamma_max_rad:g}; {name} goes from {phase.low:g} to {phase.high:g}"
    slew = stated(rig, "motor.phase_slew")
    if not slew.low < plan.rate_rad_s <= plan.back_rad_s <= slew.high:
        found = f"{plan.rate_rad_s:g}, {plan.back_rad_s:g}"
        yield f"rate_rad_s, back_rad_s: found {found}; expected ascending, up to {slew.high:g}"
    lasts = plan.settle_s + plan.dwell_s + plan.gamma_max_rad / plan.rate_rad_s + plan.confirm_s
    if lasts > LONGEST_S:
        yield f"rate_rad_s: a lift takes up to {lasts:.0f} s; expected at most {LONGEST_S:g} s: the controller gives it up then"


def figures(a: Analysis, recording: Recording[Plan]) -> Iterable[Figure]:
    """Position and contact over gamma, currents over gamma."""
    from procedures.lift_off import figures as drawn

    return drawn.all_figures(a)


procedure = Procedure(
    name="lift-off",
    title="Lift-off by the phase angle of the motor",
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
    fewest_steps=lambda plan: 2,
    needs=needs,
    optional=MEASURES,
    assumes=assumptions.LIFT_OFF,
    method=read_method(__file__),
)
