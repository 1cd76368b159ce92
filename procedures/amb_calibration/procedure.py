"""AMB force-current constants by hanging known masses (thesis 6.6.1; equilibrium 6.11 with the corrected signs).

Measurand: dF/di of each radial AMB in the vertical axis at zero control current, rotor held where the position sensors
read zero, at the stated bias, mean over a full turn of the rotor. With it K2 (half of the second derivative) and the
tangent at the current that carries the rotor's own weight. Horizontal constants are not measured: no load acts there.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from bench.figures import Figure
from bench.findings import Ended, Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.requires import Requires
from bench.procedure.rig import Rig
from bench.procedure.roles import NOTHING, Load, RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.roles import STATUS
from bench.uncertainty import Estimate, propagate
from procedures.amb_calibration import both_coils, checks, hypotheses
from procedures.amb_calibration import by_angle as amb_calibration_by_angle
from procedures.amb_calibration import figures as drawn
from procedures.amb_calibration import fit as amb_calibration_fit
from procedures.amb_calibration.estimates import less_sure, turning_point, unresolved_angles
from procedures.amb_calibration.fit import Fit
from procedures.amb_calibration.hypotheses import Contradiction
from procedures.amb_calibration.plan import Plan
from procedures.amb_calibration.scatter import OUTPUTS, Scatter, covariance_by_angle, covariance_over_a_turn, scatter
from procedures.amb_calibration.steps import AXES, VERTICAL, Hang, HangingData, channels, read_hangings
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.servomotor.loads import certified_masses, certified_weighing, check_masses
from procedures.servomotor.parameters import BIASES, named, needed
from procedures.shared import assumptions, first_look
from procedures.shared.certificates import certified, certified_sensors
from procedures.shared.step_table import record_step
from procedures.shared.unsupported import of_hooks
from procedures.shared.weight import weight

K_I = Quantity("K_i", "N/A", "inboard AMB: dF/di at zero control current, mean over a turn")
K_O = Quantity("K_o", "N/A", "outboard AMB: dF/di at zero control current, mean over a turn")
K2_I = Quantity("K2_i", "N/A^2", "inboard AMB: (d²F/di²)/2, mean over a turn")
K2_O = Quantity("K2_o", "N/A^2", "outboard AMB: (d²F/di²)/2, mean over a turn")
KW_I = Quantity("Kw_i", "N/A", "inboard AMB: dF/di at the current that carries the rotor's own weight")
KW_O = Quantity("Kw_o", "N/A", "outboard AMB: dF/di at the current that carries the rotor's own weight")
MEASURES = (K_I, K_O, K2_I, K2_O, KW_I, KW_O)
CLEAR_A = 0.1  # a change of a control current that is no noise


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """Controller parameters that the runner writes before levitation."""
    return named(rig, dict.fromkeys(BIASES, plan.bias_A))


def sequence(plan: Plan) -> list[tuple[Load, int]]:
    """Loads at one angle with their branch: up and down, mirrored in time, so that linear drift cancels.

    The first zero was reached by unloading (at the previous angle, or by the exercise before the first).
    """
    up = [Load(label) for label in plan.masses]
    return [(NOTHING, -1), *((x, 1) for x in up), *((x, -1) for x in reversed(up[:-1])), (NOTHING, -1)]


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records, for the progress display."""
    return plan.angles * len(sequence(plan))


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Hang every mass up and down at each angle; the hanger stays on throughout."""
    machine = conventions(rig.file)
    before = _controls(rig, machine)
    rig.operator.hang(Load(plan.masses[-1]))  # exercise: the first zero is then reached by unloading, like the others
    rig.clock.sleep(plan.settle_s)
    changes = {axis: after - before[axis] for axis, after in _controls(rig, machine).items()}
    rig.operator.hang(NOTHING)
    if max(map(abs, changes.values())) > CLEAR_A and not first_look.goes_on(rig, checks.wiring(**changes)):
        record.event(checks.WIRED_WRONG, changes=changes)  # an hour of hangings would say no more
        return
    for turn in range(plan.angles):
        angle = 2 * math.pi * turn / plan.angles
        rig.rotation.point(angle)
        for k, (load, branch) in enumerate(sequence(plan)):
            hanging = rig.operator.hang(load)
            rig.clock.sleep(plan.settle_s)
            if turn == k == 0 and (needed := both_coils.at_no_load(machine, rig.levitation.reading, plan.bias_A)):
                record.event(both_coils.ONE_SIDED, needed=needed)
                return
            with record_step(record, Hang(angle, hanging.label, branch)):
                rig.clock.sleep(plan.average_s)


def _controls(rig: Rig, machine: Servomotor) -> dict[str, float]:
    """The control currents by axis as they are now, A."""
    return {axis: machine.control(axis, rig.levitation.reading) for axis in AXES}


@dataclass(frozen=True)
class Analysis:
    """Everything the measurements, findings, facts and figures are made of.

    `estimates` are without the scatter of the hangings, means over a turn and values by angle; `spread` (A, 8, 8) is its
    covariance at each angle. `loads` is what the masses say against each other, `beyond` (relative) what that adds to each."""

    data: HangingData
    inputs: dict[str, Estimate]
    fit: Fit
    scatter: Scatter
    loads: Contradiction
    beyond: float
    spread: np.ndarray
    estimates: dict[str, Estimate]


def evaluate(recording: Recording[Plan], findings: Findings) -> Analysis:
    """Fit, scatter and estimates with their influences."""
    findings.gate(checks.of_first(recording))
    plan = recording.plan
    data = read_hangings(recording)
    findings.gate(checks.of_signals(data, conventions(recording.rig), plan), checks.FATAL)
    a = _fitted(recording, data)
    values = {name: e.value for name, e in a.inputs.items()}
    findings.gate(
        checks.of_fit(data, a.fit, a.scatter, a.loads, a.beyond, values, plan, masses_u(recording)), checks.FATAL
    )
    if hypotheses.mistaken(a.loads, a.beyond):
        raise Ended
    findings.gate(both_coils.of_fit(_scattered(a), data.hangings, plan.bias_A))
    return a


def measured(a: Analysis) -> Iterator[Measured]:
    """The six quantities."""
    estimates = _scattered(a)
    for quantity in MEASURES:
        yield quantity.measured(estimates[quantity.name])


def _scattered(a: Analysis) -> dict[str, Estimate]:
    """The six quantities with the scatter of the hangings."""
    terms = amb_calibration_by_angle.scatter_terms("scatter", covariance_over_a_turn(a.spread), a.scatter.dof)
    return {q.name: a.estimates[q.name] + terms[q.name] for q in MEASURES}


def facts(a: Analysis) -> dict[str, Estimate]:
    """The six quantities, and K, K2 and F0 of each bearing at each angle, all with one scatter for each angle: what a later
    procedure takes at one angle and what it takes over a turn then stay correlated as they are."""
    return amb_calibration_by_angle.with_scatter(a.estimates, a.spread, a.scatter.dof)


def _fitted(recording: Recording[Plan], data: HangingData) -> Analysis:
    plan = recording.plan
    inputs = fit_inputs(recording.rig, plan)
    count = len(plan.masses)

    def model(p: Mapping[str, float], top_branch: float = 1.0) -> dict[str, float]:
        fitted = amb_calibration_fit.fit(data.hangings, p, plan.bias_A, count, top_branch=top_branch)
        by_angle = amb_calibration_fit.by_angle(fitted) | amb_calibration_fit.carried(fitted, p)
        return amb_calibration_fit.over_a_turn(fitted, p) | by_angle

    values = {name: e.value for name, e in inputs.items()}
    fitted = amb_calibration_fit.fit(data.hangings, values, plan.bias_A, count)
    spread = scatter(fitted, data.hangings, count)
    share = np.array(amb_calibration_fit.hung_shares(values["hook_to_outboard"], values["amb_span"]))
    hanger = weight(values["hanger"], values["gravity"], values["air_density"], values["mass_density"])
    covariance = covariance_by_angle(fitted, spread, -share * float(hanger))
    loads = hypotheses.contradiction(fitted, data.hangings, spread, values, masses_u(recording))
    beyond = hypotheses.scatter_of_set(loads)
    hung = {label: recording.rig.masses[label].value for label in plan.masses}
    estimates = {name: less_sure(e, hung, beyond) for name, e in propagate(model, inputs).items()}
    half_branch = model(values, top_branch=0.0)
    for name, estimate in estimates.items():
        estimates[name] = estimate + turning_point(name, half_branch[name] - estimate.value)
        if name in OUTPUTS:
            estimates[name] += unresolved_angles(name, fitted, plan.bias_A, values["amb_gap"])
    return Analysis(data, inputs, fitted, spread, loads, beyond, covariance, estimates)


def fit_inputs(rig: RigFile, plan: Plan) -> dict[str, Estimate]:
    """What the fit needs besides the recording: certificates of the rig file, each as an influence by identity."""
    g = rig.geometry
    inputs = certified_weighing(rig) | {
        "hook_to_outboard": certified("geometry/hook_to_outboard", g["hook_to_outboard"], "span hook to outboard AMB"),
        "amb_span": certified("geometry/amb_span", g["amb_span"], "span AMB to AMB"),
        "motor_to_outboard": Estimate.exact(g["com_to_motor"].value - g["com_to_outboard_amb"].value),
        "amb_gap": certified("geometry/amb_gap", g["amb_gap"], "AMB gap (residual position)"),
        "motor_stiffness": certified(
            "geometry/motor_stiffness", g["motor_stiffness"], "motor stiffness (residual pos.)"
        ),
        "hanger": certified("masses/hanger", rig.hanger, "hanger"),
    }
    return inputs | certified_masses(rig, plan.masses) | certified_sensors(rig, conventions(rig).coils_along("y"))


def masses_u(recording: Recording[Plan]) -> np.ndarray:
    """Standard uncertainty in kg of the hanger (nothing hung) and of each mass."""
    rig = recording.rig
    return np.array([rig.hanger.standard_uncertainty,
                     *(rig.masses[m].standard_uncertainty for m in recording.plan.masses)])  # fmt: skip


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    return check_masses(rig, plan.masses)


def figures(a: Analysis, recording: Recording[Plan]) -> Iterable[Figure]:
    """Fit, residuals, one step over time, and both polar plots."""
    values = {name: e.value for name, e in a.inputs.items()}
    return drawn.all_figures(recording, a.data, a.fit, values)


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    machine = conventions(rig)
    return Requires(
        lacks=(*machine.lacks, *of_hooks(rig)),
        roles=("levitation", "rotation"),
        channels=(*channels(machine), STATUS),
        sensors=machine.coils_of(*VERTICAL),
        parameters=needed(rig, *BIASES, "angle.ref"),
        geometry=("hook_to_outboard", "amb_span", "amb_gap", "com_to_motor", "motor_stiffness", *machine.levers),
        masses=True,
    )


procedure = Procedure(
    name="amb-calibration",
    title="Force-current constants of the radial AMBs by hanging known masses",
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
    facts=facts,
    holds_for=lambda plan: {"bias_A": plan.bias_A, "angles": plan.angles},
    reached=("masses/*", "!masses/hanger", "!masses/density"),
    assumes=assumptions.AMB_CALIBRATION,
    method=read_method(__file__),
)
