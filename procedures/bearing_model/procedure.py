"""Force constant and magnetic offset of the radial AMBs from eccentric positions (thesis 2.3, Table 2.2).

Measurands, of each radial AMB and axis: beta of T (2.4b), and the offset: how far the shaft is from the
magnetic centre, at the AMB's plane, where both sensors of that axis read zero (their mean over a turn). Beside them what the
linear model without intercept, T (2.9), makes of the same data.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from bench.errors import DeviceFault, OperatorAbort
from bench.figures import Figure
from bench.findings import Finding, Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.procedure.states import transition
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from procedures.amb_rotor import frame, lift, liftable, pushes, rings
from procedures.amb_rotor.conventions import AMB_ROTOR, conventions
from procedures.amb_rotor.places import HOLD, LIFT, LIFT_LOST, REST, TILT, Held, of_readings, read_steps
from procedures.bearing_model.fitting import check
from procedures.bearing_model.grid import biases, count_places, places, tilts
from procedures.bearing_model.inputs import as_printed
from procedures.bearing_model.plan import Plan
from procedures.bearing_model.requires import requires
from procedures.bearing_model.stillness import await_still
from procedures.bearing_model.walking import Place, Walk
from procedures.shared import assumptions, first_look

if TYPE_CHECKING:
    from procedures.bearing_model.estimates import Analysis

OF_LINEAR = {
    "k_linear": Quantity("k_linear", "N/A", "K_i of the linear model without intercept (not a slope of the bearing)"),
    "stiffness_linear": Quantity("stiffness_linear", "N/m", "K_xi of the linear model without intercept"),
    "misfit": Quantity("misfit", "N^2", "sum of squared residuals of the nonlinear model, over all samples"),
    "misfit_linear": Quantity("misfit_linear", "N^2", "sum of squared residuals of the linear model, over all samples"),
    "misfit_ratio": Quantity("misfit_ratio", "1", "residual sum of the linear model over that of the nonlinear one"),
    "misfit_ratio_means": Quantity(
        "misfit_ratio_means",
        "1",
        "the same over batch means, where noise covers less",
        title="misfit ratio of batch means",
    ),
}
BY_AXIS = {
    "beta": Quantity("beta", "N m^2/A^2", "force constant of an axis, at the gap of the rig file"),
    "offset": Quantity("offset", "m", "from the magnetic centre of an axis to where the probes read zero"),
}
SLOPES = {
    "K_i": Quantity("K_i", "N/A", "dF/di of an axis at its magnetic centre, with the bias in both coils"),
    "K_x": Quantity("K_x", "N/m", "dF/dx of an axis at its magnetic centre, with the bias in both coils"),
}
"""Of stands other than that of the thesis, whose results are beta and offset."""
MEASURES = (*BY_AXIS.values(), *SLOPES.values(), *OF_LINEAR.values())
REST_S = 0.3
CENTRE: Place = {"y": 0.0, "z": 0.0}
UPRIGHT: Place = {"psi": 0.0, "theta": 0.0}
FAR = 3  # times as long as from place to place
BIAS_STEP_A = 0.1
REACHED = ("sensors/*", "!sensors/pos_*/offset", "!sensors/i_?o_p/gain", "geometry/amb_gap", "geometry/coupling_stiffness",
           "geometry/com_to_coupling", "geometry/com_to_*_sensor")  # fmt: skip
"""Certificates that the adjustment contradicts before an error of theirs moves a result by 2 U: where what one carries of a
result's standard uncertainty is less than what the positions say of it, both as shares (docs/reference/bearing-model.md)."""
ASKED = "Is the motor's coupling taken off the shaft, so that nothing but the AMBs holds it?"


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """Controller parameters that the runner writes before levitation: flatness with constant current sum."""
    machine = conventions(rig)
    integrating = machine.can.settings.get("integrator", {}).get("on", {})
    first = dict.fromkeys(machine.biases.values(), plan.biases_A[0]) if plan.biases_A else {}
    return {**machine.select(plan.law), **first, **integrating}


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records, for the progress display."""
    return 2 + len(tilts(plan)) + max(1, len(plan.biases_A)) * count_places(plan)


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Look at the shaft on its rings, lift it, tilt it a little, then the grid at each bias."""
    if not plan.coupled and not rig.operator.ask(ASKED):
        raise OperatorAbort("the coupling is on the shaft; expected it off, or a plan with coupled = true")
    with record.step(REST):
        rig.clock.sleep(REST_S)
    machine = conventions(rig.file)
    readings = {name: rig.levitation.reading(name) for name in machine.stations.channels}
    if any(rings.of_readings(readings, rig.file)) or any(pushes.judge(pushes.ask(rig, record), rig.file)):
        return
    if not first_look.passes(rig, record, liftable.judge(rig.file, record.calibrations, settings(rig.file, plan))):
        return
    if not _lift(rig, record):
        return
    rig.clock.sleep(3 * plan.settle_s)
    walk = Walk(rig, plan, record)
    tilted, at = _tilt(walk), CENTRE
    for k, bias in enumerate(biases(rig.file, plan)):
        if plan.biases_A:
            _set_bias(rig, plan, bias)
        if not as_printed(
            rig.file
        ):  # to the first place it is far; the stand of the thesis has recordings without a wait
            at = walk.go(at, dict(zip("yz", _first_of(rig.file, plan, k), strict=True)), FAR * plan.settle_s)
            await_still(rig, record, machine.currents)
        held = []
        for y, z in places(rig.file, plan) if k % 2 == 0 else reversed(places(rig.file, plan)):
            at = walk.go(at, {"y": y, "z": z}, plan.settle_s)
            with record.step(HOLD, y_m=y, z_m=z, **({"bias_A": bias} if math.isfinite(bias) else {})):
                held.append(_watched(rig, plan, record))
        if k == 0 and not first_look.passes(rig, record, _of_first(rig.file, plan, held, tilted)):
            return
    walk.go(at, CENTRE, plan.settle_s)


def _first_of(rig: RigFile, plan: Plan, k: int) -> tuple[float, float]:
    """Where pass `k` begins: every second one goes backwards."""
    return places(rig, plan)[0 if k % 2 == 0 else -1]


def _lift(rig: Rig, record: Recorder) -> bool:
    with record.step(LIFT):
        try:
            transition(rig, RigState.LEVITATED)
        except DeviceFault as fault:
            record.event(LIFT_LOST, fault=str(fault))
            return False
    return True


def _set_bias(rig: Rig, plan: Plan, bias: float) -> None:
    """In small steps: each one is a push, until the integrators have taken it up."""
    biases = tuple(dict.fromkeys(conventions(rig.file).biases.values()))
    before = rig.levitation.get(biases[0])
    count = math.ceil(abs(bias - before) / BIAS_STEP_A - 1e-3)
    for k in range(count):
        lift.write(rig, dict.fromkeys(biases, before + (bias - before) * (k + 1) / count))
        rig.clock.sleep(plan.settle_s / 2)
    rig.clock.sleep(plan.settle_s if count else 0.0)


def _watched(rig: Rig, plan: Plan, record: Recorder) -> dict[str, float]:
    """Positions and currents at a place, as they come while the step is recorded, SI."""
    machine = conventions(rig.file)
    return first_look.watched(rig, record, (*machine.stations.channels, *machine.currents), plan.average_s)


def _of_first(
    rig: RigFile, plan: Plan, held: Sequence[Mapping[str, float]], tilted: Sequence[Mapping[str, float]]
) -> list[Finding]:
    """What the positions at the first bias show of the wiring, by what was read in each."""
    from procedures.bearing_model import wiring

    (y, z), (psi, theta) = zip(*places(rig, plan), strict=True), zip(*tilts(plan), strict=True)
    machine = conventions(rig)
    first = of_readings({"y_m": y, "z_m": z}, held, machine)
    tilt = of_readings({"psi_rad": psi, "theta_rad": theta}, tilted, machine)
    return list(wiring.of_wiring(first, tilt, rig)) or list(wiring.of_models(first, tilt, rig, plan))


def _tilt(walk: Walk) -> list[dict[str, float]]:
    rig, plan, record = walk.rig, walk.plan, walk.record
    seen = []
    at: Place = UPRIGHT
    for psi, theta in tilts(plan):
        at = walk.go(at, {"psi": psi, "theta": theta}, plan.settle_s)
        with record.step(TILT, psi_rad=psi, theta_rad=theta):
            seen.append(_watched(rig, plan, record))
    lift.write(rig, conventions(rig.file).point("theta", 0.0))
    return seen


def read(recording: Recording[Plan]) -> tuple[Held, Held]:
    """The positions, and the tilts before them."""
    batches = recording.plan.batches
    return read_steps(recording, HOLD, ("y_m", "z_m", "bias_A"), batches), read_steps(
        recording, TILT, ("psi_rad", "theta_rad"), batches
    )


def evaluate(recording: Recording[Plan], findings: Findings) -> Analysis:
    """The adjustment of all positions, and both models compared."""
    from procedures.bearing_model import checks, estimates

    findings.gate([*rings.before(recording), *pushes.of_recording(recording), *liftable.of_recording(recording)])
    held, tilted = read(recording)
    findings.gate(first_look.with_first(recording, _of_data(recording, held, tilted)), checks.FATAL)
    a = estimates.evaluate(recording, held)
    findings.add(checks.of_results(a, recording.plan))
    findings.add(checks.of_runout(recording.rig))
    findings.add(frame.describe(recording.rig, ("y", "z")))
    return a


def measured(a: Analysis) -> Iterator[Measured]:
    """Each axis, then the comparison of each AMB."""
    from procedures.bearing_model.comparison import COMPARED

    for axis in a.held.machine.axes:
        for name, quantity in (BY_AXIS if axis in AMB_ROTOR.axes else {**BY_AXIS, **SLOPES}).items():
            if f"{name}_{axis}" in a.estimates:
                yield quantity.measured(a.estimates[f"{name}_{axis}"], axis)
    for where in a.held.machine.planes:
        for name in (n for n in COMPARED if f"{n}_{where}" in a.estimates):
            yield OF_LINEAR[name].measured(a.estimates[f"{name}_{where}"], where)


def _of_data(recording: Recording[Plan], held: Held, tilted: Held) -> Iterator[Finding]:
    from procedures.bearing_model import checks, wiring

    plan, rig = recording.plan, recording.rig
    found = [*checks.of_signals(held, tilted, plan), *wiring.of_wiring(held, tilted, rig)]
    yield from found
    if not any(f.code in checks.FATAL for f in found):
        yield from wiring.of_models(held, tilted, rig, plan)


def figures(a: Analysis, recording: Recording[Plan]) -> Iterable[Figure]:
    """Positions, currents, forces by both models and residuals."""
    from procedures.bearing_model import figures as drawn

    return drawn.all_figures(a, recording.rig)


procedure = Procedure(
    name="bearing-model",
    title="Force constants and magnetic offsets of the radial AMBs by eccentric positioning",
    measures=MEASURES,
    optional=(
        *BY_AXIS.values(),
        *SLOPES.values(),
    ),  # each rig has its own axes; one without a load has no force constant
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
    reached=REACHED,
    assumes=assumptions.BEARING_MODEL,
    method=read_method(__file__),
)
