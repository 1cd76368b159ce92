"""AMB force-current constants by hanging known masses (thesis 6.6.1; equilibrium 6.11 with the corrected signs).

Measurand: dF/di of each radial AMB in the vertical axis at zero control current, rotor held where the position sensors
read zero, at the stated bias, mean over a full turn of the rotor. With it K2 (half of the second derivative) and the
tangent at the current that carries the rotor's own weight. Horizontal constants are not measured: no load acts there.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.errors import Lacking
from bench.figures import Figure
from bench.findings import Ended, Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, interval, propagate
from procedures.amb_calibration import turns
from procedures.amb_calibration.hanging import exercised, hung_up_and_down, sequence
from procedures.amb_calibration.inputs import fit_inputs, hand_rad
from procedures.amb_calibration.plan import FEWEST_MASSES, Plan
from procedures.amb_calibration.pulls import Loaded, Pull, pulls
from procedures.amb_calibration.requires import requires
from procedures.amb_calibration.steps import Hang, HangingData, hung, read_hangings
from procedures.amb_rotor import before_lift
from procedures.servomotor.loads import check_masses
from procedures.shared import assumptions, continued, first_look
from procedures.shared.default_masses import by_weight
from procedures.shared.weight import weight

if TYPE_CHECKING:
    from procedures.amb_calibration.fit import Fit
    from procedures.amb_calibration.hypotheses import Contradiction
    from procedures.amb_calibration.scatter import Scatter

K = Quantity("K", "N/A", "dF/di of a bearing's axis at zero control current, mean over a turn")
K2 = Quantity("K2", "N/A^2", "(d²F/di²)/2 of a bearing's axis, mean over a turn")
KW = Quantity("Kw", "N/A", "dF/di of a bearing's axis at the current that carries the rotor's own weight", title="K_w")
MEASURES = (K, K2, KW)
"""At each axis; of a shaft that a self-bearing motor turns at each bearing, along its upright axis."""


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """Controller parameters that the runner writes before levitation."""
    return dict.fromkeys(turns.biases(rig), plan.bias_A)


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records with one hook, for the progress display."""
    return plan.angles * len(sequence(plan))


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Hang every mass up and down at each angle, on each hook; its hanger stays on throughout. A run that goes on with a
    stopped one exercises the magnets anew, for they were off, and begins with the last hanging that was done."""
    found, done, each = pulls(rig.file), continued.done(record, Hang.kind), step_count(plan)
    for number, pull in enumerate(found):
        hook, first = pull.hook if len(found) > 1 else "", number * each
        if done.leaves_out(first + each - 1):
            continue  # the last hanging of all is on another hook
        if not exercised(rig, plan, record, pull, hook):
            return
        if not hung_up_and_down(rig, plan, record, pull, hook, done, first):
            return


@dataclass(frozen=True)
class Analysis:
    """Everything that what was hung on one hook says.

    `estimates` are without the scatter of the hangings, means over a turn and values by angle; `spread` (A, 4 K, 4 K) is its
    covariance at each angle. `loads` is what the masses say against each other, `beyond` (relative) what that adds to each."""

    data: HangingData
    inputs: dict[str, Estimate]
    fit: Fit
    scatter: Scatter
    loads: Contradiction
    beyond: float
    spread: np.ndarray
    estimates: dict[str, Estimate]
    identity: str = "scatter"


def evaluate(recording: Recording[Plan], findings: Findings) -> list[Analysis]:
    """Fit, scatter and estimates with their influences, of each hook."""
    from procedures.amb_calibration import checks

    rig, found = recording.rig, pulls(recording.rig)
    first_look.gate(recording, findings, ())
    findings.gate(checks.of_first(recording, found, {pull.hook: hung(rig, pull.hook) for pull in found}))
    findings.add(turns.findings(recording))
    return [_evaluated(recording, findings, pull, len(found) > 1) for pull in found]


def _evaluated(recording: Recording[Plan], findings: Findings, pull: Pull, several: bool) -> Analysis:
    from procedures.amb_calibration import both_coils, checks, halves, hypotheses

    plan = recording.plan
    data = read_hangings(recording, pull)
    findings.gate(checks.of_signals(data, turns.limits(recording.rig), plan), checks.FATAL)
    a = _fitted(recording, data)
    if several:
        a = replace(a, identity=f"scatter/{pull.hook}")
    values = {name: e.value for name, e in a.inputs.items()}
    told = _scattered(a)
    expanded = [interval(told[f"K_{key}"]).U for key in a.fit.pull.keys]
    findings.add(halves.findings(recording, data, a.fit, values, expanded))
    findings.gate(
        checks.of_fit(data, a.fit, a.scatter, a.loads, a.beyond, values, plan, masses_u(recording)), checks.FATAL
    )
    if hypotheses.mistaken(a.loads, a.beyond):
        raise Ended
    findings.gate(both_coils.of_fit(_scattered(a), data.hangings, plan.bias_A))
    return a


def measured(parts: list[Analysis]) -> Iterator[Measured]:
    """Three quantities of each axis, or bearing."""
    estimates = {name: e for a in parts for name, e in _scattered(a).items()}
    for quantity in MEASURES:
        for axis in (axis for a in parts for axis in a.fit.pull.axes):
            yield quantity.measured(estimates[f"{quantity.name}_{axis.key}"], axis.where)


def _scattered(a: Analysis) -> dict[str, Estimate]:
    """Three quantities of each axis with the scatter of the hangings."""
    from procedures.amb_calibration import by_angle as amb_calibration_by_angle
    from procedures.amb_calibration.scatter import covariance_over_a_turn, outputs

    keys = a.fit.pull.keys
    terms = amb_calibration_by_angle.scatter_terms(
        a.identity, covariance_over_a_turn(a.spread), a.scatter.dof, keys=keys
    )
    return {name: a.estimates[name] + terms[name] for name in outputs(keys)}


def facts(parts: list[Analysis]) -> dict[str, Estimate]:
    """What was measured, and K, K2 and F0 of each axis at each angle, all with one scatter for each angle: what a later
    procedure takes at one angle and what it takes over a turn then stay correlated as they are."""
    from procedures.amb_calibration import by_angle as amb_calibration_by_angle

    out: dict[str, Estimate] = {}
    for a in parts:
        keys = a.fit.pull.keys
        found = amb_calibration_by_angle.with_scatter(a.estimates, a.spread, a.scatter.dof, keys, a.identity)
        out |= {_fact(name, a.fit.pull.axes): e for name, e in found.items()}
    return out


def _fact(name: str, of: tuple[Loaded, ...]) -> str:
    """`K_KEY@3` as `K@PLACE, 3`."""
    quantity, _, angle = name.partition("@")
    kind, _, key = quantity.partition("_")
    place = next(axis.where for axis in of if axis.key == key)
    return f"{kind}@{place}, {angle}" if angle else f"{kind}@{place}"


def _fitted(recording: Recording[Plan], data: HangingData) -> Analysis:
    from procedures.amb_calibration import fit as amb_calibration_fit
    from procedures.amb_calibration import hypotheses
    from procedures.amb_calibration.estimates import less_sure, turned_by_hand, turning_point, unresolved_angles
    from procedures.amb_calibration.scatter import covariance_by_angle, outputs, scatter

    plan, rig = recording.plan, recording.rig
    inputs = fit_inputs(rig, plan.masses, data.hangings.pull)
    count = len(plan.masses)

    def model(p: Mapping[str, float], top_branch: float = 1.0) -> dict[str, float]:
        fitted = amb_calibration_fit.fit(data.hangings, p, plan.bias_A, count, top_branch=top_branch)
        by_angle = amb_calibration_fit.by_angle(fitted) | amb_calibration_fit.carried(fitted, p)
        return amb_calibration_fit.over_a_turn(fitted, p) | by_angle

    values = {name: e.value for name, e in inputs.items()}
    fitted = amb_calibration_fit.fit(data.hangings, values, plan.bias_A, count)
    spread = scatter(fitted, data.hangings, count)
    share = np.array(amb_calibration_fit.shares(fitted.pull, values))
    hanger = weight(values["hanger"], values["gravity"], values["air_density"], values["mass_density"])
    covariance = covariance_by_angle(fitted, spread, -share * float(hanger))
    loads = hypotheses.contradiction(fitted, data.hangings, spread, values, masses_u(recording))
    beyond = hypotheses.scatter_of_set(loads)
    masses = {label: rig.masses[label].value for label in plan.masses}
    estimates = {name: less_sure(e, masses, beyond) for name, e in propagate(model, inputs).items()}
    half_branch = model(values, top_branch=0.0)
    by_key = {axis.key: (k, axis) for k, axis in enumerate(fitted.pull.axes)}
    for name, estimate in estimates.items():
        k, axis = by_key[name.partition("@")[0].partition("_")[2]]
        estimates[name] = estimate + turning_point(axis, half_branch[name] - estimate.value)
        if name in outputs(fitted.pull.keys):
            estimates[name] += unresolved_angles(
                name, k, fitted, plan.bias_A, amb_calibration_fit.gap(axis.plane, values)
            )
            if turns.by_hand(rig) and plan.angles > 1:
                estimates[name] += turned_by_hand(name, k, fitted, hand_rad(rig))
    return Analysis(data, inputs, fitted, spread, loads, beyond, covariance, estimates)


def masses_u(recording: Recording[Plan]) -> np.ndarray:
    """Standard uncertainty in kg of the hanger (nothing hung) and of each mass."""
    rig = recording.rig
    return np.array([rig.hanger.standard_uncertainty,
                     *(rig.masses[m].standard_uncertainty for m in recording.plan.masses)])  # fmt: skip


def planned(rig: RigFile) -> Mapping[str, Any]:
    """All the masses that the rig has and may bear, the plan's own names where they are too few, which `check` says; the bias
    by default, of bearings that have unlike ones the least."""
    labels = by_weight(rig)
    found: dict[str, Any] = {"masses": labels} if len(labels) >= FEWEST_MASSES else {}
    with suppress(Lacking):  # a rig that it cannot run on: `lacking` says so
        biases = [rig.parameters[name].default for name in turns.biases(rig) if name in rig.parameters]
        found |= {"bias_A": min(biases)} if biases else {}
    return found


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    if len(rig.masses) < FEWEST_MASSES:
        yield f"masses: found {', '.join(rig.masses)}; expected {FEWEST_MASSES} or more, each heavier than the one before"
        return
    yield from check_masses(rig, plan.masses)
    if 1 < plan.angles < turns.FEWEST:
        yield (f"angles: found {plan.angles}; expected {turns.FEWEST} or more, for a mean over a turn, or 1 for a shaft that "
               "stays as it stands")  # fmt: skip


def figures(parts: list[Analysis], recording: Recording[Plan]) -> Iterable[Figure]:
    """Of each hook: fit, residuals, one step over time, and both polar plots."""
    from procedures.amb_calibration import figures as drawn

    for a in parts:
        values = {name: e.value for name, e in a.inputs.items()}
        for figure in drawn.all_figures(recording, a.data, a.fit, values):
            yield figure if len(parts) == 1 else replace(figure, key=f"{figure.key}-{a.fit.pull.hook}")


procedure = Procedure(
    name="amb-calibration",
    title="Force-current constants of the radial AMBs by hanging known masses",
    measures=MEASURES,
    state=RigState.LEVITATED,
    plan=Plan,
    planned=planned,
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    settings=settings,
    bring_up=before_lift.lifted,
    step_count=step_count,
    facts=facts,
    holds_for=lambda plan: {"bias_A": plan.bias_A, "angles": plan.angles},
    continues=Hang.kind,
    reached=("masses/*", "!masses/hanger", "!masses/density"),
    assumes=assumptions.AMB_CALIBRATION,
    method=read_method(__file__),
)
