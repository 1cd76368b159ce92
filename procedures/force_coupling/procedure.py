"""Force coupling of the motor over the phase angle of its commutation (thesis 6.6.3; T 6.15 corrected).

Measurand, at the home angle: alpha_ratio = alpha_d/alpha_c, gamma_0 the phase angle at which the y current gives no x force
(zero of the encoder), and alpha_c the x force per y current in quadrature. The motor carries the outboard end while gamma is
stepped; gravity keeps a current of several amperes in it, and how that current turns with gamma tells the constants.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bench.calibration import Need
from bench.figures import Figure
from bench.findings import Finding, Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.uncertainty import Estimate
from procedures.force_coupling.plan import Plan
from procedures.force_coupling.requires import requires
from procedures.force_coupling.steps import Phase
from procedures.servomotor import carrying, checks
from procedures.servomotor.conventions import Servomotor, conventions, radial_currents
from procedures.servomotor.parameters import stated, write
from procedures.servomotor.steps import POSITIONS, read_steps
from procedures.shared import assumptions, first_look
from procedures.shared.step_table import StepTable, record_step

if TYPE_CHECKING:
    from procedures.force_coupling.estimates import Analysis

RATIO = Quantity(
    "alpha_ratio", "1", "alpha_d/alpha_c, direct over coupled force constant at the home angle", title="α_d/α_c"
)
ALPHA_C = Quantity("alpha_c", "N/A", "coupled force constant at the home angle: x force per y current in quadrature")
GAMMA_0 = Quantity("gamma_0", "rad", "phase angle at which direct and coupled force are apart: zero of the commutation")
MEASURES = (RATIO, ALPHA_C, GAMMA_0)
FATAL = (*checks.FATAL, "rotor-off-edge")
ALPHA_RATIO = 0.85  # T 6.6.3; for predictions before a run, and for nothing that is measured
STEADY_RAD = (
    0.7  # electrical: beyond it the motor's force is turned so far from the controller's that levitation is lost
)


def needs(_: Plan) -> tuple[Need, ...]:
    """The motor's direct force constant: the ratio alone gives no newtons."""
    return (Need("force-constant", facts=("alpha_d@0",)),)


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records, for the progress display."""
    return 2 * len(plan.gamma_rad)


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Step gamma up and down while the motor carries the outboard end at the sensors' zero."""
    carrying.home(rig)
    carrying.carry(rig, plan.settle_s)
    for gamma in carrying.approach(plan.gamma_rad):
        write(rig, {"motor.phase": gamma})
        rig.clock.sleep(plan.settle_s)
    _visit(rig, plan, record)
    carrying.leave_edge(rig)
    for gamma in (*reversed(carrying.approach(plan.gamma_rad)), 0.0):
        write(rig, {"motor.phase": gamma})
        rig.clock.sleep(plan.settle_s)
    carrying.give_back(rig, plan.settle_s)


def _visit(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Each phase angle from either edge; no more than the first where that shows a wrong sign and nobody says to go on."""
    machine, first = conventions(rig.file), True
    for branch, gammas in ((1, plan.gamma_rad), (-1, plan.gamma_rad[::-1])):
        carrying.to_edge(rig, branch, plan.count_rad)
        for gamma in gammas:
            write(rig, {"motor.phase": gamma})
            rig.clock.sleep(plan.settle_s)
            with record_step(record, Phase(gamma, branch)):
                mean = first_look.watched(rig, record, machine.segments, plan.average_s)
            if first and not first_look.passes(rig, record, checks.segments(mean, machine)):
                return
            first = False


def evaluate(recording: Recording[Plan], findings: Findings) -> Analysis:
    """The currents over the phase angle with their fit."""
    from procedures.force_coupling import checks as force_coupling_checks
    from procedures.force_coupling import estimates

    data = read(recording)
    first_look.gate(recording, findings, checks.segments(data.mean, conventions(recording.rig)))
    findings.gate(_of_signals(data, conventions(recording.rig), recording.plan), FATAL)
    a = estimates.evaluate(recording, data, recording.plan.count_rad)
    findings.add(force_coupling_checks.of_fit(data, a.fit, recording.plan))
    findings.add(
        force_coupling_checks.of_results(a, conventions(recording.rig), recording.rig.machine["pole_pairs"].value)
    )
    return a


def measured(a: Analysis) -> Iterator[Measured]:
    """The three quantities."""
    for quantity in MEASURES:
        yield quantity.measured(a.estimates[quantity.name])


def facts(a: Analysis) -> dict[str, Estimate]:
    """What later procedures use: the three, and the force that carries the outboard end over alpha_d, A."""
    found = {m.quantity.name: m.estimate for m in measured(a)}
    return {**found, "carried": replace(a.estimates["carried"], unit="A")}


def read(recording: Recording[Plan]) -> StepTable[Phase]:
    """The steps, in time order."""
    return read_steps(recording, Phase)


def _of_signals(data: StepTable[Phase], machine: Servomotor, plan: Plan) -> Iterator[Finding]:
    positions = machine.positions_of(*POSITIONS)
    yield from checks.of_signals(data, machine, (*machine.segments, *positions), plan.max_lost)
    yield from checks.segments(data.mean, machine)
    yield from checks.at_edge(data, plan.count_rad)
    i_x, i_y = radial_currents(*(data.drift[c] for c in machine.segments))
    yield from checks.settled(
        data, {c: data.mean[c] for c in positions}, {"i_y": i_y, "i_x": i_x}, plan.max_position_m, plan.max_drift_A
    )


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    gammas = plan.gamma_rad
    if list(gammas) != sorted(set(gammas)) or gammas[0] >= 0 or gammas[-1] <= 0:
        yield f"gamma_rad: found {gammas}; expected different angles in ascending order, on both sides of zero"
        return
    phase = stated(rig, "motor.phase")
    low, high = phase.low, phase.high
    poles = rig.machine["pole_pairs"].value
    furthest = max(-gammas[0], gammas[-1])
    limit = min(-low, high, STEADY_RAD / poles)
    if furthest > limit:
        yield (
            f"gamma_rad: found {math.degrees(furthest):.2f}°; the parameter's range and levitation (the force turns by "
            f"{poles:g} times gamma) allow {math.degrees(limit):.2f}°"
        )
    turn = poles * np.array(gammas)
    c, q = np.cos(turn), np.sin(turn) / ALPHA_RATIO
    most = float(np.max(np.maximum(np.abs(c), np.abs(q)) / (c**2 + q**2)))
    off_centre = (
        rig.geometry["motor_stiffness"].value * 30e-6
    )  # magnetic centre against the sensors' zero, two tolerances
    current = most * (carrying.gravity_share_N(rig) + off_centre) / carrying.newtons_per_A(rig)
    allowed = carrying.MARGIN * stated(rig, "motor.segment_limit").default
    if current > allowed:
        yield f"gamma_rad: the motor would need {current:.1f} A; expected at most {allowed:.1f} A"


def figures(a: Analysis, recording: Recording[Plan]) -> Iterable[Figure]:
    """Currents over gamma with the model, and residuals."""
    from procedures.force_coupling import figures as drawn

    return drawn.all_figures(a.data, a, recording.rig.machine["pole_pairs"].value)


procedure = Procedure(
    name="force-coupling",
    title="Force coupling of the motor over the phase angle",
    measures=MEASURES,
    state=RigState.LEVITATED,
    plan=Plan,
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    facts=facts,
    figures=figures,
    requires=requires,
    check=check,
    step_count=step_count,
    needs=needs,
    assumes=assumptions.FORCE_COUPLING,
    method=read_method(__file__),
)
